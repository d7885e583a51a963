"""The agents' state machines: every state can be reached and is left whatever holds; protocols have
states that act.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import msgspec

from fipa_codec.exploration import reached
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.errors import DesignError, ParameterError
from topdown.model.findings import Finding, Kind
from topdown.model.loading import Path_
from topdown.model.machines import Cause, Machine, ProtocolAct, Row, Use
from topdown.model.parameters import COUNTABLE, Parameters


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
                where = f"agent {agent.name}, arc"
                yield Finding(Kind.UNDEFINED, where, wrong, right, (*at, "arc", number))
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
        if state.error == state.terminal:
            wrong = f"its error condition {state.error!r} is its terminal condition, too"
            right = "name another condition, or leave `error` out"
            yield Finding(Kind.AT_ODDS, where, wrong, right, (*place, "error"))
        if state.name not in reached:
            right = f"lead an arc to it from {', '.join(sorted(reached))}"
            yield Finding(Kind.UNREACHABLE, where, "cannot be reached", right, place)
        labels = [arc.when for arc in agent.arc if arc.source == state.name]
        if "" not in labels:
            right = "end its arcs with one that has no condition"
            yield Finding(Kind.NO_WAY_OUT, where, "may have no way out", right, place)
        elif labels.index("") != len(labels) - 1:
            wrong = "has arcs behind one that is always taken"
            right = "put the arc without a condition last"
            yield Finding(Kind.DEAD_ARC, where, wrong, right, place)
    taken: dict[tuple[str, str], int] = {}
    for number, arc in enumerate(agent.arc):
        first = taken.setdefault((arc.source, arc.when), number)
        if arc.when and first != number:
            where = f"agent {agent.name}, arc from {arc.source} to {arc.target}"
            wrong = (
                f"has the condition {arc.when!r} of the arc to {agent.arc[first].target} before it"
            )
            right = "drop it, or give it a condition of its own: the first that holds is taken"
            yield Finding(Kind.DEAD_ARC, where, wrong, right, (*at, "arc", number))


def _talks(design: Design, agent: elements.Agent, at: Path_) -> Iterator[Finding]:
    """A state talks in protocols of its agent only; every protocol of the agent has a state that
    does.
    """
    ends = {use.name: (use.initiator, use.participant) for use in design.file.protocol}
    own = {name for name, pair in ends.items() if agent.name in pair}
    outside = {use.name for use in design.included_uses.values() if use.initiator == agent.name}
    talked: set[str] = set()
    for number, state in enumerate(agent.state):
        for name in state.talks:
            if name not in own | outside and name not in talked:
                where = f"agent {agent.name}, state {state.name}"
                right = f"its protocols are {', '.join(sorted(own | outside))}"
                place = (*at, "state", number)
                wrong = f"talks in {name!r}, which it has not"
                yield Finding(Kind.UNDEFINED, where, wrong, right, place)
            talked.add(name)
    for name in sorted(own - talked):
        right = "name it under `talks` of a state"
        yield Finding(Kind.NO_TALK, f"agent {agent.name}", f"no state talks in {name}", right, at)


def reachable(agent: elements.Agent, start: str = "") -> frozenset[str]:
    """States that a chain of arcs leads to from `start` (none: the initial one), that one
    included.
    """
    found = reached(
        [start or agent.initial],
        lambda here: (arc.target for arc in agent.arc if arc.source == here),
    )
    return frozenset(found)


# --- The two ends of each message: what one agent says the other takes, per performative, protocol,
# language, ontology Compared are the messages of the protocols and the interfaces that agents
# declare (paper, section 4, step 4); the checks of rows, below, compare the messages with what
# agents do.


ALWAYS = Performative.NOT_UNDERSTOOD
"""Goes both ways in every protocol and is not listed (SC00037J)."""


class Heard(NamedTuple):
    """A message with both of its ends."""

    use: elements.Protocol
    sender: str
    receiver: str
    message: elements.Message
    at: Path_

    @property
    def act(self) -> Performative:
        """The kind of its act in words."""
        return self.message.performative

    def words(self, design: Design) -> dict[str, str]:
        """The words of a declared interface, by the field of elements.Ends; undefined ones are left
        out.
        """
        use, found = self.use, {"performatives": str(self.act), "protocols": self.use.follows}
        if self.message.language in {entry.name for entry in design.file.language}:
            found["languages"] = self.message.language
        if use.ontology in {entry.name for entry in design.file.ontology}:
            found["ontologies"] = use.ontology
        return found


def messages(design: Design) -> Iterator[Heard]:
    """Every message that has two ends, of included uses as well."""
    for index, use in enumerate(design.file.protocol):
        for number, message in enumerate(use.message):
            if message.sender in (use.initiator, use.participant):
                at: Path_ = ("protocol", index, "message", number)
                yield Heard(use, message.sender, use.peer(message.sender), message, at)
    for use in design.included_uses.values():
        at = ("include", [entry.name for entry in design.file.include].index(use.participant))
        for message in use.message:
            yield Heard(use, message.sender, use.peer(message.sender), message, at)


def side_findings(design: Design) -> Iterator[Finding]:
    """Of declared interfaces, where there are any."""
    heard = tuple(messages(design))
    for index, agent in enumerate(design.file.agent):
        at: Path_ = ("agent", index)
        if agent.sends is not None:
            mine = [one for one in heard if one.sender == agent.name]
            yield from _declared(design, agent.name, "sends", agent.sends, mine, (*at, "sends"))
        if agent.receives is not None:
            mine = [one for one in heard if one.receiver == agent.name]
            yield from _declared(
                design, agent.name, "receives", agent.receives, mine, (*at, "receives")
            )


def _declared(
    design: Design, agent: str, way: str, ends: elements.Ends, mine: list[Heard], at: Path_
) -> Iterator[Finding]:
    """Words of the declared interface without a message, and messages without their words."""
    lacking = Kind.RECEIVED_NOT_SENT if way == "sends" else Kind.SENT_NOT_RECEIVED
    idle = Kind.SENT_NOT_RECEIVED if way == "sends" else Kind.RECEIVED_NOT_SENT
    for field in elements.Ends.__struct_fields__:
        declared = [str(word) for word in getattr(ends, field)]
        used = {words[field]: one for one in mine if field in (words := one.words(design))}
        for word in sorted(used.keys() - set(declared)):
            one = used[word]
            where = f"protocol {one.use.name}, {one.sender} {one.act}"
            wrong = f"{agent} does not declare that it {way} {word}"
            right = f"its {way}.{field} are {', '.join(declared) or 'none'}"
            yield Finding(lacking, where, wrong, right, one.at)
        for word in declared:
            if word not in used and word != ALWAYS:
                right = f"they have {', '.join(sorted(used)) or 'none'}"
                wrong = f"declares that it {way} {word}, and no message does"
                yield Finding(idle, f"agent {agent}, {field}", wrong, right, at)


# --- The rows of agents: they can be read, their states follow each other by arcs, and both ends of
# a message have one
# What rows and protocols do together is left to the exploration (topdown.prove).


def row_findings(design: Design) -> Iterator[Finding]:
    """Of every agent that has rows."""
    compiled: dict[str, Machine] = {}
    for agent in design.file.agent:
        try:
            compiled[agent.name] = Machine(design, agent.name)
        except DesignError as error:
            yield Finding(Kind.BAD_ROW, error.field, error.wrong, error.right, error.at)
    heard = tuple(messages(design))
    rows = (row for machine in compiled.values() for row in machine.rows)
    said = {_act(word) for row in rows for word in _acts_of(row)}
    spoken = {one.use.name for one in heard if one.sender == one.use.initiator and _of(one) in said}
    for index, agent in enumerate(design.file.agent):
        machine = compiled.get(agent.name)
        if machine is not None and machine.rows:
            yield from _once_more(agent, index)
            yield from _untalked(agent, machine, index)
            yield from _led(agent, machine, index)
            yield from _ends(agent, machine, heard, spoken)
            yield from _unlisted(agent, machine, heard, index)


def _once_more(agent: elements.Agent, index: int) -> Iterator[Finding]:
    """A row that does the same as one before it, at the same event in one of the same states."""
    seen: dict[tuple[str, elements.Row], int] = {}
    for number, row in enumerate(agent.row, start=1):
        plain = msgspec.structs.replace(row, in_=(), text="", ruling="")
        for state in row.in_:
            first = seen.setdefault((state, plain), number)
            if first != number:
                where, at = f"agent {agent.name}, row {number}", ("agent", index, "row", number - 1)
                wrong = f"is row {first} once more, in {state}"
                yield Finding(Kind.TWICE, where, wrong, "drop one of them", at)
                break


def _untalked(agent: elements.Agent, machine: Machine, index: int) -> Iterator[Finding]:
    """A row that acts in a use stands in a state that talks in it; what it says the next state may
    say, too, or one that is left at once.
    """
    talks = {state.name: {*state.talks} for state in agent.state}
    passed = {use for state, uses in talks.items() if state not in machine.waits for use in uses}
    for row in machine.rows if any(talks.values()) else ():
        own = {use for state in row.states for use in talks[state]}
        spoken = {word.use for word in _acts_of(row)}
        taken = {word.use for word in _taken(row)} if spoken or row.to else set()
        for use in sorted((taken | (spoken - passed - talks.get(row.to, set()))) - own):
            where, at = f"agent {agent.name}, row {row.number}", ("agent", index)
            verb, states = "takes" if use in taken else "says", " and ".join(sorted(row.states))
            wrong = f"{verb} words of {use} in {states}, where no state talks in {use}"
            right = f"add {use} to `talks` of {states}"
            yield Finding(Kind.BAD_ROW, where, wrong, right, (*at, "row", row.number - 1))


def _led(agent: elements.Agent, machine: Machine, index: int) -> Iterator[Finding]:
    """A row leads only where arcs lead, perhaps through states that are left at once."""
    told: set[tuple[str, str]] = set()
    for row in machine.rows:
        for state in sorted(row.states):
            pair = (state, row.to)
            if row.to and pair not in told and row.to not in reachable(agent, state):
                told.add(pair)
                where = f"agent {agent.name}, row {row.number}"
                at = ("agent", index, "row", row.number - 1)
                wrong = f"no arcs lead from {state} to {row.to}"
                yield Finding(Kind.BAD_ROW, where, wrong, "give it an arc", at)


def _ends(
    agent: elements.Agent, machine: Machine, heard: Iterable[Heard], spoken: set[str]
) -> Iterator[Finding]:
    """Messages that no row says, or takes. A message's `ruling` answers for it, and the `ruling` of
    a protocol for all of its messages where its initiator says none of them (not `spoken`). A guest
    of an included system need not say all that it may.
    """
    says = {_act(word) for row in machine.rows for word in _acts_of(row)}
    takes = {_act(word) for row in machine.rows for word in _taken(row)}
    for one in heard:
        if one.message.ruling or (one.use.ruling and one.use.name not in spoken):
            continue
        where = f"protocol {one.use.name}, {one.sender} {one.act}"
        right = "give it a row, or drop the message"
        own = one.at[0] == "protocol"
        vain = _in_vain(machine, one) if one.sender == agent.name else ""
        if one.sender == agent.name and _of(one) not in says and (own or vain):
            wrong = f"no row of {agent.name} says `{one.use.name} {one.act}`{vain}"
            yield Finding(Kind.RECEIVED_NOT_SENT, where, wrong, right, one.at)
        if one.receiver == agent.name and _of(one) not in takes:
            wrong = f"no row of {agent.name} takes `{one.use.name} {one.act}`"
            yield Finding(Kind.SENT_NOT_RECEIVED, where, wrong, right, one.at)


def _in_vain(machine: Machine, one: Heard) -> str:
    """Who waits for the words of a conversation that this message alone would open."""
    use = machine.uses[one.use.name]
    if use.role is not Role.INITIATOR or one.act not in use.protocol.openings:
        return ""
    states = sorted({state for row in machine.rows for state in row.states if _about(row, use)})
    return f", and {machine.agent} in {' or '.join(states)} waits for its words" if states else ""


def _about(row: Row, use: Use) -> bool:
    return row.event.cause in (Cause.TAKE, Cause.LATE) and row.event.name == use.name


def _unlisted(
    agent: elements.Agent, machine: Machine, heard: Iterable[Heard], index: int
) -> Iterator[Finding]:
    """Acts that rows say and take, and no message lists; not-understood is never listed."""
    out = {_of(one) for one in heard if one.sender == agent.name}
    into = {_of(one) for one in heard if one.receiver == agent.name}
    told: set[tuple[int, str, Performative]] = set()
    for row in machine.rows:
        at: Path_ = ("agent", index, "row", row.number - 1)
        where = f"agent {agent.name}, row {row.number}"
        for words, known, other, verb in (
            (_acts_of(row), out, into, "says"),
            (_taken(row), into, out, "takes"),
        ):
            for word in words:
                key = (row.number, *_act(word))
                if _act(word) in known or word.act == ALWAYS or key in told:
                    continue
                told.add(key)
                wrong, right = f"{verb} {word.use} {word.act}, which no message lists", "list it"
                if _act(word) in other:
                    whose = agent.name if verb == "takes" else machine.uses[word.use].peer
                    wrong = f"{verb} {word.use} {word.act}, which is for {whose} to say"
                    right = "name an act of the other end"
                yield Finding(Kind.BAD_ROW, where, wrong, right, at)


def _acts_of(row: Row) -> list[ProtocolAct]:
    """Everything a row may say; an observation that is owed is an inform."""
    owed = [ProtocolAct(use, Performative.INFORM, row.event.kind) for use in row.owes]
    return [*row.say, *row.may, *owed]


def _taken(row: Row) -> list[ProtocolAct]:
    event = row.event
    if event.cause is not Cause.TAKE or event.act is None:
        return []
    return [ProtocolAct(event.name, event.act, event.kind)]


def _act(word: ProtocolAct) -> tuple[str, Performative]:
    """Use and act, whatever the guard word."""
    return word.use, word.act


def _of(one: Heard) -> tuple[str, Performative]:
    return one.use.name, one.act


# --- Whether the parameters of agents can be: defaults and choices that fit, bounds that make
# sense, a key to set them


SIGNAL = "control"
"""The kind of signal by which parameters are set."""


def parameter_findings(design: Design) -> Iterator[Finding]:
    """Parameters that nobody could set, or that no value fits."""
    signals = (signal for signal in design.signals.values() if signal.kind == SIGNAL)
    readers = {name for signal in signals for name in signal.readers}
    for index, agent in enumerate(design.file.agent):
        if agent.parameter and agent.name not in readers:
            wrong = (
                f"has parameters, but reads no [[signal]] of kind {SIGNAL!r}, so nobody can set"
                " them"
            )
            right = "name it among the readers"
            yield Finding(Kind.PARAMETER, f"agent {agent.name}", wrong, right, ("agent", index))
        for number, entry in enumerate(agent.parameter):
            yield from _parameter(agent, entry, ("agent", index, "parameter", number))


def _parameter(agent: elements.Agent, entry: elements.Parameter, at: Path_) -> Iterator[Finding]:
    where = f"agent {agent.name}, parameter {entry.name}"
    least, most = entry.least, entry.most
    if (least is not None or most is not None) and entry.type not in COUNTABLE:
        wrong = f"a {entry.type.value} has bounds"
        yield Finding(Kind.PARAMETER, where, wrong, "leave least and most out", at)
        return
    if least is not None and most is not None and least > most:
        wrong = f"least {least:g} is above most {most:g}"
        yield Finding(Kind.PARAMETER, where, wrong, "exchange them", at)
        return
    for field, values in (("default", (entry.default,)), ("choices", entry.choices)):
        for value in values:
            try:
                Parameters(agent).fitted(entry.name, value)
            except ParameterError as error:
                right = f"it must be {error.right}"
                yield Finding(Kind.PARAMETER, where, f"{field} is {value!r}", right, (*at, field))
                return


# --- Cycles of who waits for whom, as far as the state machines alone show them -------------------
# Method: closed sets of deaf states. An agent in a state acts only in the protocols under its
# `talks`. A set of agents, one state each (none of them a state of rest), may wait for ever if
# every protocol a member talks in joins it with another member whose own state does not talk in
# that protocol, and each member has opened one of its protocols and so waits for an answer. Such
# sets are looked for, by backtracking from each agent. Their absence proves that there is no set of
# this form, and not that nobody waits for ever: one use more under a member's `talks`, with an
# agent that hears it, keeps the set open, though what the member waits for never comes. That, the
# order of messages, conditions of arcs and faults are for the exploration of the composed system
# (topdown.prove).


class Waiting(NamedTuple):
    """An agent in a state: the peers it could hear from, by protocol; `opens`: protocols in which
    it is initiator.
    """

    agent: str
    state: str
    peers: dict[str, str]
    opens: frozenset[str]


def wait_findings(design: Design) -> Iterator[Finding]:
    """Each smallest set of agents once, with the states of the first way found."""
    sets: dict[frozenset[str], tuple[Waiting, ...]] = {}
    candidates = {agent.name: tuple(_waitings(design, agent)) for agent in design.file.agent}
    states = ((agent.name, state) for agent in design.file.agent for state in agent.state)
    talks = {(name, state.name): set(state.talks) for name, state in states}
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
        if not design.included_uses.keys().isdisjoint(state.talks):
            continue  # the wait for an included system is over in time
        uses = [design.protocols[name] for name in state.talks if name in design.protocols]
        opens = frozenset(use.name for use in uses if use.initiator == agent.name)
        peers = {use.name: use.peer(agent.name) for use in uses}
        if opens and state.name not in rest:
            yield Waiting(agent.name, state.name, peers, opens)


def _closed(
    chosen: dict[str, Waiting],
    candidates: dict[str, tuple[Waiting, ...]],
    talks: dict[tuple[str, str], set[str]],
) -> dict[str, Waiting] | None:
    """The chosen ones and those they wait for, all deaf to each other; None: one of them would
    hear.
    """
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
    peers = [" and ".join(sorted(set(one.peers.values()))) for one in waiting]
    each = zip(waiting, peers, strict=True)
    who = ", ".join(f"{one.agent} in {one.state} for {names}" for one, names in each)
    asked = (f"{peer} {use}" for one in waiting for use, peer in one.peers.items())
    heard = " or ".join(sorted(asked))
    index = next(i for i, agent in enumerate(design.file.agent) if agent.name == waiting[0].agent)
    wrong = f"may wait for each other for ever (closed set of deaf states): {who}"
    right = f"let one of these states talk in what the other waits for: {heard}"
    where = ", ".join(f"agent {one.agent}" for one in waiting)
    return Finding(Kind.WAITS, where, wrong, right, ("agent", index))
