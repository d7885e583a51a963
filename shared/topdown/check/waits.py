"""Cycles of who waits for whom, as far as the state machines alone show them.

Method: closed sets of deaf states. An agent in a state acts only in the protocols under its `talks`. A set of agents,
one state each (none of them a state of rest), may wait for ever if every protocol a member talks in joins it with
another member whose own state does not talk in that protocol, and each member has opened one of its protocols and so
waits for an answer. Such sets are looked for, by backtracking from each agent. Their absence proves that there is no
set of this form, and not that nobody waits for ever: one use more under a member's `talks`, with an agent that hears
it, keeps the set open, though what the member waits for never comes. That, the order of messages, conditions of arcs
and faults are for the exploration of the composed system (topdown.prove).
"""

from collections.abc import Iterator
from typing import NamedTuple

from topdown.model import elements
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind


class Waiting(NamedTuple):
    """An agent in a state: the peers it could hear from, by protocol; `opens`: protocols in which it is initiator."""

    agent: str
    state: str
    peers: dict[str, str]
    opens: frozenset[str]


def findings(design: Design) -> Iterator[Finding]:
    """Each smallest set of agents once, with the states of the first way found."""
    sets: dict[frozenset[str], tuple[Waiting, ...]] = {}
    candidates = {agent.name: tuple(_waitings(design, agent)) for agent in design.file.agent}
    talks = {(agent.name, state.name): set(state.talks) for agent in design.file.agent for state in agent.state}
    for agent in candidates:
        for first in candidates[agent]:
            found = _closed({agent: first}, candidates, talks)
            if found is not None:
                sets.setdefault(frozenset(found), tuple(found.values()))
    for agents, waiting in sets.items():
        if not any(other < agents for other in sets):  # else the smaller set says it all
            yield _finding(design, waiting)


def _waitings(design: Design, agent: elements.Agent) -> Iterator[Waiting]:
    """The states in which the agent does nothing but wait for peers, one of which it has asked."""
    rest = agent.rest or (agent.initial,)
    for state in agent.state:
        uses = [design.protocols[name] for name in state.talks if name in design.protocols]
        peers = {use.name: use.participant if use.initiator == agent.name else use.initiator for use in uses}
        opens = frozenset(use.name for use in uses if use.initiator == agent.name)
        if opens and state.name not in rest:
            yield Waiting(agent.name, state.name, peers, opens)


def _closed(
    chosen: dict[str, Waiting], candidates: dict[str, tuple[Waiting, ...]], talks: dict[tuple[str, str], set[str]]
) -> dict[str, Waiting] | None:
    """Return the chosen ones and those they wait for, all deaf to each other; None: one of them would hear."""
    for waiting in chosen.values():
        for use, peer in waiting.peers.items():
            if peer in chosen and use in talks[peer, chosen[peer].state]:
                return None
    missing = [(u, p) for w in chosen.values() for u, p in w.peers.items() if p not in chosen]
    if not missing:
        return chosen
    use, peer = missing[0]
    for other in candidates.get(peer, ()):
        if use not in talks[peer, other.state]:
            found = _closed({**chosen, peer: other}, candidates, talks)
            if found is not None:
                return found
    return None


def _finding(design: Design, waiting: tuple[Waiting, ...]) -> Finding:
    who = ", ".join(
        f"{one.agent} in {one.state} for {' and '.join(sorted(set(one.peers.values())))}" for one in waiting
    )
    heard = " or ".join(sorted(f"{peer} {use}" for one in waiting for use, peer in one.peers.items()))
    index = next(i for i, agent in enumerate(design.file.agent) if agent.name == waiting[0].agent)
    wrong = f"may wait for each other for ever (closed set of deaf states): {who}"
    right = f"let one of these states talk in what the other waits for: {heard}"
    where = ", ".join(f"agent {one.agent}" for one in waiting)
    return Finding(Kind.WAITS, where, wrong, right, ("agent", index))
