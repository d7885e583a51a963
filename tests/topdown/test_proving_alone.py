"""`--alone`: an agent by itself, among groups that say what its peers' tables allow, meets all that
it meets in the whole design; so what is wrong with it there is wrong here.
"""

from collections.abc import Iterable
from typing import Any

import pytest
from small import (
    ASKER,
    HAND,
    LAMP,
    SLOW,
    WATCHED,
    WATCHER,
    design,
    instead,
    less,
    questions,
    row,
    watching,
)
from test_explorers import without_each
from test_machines import RULE

from companion.design import DESIGN
from topdown.model.design import Design
from topdown.prove.engine import WRONG, explore
from topdown.prove.fleet import OVERFULL, Faults, Fleet, among_groups
from topdown.prove.local import Local
from topdown.prove.verify import Verdict, tasks

Met = set[tuple[Local, tuple[Any, ...]]]
"""States of an agent, each with what waits in its queues."""


def met(model: Fleet, agent: str) -> Met:
    """What an agent meets in any state."""
    place, queues = model.parts.place[agent], model.parts.queues
    inbound = [slot for slot, number in model.inbound if number == place]
    reached = explore(model, first=False, keep=True).reached
    return {
        (
            model.parts.local(place, state[place]),
            tuple(queues.values[state[slot]] for slot in inbound),
        )
        for state in reached
        if isinstance(state[0], int)
    }


def wrong(model: Fleet) -> set[str]:
    """What is wrong, but for queues: a group takes what changes nothing at once."""
    found = explore(model, first=False).findings
    return {one.text for one in found if one.kind == WRONG and not one.text.startswith(OVERFULL)}


def alone(made: Design, **wish: Any) -> list[Verdict]:
    """The verdicts of `--alone`."""
    return [task.run(None) for task in tasks(made, layers=(3,), alone=True, **wish)]


def spoilt() -> Iterable[Design]:
    """Sound designs of each kind of channel, and each without one of its rows."""
    for made in (design(HAND, LAMP), questions(ASKER, SLOW), watching(WATCHER, WATCHED)):
        yield made
        yield from without_each(made)


@pytest.mark.parametrize("most", [0, 1])
def test_an_agent_alone_meets_all_that_it_meets_in_the_whole(most: int) -> None:
    """Its states, and the messages that wait for it in them; and it has the same faults."""
    found: set[str] = set()
    for made in spoilt():
        whole = Fleet(made, Faults(most))
        wish = Faults(most, boot=True)
        parts = {name: Fleet(among_groups(made, {name}), wish) for name in made.agents}
        for name, part in parts.items():
            assert met(whole, name) <= met(part, name), name
        known = {text for part in parts.values() for text in wrong(part)}
        assert wrong(whole) <= known
        found |= wrong(whole)
    assert len(found) > 3


def test_agents_of_the_companion_meet_alone_what_they_meet_together() -> None:
    """Without faults; ta meets too much alone to be listed here."""
    whole = Fleet(DESIGN, Faults(0))
    for name in ("co", "pl", "hi", "ex", "km"):
        part = Fleet(among_groups(DESIGN, {name}), Faults(0, boot=True))
        assert met(whole, name) <= met(part, name), name


def test_sound_designs_hold_alone_and_each_fault_of_safety_is_found() -> None:
    """A message that no row takes, an act begun twice, a broken rule."""
    assert all(one.holds for one in alone(design(HAND, LAMP), faults=None))
    again = row("busy", "own again", moves="switch")
    lamp = instead(WATCHED, ', when = ["watch settled"]', "")
    for made, what, words in (
        (design(less(HAND, "switch refused"), LAMP), "hand alone", "switch refuse"),
        (design(HAND, (*LAMP, again)), "lamp alone", "begins an act twice"),
        (watching(lamp=lamp, more=RULE), "hand and lamp alone", "idle before it is known"),
    ):
        found = {one.what: [each.text for each in one.findings] for one in alone(made, faults=1)}
        assert any(words in text for text in found[what]), (what, words, found)


def test_what_needs_several_agents_is_not_judged() -> None:
    """Nobody answers: the whole comes to a stop, and no agent alone does anything wrong."""
    made = design(HAND, less(LAMP, "own"))
    assert explore(Fleet(made, Faults(0))).findings
    verdicts = alone(made, faults=0)
    assert [one.what for one in verdicts] == ["hand alone", "lamp alone"]
    assert all(one.holds and "deadlocks" in one.beyond[0] for one in verdicts)


def test_the_companion_is_safe_agent_by_agent() -> None:
    """With a fault; its rule is about four agents."""
    verdicts = [
        task.run(None)
        for task in tasks(DESIGN, layers=(3,), alone=True, faults=1)
        if " and " not in task.what and task.what != "ta alone"
    ]
    assert [one.what for one in verdicts] == [
        f"{name} alone" for name in ("co", "pl", "km", "hi", "ex")
    ]
    assert all(one.holds for one in verdicts), verdicts
