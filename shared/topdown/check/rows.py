"""The rows of agents: they can be read, their states follow each other by arcs, and both ends of a message have one.

What rows and protocols do together is left to the exploration (topdown.prove).
"""

from collections.abc import Iterable, Iterator

from fipa_codec.performatives import Performative
from topdown.check.machines import reachable
from topdown.check.sides import ALWAYS, Heard, messages
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.errors import DesignError
from topdown.model.findings import Finding, Kind
from topdown.model.loading import Path_
from topdown.model.machines import Cause, Machine, Row, Said


def findings(design: Design) -> Iterator[Finding]:
    """Of every agent that has rows."""
    compiled: dict[str, Machine] = {}
    for index, agent in enumerate(design.file.agent):
        try:
            compiled[agent.name] = Machine(design, agent.name)
        except DesignError as error:
            yield Finding(Kind.BAD_ROW, error.field, error.wrong, error.right, ("agent", index, "row"))
    heard = tuple(messages(design))
    said = {_act(word) for machine in compiled.values() for row in machine.rows for word in _said(row)}
    spoken = {one.use.name for one in heard if one.sender == one.use.initiator and _of(one) in said}
    for index, agent in enumerate(design.file.agent):
        machine = compiled.get(agent.name)
        if machine is not None and machine.rows:
            yield from _led(agent, machine, index)
            yield from _ends(agent, machine, heard, spoken)
            yield from _unlisted(agent, machine, heard, index)


def _led(agent: elements.Agent, machine: Machine, index: int) -> Iterator[Finding]:
    """A row leads only where arcs lead, perhaps through states that are left at once."""
    told: set[tuple[str, str]] = set()
    for row in machine.rows:
        for state in sorted(row.states):
            pair = (state, row.to)
            if row.to and pair not in told and row.to not in reachable(agent, state):
                told.add(pair)
                where, at = f"agent {agent.name}, row {row.number}", ("agent", index, "row", row.number - 1)
                yield Finding(Kind.BAD_ROW, where, f"no arcs lead from {state} to {row.to}", "give it an arc", at)


def _ends(agent: elements.Agent, machine: Machine, heard: Iterable[Heard], spoken: set[str]) -> Iterator[Finding]:
    """Messages that no row says, or takes. A message's `ruling` answers for it, and the `ruling` of a protocol for all
    of its messages where its initiator says none of them (not `spoken`).
    """
    says = {_act(word) for row in machine.rows for word in _said(row)}
    takes = {_act(word) for row in machine.rows for word in _taken(row)}
    for one in heard:
        if one.message.ruling or (one.use.ruling and one.use.name not in spoken):
            continue
        where = f"protocol {one.use.name}, {one.sender} {one.act}"
        right = "give it a row, or drop the message"
        if one.sender == agent.name and _of(one) not in says:
            yield Finding(Kind.RECEIVED_NOT_SENT, where, f"no row of {agent.name} says it", right, one.at)
        if one.receiver == agent.name and _of(one) not in takes:
            yield Finding(Kind.SENT_NOT_RECEIVED, where, f"no row of {agent.name} takes it", right, one.at)


def _unlisted(agent: elements.Agent, machine: Machine, heard: Iterable[Heard], index: int) -> Iterator[Finding]:
    """Acts that rows say and take, and no message lists; not-understood is never listed."""
    out = {_of(one) for one in heard if one.sender == agent.name}
    into = {_of(one) for one in heard if one.receiver == agent.name}
    told: set[tuple[int, str, Performative]] = set()
    for row in machine.rows:
        at: Path_ = ("agent", index, "row", row.number - 1)
        where = f"agent {agent.name}, row {row.number}"
        for words, known, kind, verb in (
            (_said(row), out, Kind.SENT_NOT_RECEIVED, "says"),
            (_taken(row), into, Kind.RECEIVED_NOT_SENT, "takes"),
        ):
            for word in words:
                key = (row.number, *_act(word))
                if _act(word) not in known and word.act != ALWAYS and key not in told:
                    told.add(key)
                    yield Finding(kind, where, f"{verb} {word.use} {word.act}, which no message lists", "list it", at)


def _said(row: Row) -> list[Said]:
    """Everything a row may say; an observation that is owed is an inform."""
    owed = [Said(use, Performative.INFORM, row.event.kind) for use in row.owes]
    return [*row.say, *row.may, *owed]


def _taken(row: Row) -> list[Said]:
    event = row.event
    return [Said(event.name, event.act, event.kind)] if event.cause is Cause.TAKE and event.act is not None else []


def _act(word: Said) -> tuple[str, Performative]:
    """Use and act, whatever the guard word."""
    return word.use, word.act


def _of(one: Heard) -> tuple[str, Performative]:
    return one.use.name, one.act
