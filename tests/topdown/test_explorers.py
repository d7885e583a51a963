"""The explorers in C and with numpy find what the one in Python finds: states, edges, findings,
rows that were used, on sound designs and on spoilt ones.
"""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice
from typing import Any

import pytest
from msgspec.structs import replace
from small import (
    ASKER,
    FLICKERS,
    HAND,
    LAMP,
    SLOW,
    TOLD,
    WATCHED,
    WATCHER,
    design,
    instead,
    less,
    questions,
    row,
    watching,
)
from test_machines import FAILS, RULE, ruled
from test_proving_groups import with_group
from test_proving_spin import MODELS

from companion.design import DESIGN
from topdown.model.design import Design
from topdown.prove import batches, compiled, engine, flat
from topdown.prove.engine import DEADLOCK, UNREACHED, WRONG, Exploration, explore
from topdown.prove.fleet import ANY, Faults, Fleet
from topdown.prove.net import NetModel
from topdown.prove.pairs import explore_use
from topdown.prove.verify import waiting

needs_compiler = pytest.mark.skipif(
    compiled.library() is None,
    reason=(
        "needs topdown.prove.compiled (Debian: apt install gcc libc6-dev, then .venv/bin/python -m"
        " topdown.prove.compiled)"
    ),
)
EXPLORERS = (pytest.param(True, marks=needs_compiler, id="C"), pytest.param(False, id="numpy"))


@pytest.fixture(params=EXPLORERS, autouse=True)
def in_c(request: pytest.FixtureRequest) -> bool:
    """Whether the explorer in C is compared with the one in Python, or the one with numpy."""
    return bool(request.param)


def told(found: Exploration) -> tuple[object, ...]:
    """What both must say."""
    findings = [(one.kind, one.text, len(one.trace)) for one in found.findings]
    return found.states, found.edges, found.complete, found.unproven, sorted(findings)


def both(in_c: bool, work: Callable[[], Any]) -> tuple[Any, Any]:
    """What the explorer over tables makes of it, and the one in Python; each is asked as it should
    be.
    """
    asked: list[object] = []

    def explorer(model: object) -> flat.Explorer | None:
        asked.append(search := flat.explorer(model) if in_c else None)
        return search

    def batched(model: flat.Tabled, first: bool, pause: int) -> batches.Batches:
        asked[-1] = search = batches.Batches(model, first, pause)
        return search

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "explorer", explorer)
        patch.setattr(batches, "batched", batched)
        patch.setattr(engine, "FEW", 0)
        fast = work()
        assert all(asked)
        assert asked
        patch.setattr(engine, "explorer", lambda model: None)
        patch.setattr(engine, "FEW", 1 << 31)
        return fast, work()


def composed(in_c: bool, made: Design, faults: Faults, **limits: Any) -> Exploration:
    """What is found of a fleet; both explorers must agree in it."""

    def work() -> tuple[object, ...]:
        model = Fleet(made, faults)
        found = explore(model, **limits)
        return found, told(found), model.not_silent(), model.unused(), model.used

    (found, *fast), (_, *plain) = both(in_c, work)
    assert fast == plain
    assert isinstance(found, Exploration)
    return found


def without_each(made: Design, every: int = 1) -> Iterator[Design]:
    """The design without one of its rows, for each row or every few of them."""
    for place, agent in enumerate(made.file.agent):
        for number in islice(range(len(agent.row)), 0, None, every):
            less = replace(agent, row=(*agent.row[:number], *agent.row[number + 1 :]))
            agents = (*made.file.agent[:place], less, *made.file.agent[place + 1 :])
            yield Design(replace(made.file, agent=agents), made.path)


@pytest.mark.parametrize("most", [0, 1, 2, ANY])
def test_small_designs_and_each_without_one_of_its_rows(in_c: bool, most: int) -> None:
    """Durable, asked, observed; all kinds of findings are among them, the first and all."""
    kinds = set()
    for made in (design(HAND, LAMP), questions(ASKER, SLOW), watching(WATCHER, WATCHED)):
        for spoilt in (made, *without_each(made)):
            for first in (True, False):
                limits = {"first": first, "most_states": 4000}
                found = composed(in_c, spoilt, Faults(most), **limits)
                kinds |= {one.kind for one in found.findings}
    assert kinds == {DEADLOCK, UNREACHED, WRONG}


def test_what_is_wrong_with_a_move(in_c: bool) -> None:
    """A rule of the design is broken, an act begun twice, a queue overfull."""
    lamp = instead(WATCHED, ', when = ["watch settled"]', "")
    again = row("busy", "own again", moves="switch")
    hand = (*less(HAND, "regret"), TOLD.replace(" }", ', say = ["switch cancel"] }'), TOLD)
    for made, words in (
        (watching(lamp=lamp, more=RULE), "idle before it is known"),
        (ruled("watch agree", "lamp watch asked"), "rule"),
        (ruled("watch failure", "lamp owes watch", FAILS), "rule"),
        (design(HAND, (*LAMP, again)), "begins an act twice"),
        (design(hand, (*less(LAMP, "refuse"), FLICKERS)), "more than 5 words wait"),
    ):
        found = composed(in_c, made, Faults(1), first=False, most_states=4000)
        assert any(words in one.text for one in found.findings), (words, told(found))


def test_groups_and_an_agent_that_dies_for_good(in_c: bool) -> None:
    """A group waits while its queue is full; waits are over once the agent is dead."""
    for group, rows, use in (("lamp", HAND, "switch"), ("hand", LAMP, "switch")):
        for most in (0, ANY):
            composed(
                in_c, with_group(group, rows, use), Faults(most), first=False, most_states=4000
            )
    for made in (design(HAND, LAMP), questions(), watching()):
        for gone, left in (("hand", ("lamp",)), ("lamp", ("hand",))):
            for most in (0, 1):
                composed(in_c, made, Faults(most, gone=gone, waiting=left), first=False)


@pytest.mark.parametrize(
    "faults",
    [Faults(0), Faults(0, boot=True), *(Faults(0, gone=one) for one in ("ta", "ex", "pl", "km"))],
)
def test_the_companion(in_c: bool, faults: Faults) -> None:
    """Its rest without faults, its start up to a bound, each agent's death for good."""
    left = waiting(DESIGN, faults.gone) if faults.gone else ()
    wish = faults._replace(waiting=left)
    assert not composed(in_c, DESIGN, wish, most_states=20_000).findings


def test_the_companion_without_some_of_its_rows(in_c: bool) -> None:
    """With a fault, up to a bound; the search stops at the same state."""
    for spoilt in without_each(DESIGN, 7):
        composed(in_c, spoilt, Faults(1), most_states=2500)


@pytest.mark.parametrize("name", MODELS)
def test_nets(in_c: bool, name: str) -> None:
    """Those about which spin is asked, the first finding and all."""
    for first in (True, False):
        fast, plain = both(
            in_c, lambda first=first: told(explore(NetModel(MODELS[name]()), first=first))
        )
        assert fast == plain


def test_uses_of_protocols(in_c: bool) -> None:
    """States that were never reached as well."""
    for use in DESIGN.file.protocol:
        fast, plain = both(in_c, partial(explore_use, DESIGN, use.name, 0))
        assert told(fast.exploration) == told(plain.exploration)
        assert fast.unreached == plain.unreached


def test_what_the_tables_have_no_room_for_is_explored_in_python(
    monkeypatch: pytest.MonkeyPatch, in_c: bool
) -> None:
    """As if there were no tables, from the start."""
    if not in_c:
        monkeypatch.setattr(engine, "explorer", lambda model: None)
        monkeypatch.setattr(engine, "FEW", 0)
    wanted = told(explore(Fleet(design(HAND, LAMP), Faults(1))))
    monkeypatch.setattr(flat, "NOTHING", 3)
    model = Fleet(design(HAND, LAMP), Faults(1))
    search = flat.explorer(model) if in_c else batches.Batches(model, True, 1)
    assert search is not None
    with pytest.raises(flat.TooLarge):
        assert all(search.run() is flat.Status.PAUSE for _ in range(9))
    assert told(explore(Fleet(design(HAND, LAMP), Faults(1)))) == wanted
