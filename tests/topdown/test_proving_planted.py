"""Designs with a mistake planted in them, each of which a proof once took for right: now each is
found.
"""

import pytest
from msgspec.structs import replace
from small import (
    ANSWERER,
    ASKER,
    FLICKERS,
    HAND,
    HEAD,
    LAMP,
    STUCK,
    TOLD,
    agent,
    design,
    instead,
    less,
    questions,
    row,
    use,
    verdicts,
)

from topdown.check import machines
from topdown.model import loading
from topdown.model.design import Design
from topdown.model.findings import Kind
from topdown.prove.engine import UNREACHED, explore
from topdown.prove.fleet import Faults, Fleet
from topdown.prove.verify import Verdict, tasks, waiting


def died(made: Design) -> Verdict:
    """The verdict where the lamp dies for good."""
    return verdicts(made, layers=(3,), gone=["lamp"])[-1]


def kinds(verdict: Verdict) -> set[str]:
    """The kinds of its findings; none if it holds."""
    assert verdict.findings or verdict.holds, verdict.open
    return {one.kind for one in verdict.findings}


# --- an agent that dies for good ------------------------------------------------------------------

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
    assert kinds(died(made)) & set(STUCK)
    asks = instead(ASKER, "own wonder", "person wonder")
    assert not kinds(died(watched_by_a_cat(asks, "ask", lamp=ANSWERER)))


def test_who_must_come_to_rest() -> None:
    """Those with `person` rows; where nobody has one, everybody; never the one that is gone."""
    assert waiting(watched_by_a_cat(PATIENT), "lamp") == ("cat", "hand")
    assert waiting(watched_by_a_cat(PATIENT), "hand") == ("cat",)
    assert waiting(design(instead(PATIENT, "person wish", "own wish"), LAMP), "lamp") == ("hand",)


def test_nobody_is_left_whose_wish_could_end() -> None:
    """The question makes no sense, which is said with what would."""
    with pytest.raises(ValueError, match=r"hand alone has `person` rows.*name another agent: lamp"):
        list(tasks(design(HAND, LAMP), layers=(3,), gone=["hand"]))


# --- a search that stops early --------------------------------------------------------------------


def beside(number: int) -> str:
    """Two agents more that have nothing to do with the others: one asks the other to switch, over
    and over.
    """
    hand, lamp, mine = f"hand{number}", f"lamp{number}", f"switch{number}"
    said = {hand: "request cancel", lamp: "agree refuse inform"}
    rows = [
        [one.replace("switch ", f"{mine} ").replace('"switch"', f'"{mine}"') for one in rows]
        for rows in (HAND, LAMP)
    ]
    agents = agent(hand, "idle waiting", rows[0]) + agent(lamp, "idle busy", rows[1])
    return use(mine, "request", said) + agents


def test_what_is_wrong_within_a_limit_is_found() -> None:
    """A lamp that never says that it is lit, once it has agreed; three pairs beside it make the
    states many.
    """
    made = design(less(HAND, "regret"), less(LAMP, "own lit"), more="".join(map(beside, range(3))))
    found = explore(Fleet(made, Faults(0)), most_states=3_000)
    assert not found.complete
    (one,) = found.findings
    assert (one.kind, len(one.trace)) == (UNREACHED, 2)
    assert one.trace[-1].what == "switch request <- hand; switch agree -> hand"


# --- agents that wait for each other --------------------------------------------------------------


def ring(*names: str, heard: str = "") -> Design:
    """Each asks the next and answers nobody while it waits; `heard`: but for the one that tells the
    time.
    """
    pairs = list(zip(names, (*names[1:], names[0]), strict=True))
    entries = [use(f"{a}_{b}", "request", {a: "request", b: "inform"}) for a, b in pairs]
    entries += [
        asking(mine, f"{mine}_{after}", f"{before}_{mine}", mine == heard)
        for (mine, after), (before, _) in zip(pairs, (pairs[-1], *pairs[:-1]), strict=True)
    ]
    if heard:
        entries.append(use("time", "request", {"clock": "request", heard: "inform"}))
        ticks = row("idle", "person looks", say="time request", to="asking")
        hears = row("asking", "time inform", to="idle")
        entries.append(agent("clock", "idle asking", (ticks, hears), talks=("time", "time")))
    return read("".join(entries))


def read(entries: str) -> Design:
    """A design of these entries."""
    return Design(loading.read(HEAD + entries), "ring.toml", HEAD + entries)


def asking(name: str, mine: str, theirs: str, hears: bool) -> str:
    """An agent of the ring: its states, what they talk in, and its rows."""
    rows = [
        row("idle", "own wish", say=f"{mine} request", to="asking"),
        row("idle", f"{theirs} request", say=f"{theirs} inform"),
        row("asking", f"{mine} inform", to="idle"),
    ]
    if hears:
        rows.append(row("idle, asking", "time request", say="time inform"))
    time = ",time" if hears else ""
    return agent(name, "idle asking", rows, talks=(f"{mine},{theirs}{time}", f"{mine}{time}"))


def talking(**talks: dict[str, str]) -> Design:
    """Agents in a ring (use `ab`: a asks b); agent -> state -> uses that it talks in there."""
    names = list(talks)
    pairs = zip(names, (*names[1:], names[0]), strict=True)
    uses = [use(f"{a}{b}", "query", {a: "", b: ""}, durable=False) for a, b in pairs]
    agents = [agent(a, " ".join(one), (), talks=one.values()) for a, one in talks.items()]
    return read("".join((*uses, *agents)))


SERVES_B = {"idle": "ba", "asking": "ab"}
SERVES_A = {"idle": "ab", "asking": "ba"}


@pytest.mark.parametrize(
    "talks",
    [
        {"a": SERVES_B | {"asking": "ab,ba"}, "b": SERVES_A},  # answers while it waits
        {"a": SERVES_B, "b": SERVES_A | {"asking": "ab,ba"}},
        {"a": {"idle": "ab", "serving": "ba"}, "b": {"idle": "ba", "serving": "ab"}},  # rests
        {"a": {"idle": "ab", "serving": "ba"}, "b": SERVES_A | {"other": "ab"}},  # asks nobody
    ],
)
def test_only_a_closed_set_of_deaf_states_waits(talks: dict[str, dict[str, str]]) -> None:
    """Two that have asked each other, and neither answers; not where one listens or rests."""
    (found,) = machines.wait_findings(talking(a=SERVES_B, b=SERVES_A))
    assert "a in asking for b, b in asking for a" in found.wrong
    assert list(machines.wait_findings(talking(**talks))) == []


def test_a_wait_that_the_check_does_not_see_is_found() -> None:
    """Three ask in a ring. Where one tells a clock the time meanwhile, no set is closed, and all
    wait.
    """
    (waits,) = machines.wait_findings(ring("a", "b", "c"))
    assert (waits.kind, waits.where) == (Kind.WAITS, "agent a, agent b, agent c")
    hidden = ring("a", "b", "c", heard="b")
    assert list(machines.wait_findings(hidden)) == []
    (found,) = verdicts(hidden, layers=(3,), faults=0)[-1].findings
    assert found.kind in STUCK
    assert [found.trace[-1].after[name].split(";")[0] for name in "abc"] == ["asking"] * 3


# --- a queue that words without effect fill -------------------------------------------------------


@pytest.mark.parametrize(
    ("more", "endless"),
    [
        (FLICKERS, True),
        (FLICKERS.replace("say =", "may ="), True),
        (FLICKERS.replace("own flicker", "person looks"), True),
        (FLICKERS.replace("] }", '], to = "lit" }'), False),
        (
            row("busy", "switch cancel", say="switch inform[cancel], switch inform[progress]"),
            False,
        ),
    ],
)
def test_progress_without_end_is_told_among_what_is_not_proven(more: str, endless: bool) -> None:
    """It is not in the model, so a queue that it fills is not seen there; what is taken in between
    paces it.
    """
    lit = [one.replace("busy", "lit") for one in LAMP[2:]]
    start, last = verdicts(design((*HAND, TOLD), (*LAMP, more, *lit)), layers=(3,))
    assert last.holds
    assert start.beyond == ()
    told = "how many `switch inform[progress]` of lamp wait for hand: in busy on"
    assert [told in one for one in last.beyond] == [True] * endless


def test_a_question_without_end_fills_no_queue() -> None:
    """Only the newest of it is on the way."""
    muses = row("idle", "own muse", may="ask query-ref")
    assert verdicts(questions((*ASKER, muses)), layers=(3,))[-1].beyond == ()
