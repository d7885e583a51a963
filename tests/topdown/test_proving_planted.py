"""Designs with a mistake planted in them, each of which a proof once took for right: now each is
found.
"""

from collections.abc import Iterable

import pytest
from msgspec.structs import replace
from small import ASKER, HAND, HEAD, LAMP, STUCK, design, instead, less

from topdown.check import machines
from topdown.model import loading
from topdown.model.design import Design
from topdown.model.findings import Kind
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


# --- a search that stops early --------------------------------------------------------------------


def beside(number: int) -> str:
    """Two agents more that have nothing to do with the others: one asks the other to switch, over
    and over.
    """
    hand, lamp, use = f"hand{number}", f"lamp{number}", f"switch{number}"
    said = [
        *((hand, act) for act in ("request", "cancel")),
        *((lamp, act) for act in ("agree", "refuse", "inform")),
    ]
    messages = ", ".join(
        f'{{ sender = "{who}", performative = "{act}", language = "L" }}' for who, act in said
    )
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
        [row.replace("switch ", f"{use} ").replace('"switch"', f'"{use}"') for row in rows]
        for rows in (HAND, LAMP)
    ]
    return protocol + agent(hand, "idle waiting", rows[0]) + agent(lamp, "idle busy", rows[1])


def agent(name: str, states: str, rows: Iterable[str], *talks: str) -> str:
    """Its entry; `talks`: uses that each state talks in, the last one's for the states that are
    left.
    """
    talked = [
        tuple(talks[min(number, len(talks) - 1)].split()) if talks else () for number in range(2)
    ]
    listed = ", ".join(
        f'{{ name = "{state}", behaviour = "b", terminal = "t", talks = [{_quoted(uses)}] }}'
        for state, uses in zip(states.split(), talked, strict=True)
    )
    return (
        f'\n[[agent]]\nname = "{name}"\ninitial = "idle"\nstate = [{listed}]\nrow ='
        f" [{', '.join(rows)}]\n"
    )


def _quoted(words: Iterable[str]) -> str:
    return ", ".join(f'"{word}"' for word in words)


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
    uses = [use(f"{one}_{other}", one, other) for one, other in pairs]
    agents = [
        asking(mine, f"{mine}_{after}", f"{before}_{mine}", mine == heard)
        for (mine, after), (before, _) in zip(pairs, (pairs[-1], *pairs[:-1]), strict=True)
    ]
    if heard:
        uses.append(use("time", "clock", heard))
        ticks = '{ in = ["idle"], on = "person looks", say = ["time request"], to = "asking" }'
        agents.append(
            agent(
                "clock",
                "idle asking",
                (ticks, '{ in = ["asking"], on = "time inform", to = "idle" }'),
                "time",
            )
        )
    whole = HEAD + "\n".join((*uses, *agents))
    return Design(loading.read(whole), "ring.toml", whole)


def use(name: str, asker: str, answerer: str) -> str:
    """A use of request, answered at once."""
    said = ((asker, "request"), (answerer, "inform"))
    messages = ", ".join(
        f'{{ sender = "{who}", performative = "{act}", language = "L" }}' for who, act in said
    )
    return (
        f'\n[[protocol]]\nname = "{name}"\nchannel = "C1"\nfollows = "request"\ninitiator ='
        f' "{asker}"\nparticipant = "{answerer}"\ndurable = true\nmessage = [{messages}]'
    )


def asking(name: str, mine: str, theirs: str, hears: bool) -> str:
    """An agent of the ring: its states, what they talk in, and its rows."""
    rows = [
        f'{{ in = ["idle"], on = "own wish", say = ["{mine} request"], to = "asking" }}',
        f'{{ in = ["idle"], on = "{theirs} request", say = ["{theirs} inform"] }}',
        f'{{ in = ["asking"], on = "{mine} inform", to = "idle" }}',
    ]
    time = ["time"] if hears else []
    if hears:
        rows.append('{ in = ["idle", "asking"], on = "time request", say = ["time inform"] }')
    return agent(
        name, "idle asking", rows, " ".join((mine, theirs, *time)), " ".join((mine, *time))
    )


def test_a_wait_that_the_check_does_not_see_is_found() -> None:
    """Three ask in a ring. Where one tells a clock the time meanwhile, no set is closed, and all
    wait.
    """
    assert [one.kind for one in machines.wait_findings(ring("a", "b", "c"))] == [Kind.WAITS]
    hidden = ring("a", "b", "c", heard="b")
    assert list(machines.wait_findings(hidden)) == []
    (found,) = verdicts(hidden, faults=0)[-1].findings
    assert found.kind in STUCK
    assert [found.trace[-1].after[name].split(";")[0] for name in "abc"] == ["asking"] * 3


# --- a queue that words without effect fill -------------------------------------------------------

TOLD = '{ in = ["waiting"], on = "switch inform[progress]" }'
FLICKERS = (
    '{ in = ["busy"], on = "own flicker", when = ["switch agreed"], say = ["switch'
    ' inform[progress]"] }'
)


@pytest.mark.parametrize(
    ("row", "endless"),
    [
        (FLICKERS, True),
        (FLICKERS.replace("say =", "may ="), True),
        (FLICKERS.replace("own flicker", "person looks"), True),
        (FLICKERS.replace("] }", '], to = "lit" }'), False),
        (
            FLICKERS.replace("own flicker", "switch cancel").replace(
                'say = ["', 'say = ["switch inform[cancel]", "'
            ),
            False,
        ),
    ],
)
def test_progress_without_end_is_told_among_what_is_not_proven(row: str, endless: bool) -> None:
    """It is not in the model, so a queue that it fills is not seen there; what is taken in between
    paces it.
    """
    ends = (
        '{ in = ["lit"], on = "own lit", when = ["switch agreed"], say = ["switch inform"], to ='
        ' "idle" }'
    )
    called = '{ in = ["lit"], on = "switch cancel", say = ["switch inform[cancel]"], to = "idle" }'
    lamp = (*less(LAMP, "own lit", "cancel"), LAMP[2], LAMP[3], row, ends, called)
    start, last = verdicts(design((*HAND, TOLD), lamp))
    assert last.holds
    assert start.beyond == ()
    assert bool(last.beyond) is endless
    assert (
        not endless
        or "how many `switch inform[progress]` of lamp wait for hand: in busy on" in last.beyond[0]
    )


def test_a_question_without_end_fills_no_queue() -> None:
    """Only the newest of it is on the way."""
    muses = '{ in = ["idle"], on = "own muse", may = ["ask query-ref"] }'
    answers = ('{ in = ["idle"], on = "ask query-ref", say = ["ask inform"] }',)
    assert verdicts(design((*ASKER, muses), answers, "ask"))[-1].beyond == ()
