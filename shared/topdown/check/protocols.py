"""The messages of a protocol's use against the table it follows, both ways: what is listed can be
said and taken, and with nothing else than what is listed every conversation reaches its end.

Method: the table of each role keeps only the sends that are listed; both roles are then walked over
two queues (fipa_codec.exploration).
"""

from collections.abc import Iterator

from fipa_codec.exploration import Exploration, explore
from fipa_codec.performatives import Performative
from fipa_codec.tables import Protocol, Role, Table, Way
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.elements import AGENTS
from topdown.model.findings import Finding, Kind
from topdown.model.loading import Path_


def findings(design: Design) -> Iterator[Finding]:
    """Of the design's own tables, then of every use of a protocol."""
    for index, entry in enumerate(design.file.table):
        yield from _own_table(entry.name, design.own_tables[entry.name], ("table", index))
    seen: set[tuple[str, str, str]] = set()
    for index, use in enumerate(design.file.protocol):
        where, at = f"protocol {use.name}", ("protocol", index)
        key = (use.initiator, use.participant, use.follows)
        if key in seen:
            wrong = f"{use.follows} from {use.initiator} to {use.participant} is used already"
            yield Finding(Kind.TWICE, where, wrong, "one use for each", at)
        seen.add(key)
        protocol = design.tables.get(use.follows)
        if protocol is None:
            known = ", ".join(sorted(design.tables)) or "none so far"
            right = f"follow a protocol of FIPA, or a [[table]] of the design; it follows {known}"
            wrong = f"table {use.follows!r} is not there"
            yield Finding(Kind.UNDEFINED, where, wrong, right, (*at, "follows"))
        else:
            yield from _follows(use, protocol, at)
            # a conversation that is not durable lives on asking again
            rows = protocol.tables[Role.INITIATOR]
            opens = [row for row in rows if row.performative in protocol.openings]
            if not use.durable and not any(
                row.way is Way.SEND and row.state == row.to for row in opens
            ):
                wrong = (
                    f"is not durable, and {use.follows} has no row for asking again: one lost"
                    " message ends it"
                )
                right = (
                    "set durable = true, or follow a protocol that asks again (query, subscribe)"
                )
                yield Finding(Kind.NOT_ASKED_AGAIN, where, wrong, right, at)


def _own_table(name: str, protocol: Protocol, at: Path_) -> Iterator[Finding]:
    """Check that each role somewhere takes what the other may send."""
    for role in Role:
        sent = {row.word for row in protocol.tables[role] if row.way is Way.SEND}
        taken = {row.word for row in protocol.tables[role.other] if row.way is Way.RECEIVE}
        for word in sorted(sent - taken):
            right = f"give the {role.other} a row that receives it"
            wrong = f"the {role} sends {word}, which the {role.other} never receives"
            yield Finding(Kind.SENT_NOT_RECEIVED, f"table {name}", wrong, right, (*at, str(role)))
        for word in sorted(taken - sent):
            right = f"give the {role} a row that sends it"
            wrong = f"the {role.other} receives {word}, which the {role} never sends"
            where = f"table {name}"
            yield Finding(Kind.RECEIVED_NOT_SENT, where, wrong, right, (*at, str(role.other)))


def _follows(use: elements.Protocol, protocol: Protocol, at: Path_) -> Iterator[Finding]:
    said = listed(use)
    where = f"protocol {use.name}"
    strange = list(_without_row(use, protocol, at))
    yield from strange
    if not said[Role.INITIATOR] & protocol.openings:
        right = f"list one of {', '.join(sorted(protocol.openings))}"
        yield Finding(Kind.NO_OPENING, where, "no message opens it", right, at)
    elif not strange:
        walked = explore(restricted(protocol, said))
        yield from _never_said(use, said, walked, protocol, at)
        yield from _no_end(where, protocol, said, walked, at)


def listed(use: elements.Protocol) -> dict[Role, set[Performative]]:
    """The acts that a use lists, by role."""
    ends = {Role.INITIATOR: use.initiator, Role.PARTICIPANT: use.participant}
    return {
        role: {m.performative for m in use.message if m.sender == end} for role, end in ends.items()
    }


def restricted(protocol: Protocol, said: dict[Role, set[Performative]]) -> Protocol:
    """The protocol with no other sends than the acts `said`."""

    def kept(role: Role) -> Table:
        table = protocol.tables[role]
        rows = (row for row in table if row.way is Way.RECEIVE or row.performative in said[role])
        return table.only(rows)

    return protocol.with_tables(initiator=kept(Role.INITIATOR), participant=kept(Role.PARTICIPANT))


def _without_row(use: elements.Protocol, protocol: Protocol, at: Path_) -> Iterator[Finding]:
    for number, message in enumerate(use.message):
        if message.sender not in (use.initiator, use.participant):
            continue
        table = protocol.tables[use.role(message.sender)]
        rows = {row.performative for row in table if row.way is Way.SEND}
        if message.performative not in rows:
            where = f"protocol {use.name}, {message.sender}"
            right = f"its rows are {', '.join(sorted(rows))}"
            wrong = f"{use.follows} has no row for {message.performative}"
            place = (*at, "message", number, "performative")
            yield Finding(Kind.NO_ROW, where, wrong, right, place)


def _never_said(
    use: elements.Protocol,
    said: dict[Role, set[Performative]],
    walked: Exploration,
    protocol: Protocol,
    at: Path_,
) -> Iterator[Finding]:
    """Acts that are listed, but that no conversation reaches a state to say."""
    unused = {(role, row[:4]) for role, row in walked.unused}
    for role, end in ((Role.INITIATOR, use.initiator), (Role.PARTICIPANT, use.participant)):
        sends = [row for row in protocol.tables[role] if row.way is Way.SEND]
        possible = {row.performative for row in sends if (role, row[:4]) not in unused}
        for act in sorted(said[role] - possible):
            states = ", ".join(sorted({row.state for row in sends if row.performative == act}))
            wrong = (
                f"{act} is listed, but no conversation reaches a state where it may be said"
                f" ({states})"
            )
            where = f"protocol {use.name}, {end}"
            yield Finding(Kind.NEVER_SAID, where, wrong, "list what leads there, or drop it", at)


def _no_end(
    where: str,
    protocol: Protocol,
    said: dict[Role, set[Performative]],
    walked: Exploration,
    at: Path_,
) -> Iterator[Finding]:
    """A message that nobody takes; else states in which a role must speak and nothing it could say
    is listed.
    """
    if walked.unspecified:
        first = walked.unspecified[0]
        right = "give the table a row that takes it there"
        wrong = f"after {_way(first.steps)}: {first.text}"
        yield Finding(Kind.SENT_NOT_RECEIVED, where, wrong, right, at)
        return  # that the end is out of reach follows
    told: set[tuple[Role, str]] = set()
    for found in walked.stuck:
        for role in Role:
            state = found.configuration.state(role)
            missing = [
                row for row in protocol.tables[role].allowed(state, Way.SEND) if not row.free
            ]
            if any(row.performative in said[role] for row in missing):
                continue
            if missing and found.configuration.inbound(role) == () and (role, state) not in told:
                told.add((role, state))
                acts = ", ".join(sorted({row.word for row in missing}))
                wrong = (
                    f"after {_way(found.steps)}: the {role} is {state} and lists nothing to go on"
                    " with"
                )
                yield Finding(Kind.NO_WAY_TO_THE_END, where, wrong, f"list one of {acts}", at)
    if walked.stuck and not told:
        wrong = walked.stuck[0].text
        yield Finding(Kind.NO_WAY_TO_THE_END, where, wrong, "list what leads on from there", at)


def _way(steps: tuple[object, ...]) -> str:
    return ", ".join(map(str, steps)) or "the start"


# --- Every channel carries a protocol, and the ends of a protocol and of its messages are those of
# its channel


def channel_findings(design: Design) -> Iterator[Finding]:
    """Check channels and other traffic, then the ends of protocols. Channels in doubt are left
    out.
    """
    used = {use.channel for use in design.file.protocol}
    doubtful = design.decomposition.doubtful
    pairs: dict[frozenset[str], str] = {}
    for channel in design.channels.values():
        where, at = f"channel {channel.id}", ("step", channel.born - 1, "channels")
        first = pairs.setdefault(frozenset(channel.ends), channel.id)
        if first != channel.id:
            right = f"one channel for each pair: complement {first}"
            wrong = f"joins two groups that have {first}"
            yield Finding(Kind.SECOND_CHANNEL, where, wrong, right, at)
        elif channel.id not in used and channel.id not in doubtful:
            yield Finding(Kind.SILENT_CHANNEL, where, "carries no protocol", "give it one", at)
    for index, use in enumerate(design.file.protocol):
        yield from _ends(design, index, use)
    yield from _signals(design)


def _ends(design: Design, index: int, use: elements.Protocol) -> Iterator[Finding]:
    where, at = f"protocol {use.name}", ("protocol", index)
    channel = design.channels.get(use.channel)
    if channel is None:
        if not design.decomposition.astray:
            right = f"one of {', '.join(design.channels)}"
            wrong = f"channel {use.channel!r} is not there"
            yield Finding(Kind.UNKNOWN_CHANNEL, where, wrong, right, (*at, "channel"))
        return
    if use.channel not in design.decomposition.doubtful:
        for role, agent in (("initiator", use.initiator), ("participant", use.participant)):
            if agent not in channel.ends:
                wrong = f"{role} {agent!r} is not an end of {use.channel}"
                right = f"they are {' and '.join(channel.ends)}"
                yield Finding(Kind.NO_END, where, wrong, right, (*at, role))
        if use.initiator == use.participant:
            wrong = f"{use.initiator} talks with itself"
            yield Finding(Kind.NO_END, where, wrong, "name both ends", at)
    for number, message in enumerate(use.message):
        if message.sender not in (use.initiator, use.participant, *channel.ends):
            said = f"{where}, {message.sender} {message.performative}"
            place = (*at, "message", number, "sender")
            right = f"{use.initiator} or {use.participant}"
            wrong = f"sender {message.sender!r} is not an end of it"
            yield Finding(Kind.NO_END, said, wrong, right, place)


def _signals(design: Design) -> Iterator[Finding]:
    if AGENTS in design.agents:
        wrong, right = f"{AGENTS!r} stands for every agent in a [[signal]]", "give it another name"
        where = f"agent {AGENTS}"
        yield Finding(Kind.TWICE, where, wrong, right, ("agent", list(design.agents).index(AGENTS)))
    for index, entry in enumerate(design.file.signal):
        signal = design.with_agents(entry)
        if "{system}" not in signal.key or "{owner}" not in signal.key:
            wrong = f"its key {signal.key!r} lacks system or owner"
            right = "name {system} and {owner} in it"
            where = f"signal {signal.kind}"
            yield Finding(Kind.NO_OWNER, where, wrong, right, ("signal", index, "key"))
        for number, pair in enumerate(signal.reach):
            ends = (("writer", signal.writers), ("reader", signal.readers))
            for name, (kind, known) in zip(pair, ends, strict=True):
                if name not in known:
                    wrong = f"reach names {name!r}, which is no {kind} of it"
                    right = f"one of {', '.join(known)}"
                    place = ("signal", index, "reach", number)
                    yield Finding(Kind.UNDEFINED, f"signal {signal.kind}", wrong, right, place)


# --- The form of messages: one form for each act, a budget for each, no act that FIPA says is never
# performed


MACRO = (Performative.INFORM_IF, Performative.INFORM_REF)
"""Macro acts: planned with, never performed (SC00037J); the inform or its like is what is said."""


def form_findings(design: Design) -> Iterator[Finding]:
    """Of every message; a `ruling` on it or its protocol answers for a macro act."""
    for index, use in enumerate(design.file.protocol):
        at: Path_ = ("protocol", index)
        if use.latency_s <= 0:
            right = "say `latency_s`, what an answer should need at most"
            where = f"protocol {use.name}"
            yield Finding(Kind.NO_BUDGET, where, "has no latency budget", right, at)
        for number, message in enumerate(use.message):
            yield from _message(use, message, use.message[:number], (*at, "message", number))


def _message(
    use: elements.Protocol,
    message: elements.Message,
    before: tuple[elements.Message, ...],
    at: Path_,
) -> Iterator[Finding]:
    where = f"protocol {use.name}, {message.sender} {message.performative}"
    act = (message.sender, message.performative)
    same = [one for one in before if (one.sender, one.performative) == act]
    for other in same[:1]:
        if other.language != message.language:
            wrong = f"is written in {other.language} and in {message.language}"
            right = "one language for each act of a protocol"
            yield Finding(Kind.TWO_FORMS, where, wrong, right, at)
        elif bool(other.content) != bool(message.content):
            wrong = "is said with content and without"
            yield Finding(Kind.TWO_FORMS, where, wrong, "one or the other", at)
    if message.performative in MACRO and not (message.ruling or use.ruling) and not same:
        right = "answer with inform, or give the entry a ruling"
        wrong = "FIPA makes it a macro act, which is never performed"
        yield Finding(Kind.MACRO_ACT, where, wrong, right, at)
    if message.bytes <= 0:
        wrong = "has no size budget"
        yield Finding(Kind.NO_BUDGET, where, wrong, "say `bytes`, the largest size", at)


# --- Interfaces and messages agree: every entry can be asked and answered, and what opens a
# conversation is an entry


def interface_findings(design: Design) -> Iterator[Finding]:
    """Of every use of a protocol that offers an interface."""
    for index, use in enumerate(design.file.protocol):
        at: Path_ = ("protocol", index)
        yield from _stars(use, at)
        offered = (design.interfaces[name] for name in use.interface if name in design.interfaces)
        entries = [entry for interface in offered for entry in interface.entries]
        asked, answered = _sayable(design, use)
        for entry in entries:
            yield from _entry(use, entry, asked, answered, at)
        if entries:
            yield from _not_offered(use, entries, asked, at)


def _stars(use: elements.Protocol, at: Path_) -> Iterator[Finding]:
    for number, message in enumerate(use.message):
        for name in message.content:
            if name.startswith("*") and name[1:] not in use.interface:
                where = f"protocol {use.name}, {message.sender} {message.performative}"
                known = f"one of {', '.join(use.interface)}"
                right = known if use.interface else "the protocol names no interface"
                place = (*at, "message", number, "content")
                wrong = f"{name} is not an interface of the protocol"
                yield Finding(Kind.UNDEFINED, where, wrong, right, place)


def _entry(
    use: elements.Protocol,
    entry: elements.InterfaceEntry,
    asked: set[tuple[Performative, str]],
    answered: set[str],
    at: Path_,
) -> Iterator[Finding]:
    where = f"protocol {use.name}, {entry.name}"
    for wanted in entry.arguments or ("",):
        if (entry.performative, wanted) not in asked:
            wrong = f"no message {entry.performative} carries {wanted or 'nothing'}"
            yield Finding(Kind.NOT_ASKED, where, wrong, "list it as content", at)
    for wanted in entry.answers:
        if wanted not in answered:
            wrong = f"no answer of {use.participant} carries {wanted}"
            yield Finding(Kind.NO_ANSWER, where, wrong, "list it as content", at)


def _not_offered(
    use: elements.Protocol,
    entries: list[elements.InterfaceEntry],
    asked: set[tuple[Performative, str]],
    at: Path_,
) -> Iterator[Finding]:
    """Contents of acts that interfaces are about, which no entry takes."""
    acts = {entry.performative for entry in entries}
    taken = {(entry.performative, name) for entry in entries for name in entry.arguments or ("",)}
    for act, name in sorted(pair for pair in asked - taken if pair[0] in acts):
        wrong = f"{act} carries {name or 'nothing'}, which no interface entry takes"
        right = f"declare it in one of {', '.join(use.interface)}"
        yield Finding(Kind.NOT_OFFERED, f"protocol {use.name}, {use.initiator}", wrong, right, at)


def _sayable(
    design: Design, use: elements.Protocol
) -> tuple[set[tuple[Performative, str]], set[str]]:
    """(act, class) the initiator may say ("" where it has no content), classes the participant may
    answer.
    """
    asked: set[tuple[Performative, str]] = set()
    answered: set[str] = set()
    for message in use.message:
        sets = {name[1:] for name in message.content if name.startswith("*")}
        contents = design.contents(use, message) if sets <= design.interfaces.keys() else ()
        if message.sender == use.initiator:
            asked |= {(message.performative, name) for name in contents or ("",)}
        else:
            answered |= set(contents)
    return asked, answered
