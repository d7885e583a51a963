"""Designs with a mistake planted in them, each of which a proof once took for right: now each is found."""

from collections.abc import Iterable

import pytest
from msgspec.structs import replace
from small import ASKER, HAND, LAMP, STUCK, design, instead, less

from topdown.model.design import Design
from topdown.prove.engine import UNREACHED, explore
from topdown.prove.fleet import Faults, Fleet
from topdown.prove.verify import Verdict, tasks, waiting


def verdicts(made: Design, **wish: object) -> list[Verdict]:
    """All of layer 3, worked out."""
    return [task.run(None) for task in tasks(made, layers=(3,), **wish)]  # type: ignore[arg-type]


def kinds(verdict: Verdict) -> set[str]:
    """The kinds of its findings; none if it holds."""
    assert verdict.findings or verdict.holds, verdict.open
    return {one.kind for one in verdict.findings}


# --- an agent that dies for good --------------------------------------------------------------------------------------

BYSTANDER = """
[[agent]]
name = "cat"
initial = "idle"
state = [{ name = "idle", behaviour = "b", terminal = "t" }]
row = [{ in = ["idle"], on = "person strokes" }]
"""
PATIENT = less(HAND, "person regret")
"""Its wish has no end once the lamp is gone."""


def watched_by_a_cat(hand: tuple[str, ...], *uses: str, lamp: tuple[str, ...] = LAMP) -> Design:
    """Persons also stroke a cat, which is listed first and waits for nobody."""
    made = design(hand, lamp, *uses, more=BYSTANDER)
    *others, cat = made.file.agent
    return Design(replace(made.file, agent=(cat, *others)), made.path)


def test_a_wish_without_an_end_is_found_whoever_is_listed_first() -> None:
    """All to whom persons talk must come to rest, not only the first."""
    made = watched_by_a_cat(PATIENT)
    assert made.file.agent[0].name == "cat"
    assert kinds(verdicts(made, gone=["lamp"])[-1]) & set(STUCK)
    asks = instead(ASKER, "own wonder", "person wonder")
    answers = ('{ in = ["idle"], on = "ask query-ref", say = ["ask inform"] }',)
    assert not kinds(verdicts(watched_by_a_cat(asks, "ask", lamp=answers), gone=["lamp"])[-1])


def test_who_must_come_to_rest() -> None:
    """Those with `person` rows; where nobody has one, everybody; never the one that is gone."""
    assert waiting(watched_by_a_cat(PATIENT), "lamp") == ("cat", "hand")
    assert waiting(watched_by_a_cat(PATIENT), "hand") == ("cat",)
    assert waiting(design(instead(PATIENT, "person wish", "own wish"), LAMP), "lamp") == ("hand",)


def test_nobody_is_left_whose_wish_could_end() -> None:
    """The question makes no sense, which is said with what would."""
    with pytest.raises(ValueError, match=r"hand alone has `person` rows.*name another agent: lamp"):
        list(tasks(design(HAND, LAMP), layers=(3,), gone=["hand"]))


# --- a search that stops early ----------------------------------------------------------------------------------------


def beside(number: int) -> str:
    """Two agents more that have nothing to do with the others: one asks the other to switch, over and over."""
    hand, lamp, use = f"hand{number}", f"lamp{number}", f"switch{number}"
    said = [*((hand, act) for act in ("request", "cancel")), *((lamp, act) for act in ("agree", "refuse", "inform"))]
    messages = ", ".join(f'{{ sender = "{who}", performative = "{act}", language = "L" }}' for who, act in said)
    protocol = f"""
[[protocol]]
name = "{use}"
channel = "C1"
follows = "request"
initiator = "{hand}"
participant = "{lamp}"
durable = true
message = [{messages}]
"""
    rows = [
        [row.replace("switch ", f"{use} ").replace('"switch"', f'"{use}"') for row in rows] for rows in (HAND, LAMP)
    ]
    return protocol + agent(hand, "idle waiting", rows[0]) + agent(lamp, "idle busy", rows[1])


def agent(name: str, states: str, rows: Iterable[str]) -> str:
    """Its entry."""
    listed = ", ".join(f'{{ name = "{state}", behaviour = "b", terminal = "t" }}' for state in states.split())
    return f'\n[[agent]]\nname = "{name}"\ninitial = "idle"\nstate = [{listed}]\nrow = [{", ".join(rows)}]\n'


def test_what_is_wrong_within_a_limit_is_found() -> None:
    """A lamp that never says that it is lit, once it has agreed; three pairs beside it make the states many."""
    made = design(less(HAND, "regret"), less(LAMP, "own lit"), more="".join(map(beside, range(3))))
    found = explore(Fleet(made, Faults(0)), most_states=3_000)
    assert not found.complete
    (one,) = found.findings
    assert (one.kind, len(one.trace)) == (UNREACHED, 2)
    assert one.trace[-1].what == "switch request <- hand; switch agree -> hand"
