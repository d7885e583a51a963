"""The agents' state machines: every state can be reached and is left whatever holds; protocols have states that act."""

from collections.abc import Iterator

from topdown.model import elements
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind
from topdown.model.loading import Path_


def findings(design: Design) -> Iterator[Finding]:
    """Of every agent's machine."""
    for index, agent in enumerate(design.file.agent):
        at: Path_ = ("agent", index)
        if not agent.state:
            right = "give it states and arcs"
            yield Finding(Kind.NO_MACHINE, f"agent {agent.name}", "has no states", right, at)
            continue
        names = list(_names(agent, at))
        yield from names
        if not names:
            yield from _states(agent, at)
        yield from _talks(design, agent, at)


def _names(agent: elements.Agent, at: Path_) -> Iterator[Finding]:
    """States that the machine names and does not have."""
    states = [state.name for state in agent.state]
    right = f"one of {', '.join(states)}"
    if agent.initial not in states:
        wrong = f"initial state {agent.initial!r} is not there"
        yield Finding(Kind.UNDEFINED, f"agent {agent.name}", wrong, right, (*at, "initial"))
    for number, arc in enumerate(agent.arc):
        for end in (arc.source, arc.target):
            if end not in states:
                wrong = f"state {end!r} is not there"
                yield Finding(Kind.UNDEFINED, f"agent {agent.name}, arc", wrong, right, (*at, "arc", number))
    for name in agent.rest:
        if name not in states:
            wrong = f"state {name!r} is not there"
            yield Finding(Kind.UNDEFINED, f"agent {agent.name}, rest", wrong, right, (*at, "rest"))


def _states(agent: elements.Agent, at: Path_) -> Iterator[Finding]:
    if not agent.arc and len(agent.state) > 1:
        wrong = f"has {len(agent.state)} states and no arcs"
        yield Finding(Kind.NO_MACHINE, f"agent {agent.name}", wrong, "lead arcs between them", at)
        return
    reached = reachable(agent)
    for number, state in enumerate(agent.state):
        where, place = f"agent {agent.name}, state {state.name}", (*at, "state", number)
        if state.name not in reached:
            right = f"lead an arc to it from {', '.join(sorted(reached))}"
            yield Finding(Kind.UNREACHABLE, where, "cannot be reached", right, place)
        labels = [arc.when for arc in agent.arc if arc.source == state.name]
        if "" not in labels:
            right = "end its arcs with one that has no condition"
            yield Finding(Kind.NO_WAY_OUT, where, "may have no way out", right, place)
        elif labels.index("") != len(labels) - 1:
            wrong, right = "has arcs behind one that is always taken", "put the arc without a condition last"
            yield Finding(Kind.DEAD_ARC, where, wrong, right, place)


def _talks(design: Design, agent: elements.Agent, at: Path_) -> Iterator[Finding]:
    """A state talks in protocols of its agent only; every protocol of the agent has a state that does."""
    own = {use.name for use in design.file.protocol if agent.name in (use.initiator, use.participant)}
    talked: set[str] = set()
    for number, state in enumerate(agent.state):
        for name in state.talks:
            if name not in own and name not in talked:
                where, right = f"agent {agent.name}, state {state.name}", f"its protocols are {', '.join(sorted(own))}"
                place = (*at, "state", number)
                yield Finding(Kind.UNDEFINED, where, f"talks in {name!r}, which it has not", right, place)
            talked.add(name)
    for name in sorted(own - talked):
        right = "name it under `talks` of a state"
        yield Finding(Kind.NO_TALK, f"agent {agent.name}", f"no state talks in {name}", right, at)


def reachable(agent: elements.Agent, start: str = "") -> frozenset[str]:
    """States that a chain of arcs leads to from `start` (none: the initial one), that one included."""
    first = start or agent.initial
    found, ahead = {first}, [first]
    while ahead:
        here = ahead.pop()
        for arc in agent.arc:
            if arc.source == here and arc.target not in found:
                found.add(arc.target)
                ahead.append(arc.target)
    return frozenset(found)
