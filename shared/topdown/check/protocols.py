"""The messages of a protocol's use against the table it follows, both ways: what is listed can be
said and taken, and with nothing else than what is listed every conversation reaches its end.

Method: the table of each role keeps only the sends that are listed; both roles are then walked over
two queues (fipa_codec.exploration).
"""

import re
from collections.abc import Collection, Iterator

import msgspec

from fipa_codec.communicate import Communicate, encode
from fipa_codec.exploration import Exploration, explore, reached
from fipa_codec.performatives import Performative
from fipa_codec.protocols import PROTOCOLS
from fipa_codec.tables import START, Protocol, Role, Table, Way
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.elements import AGENTS
from topdown.model.findings import Finding, Kind
from topdown.model.loading import Path_
from topdown.model.machines import NONE, WORDS, Cause


def findings(design: Design) -> Iterator[Finding]:
    """Of the design's own tables, then of every use of a protocol."""
    uses = tuple(_of_uses(design))
    yield from uses
    # an act that can never be said is told of its use
    told = {one.at[:2] for one in uses if one.kind is Kind.NEVER_SAID}
    numbered = enumerate(design.file.protocol)
    mute = {use.follows for number, use in numbered if ("protocol", number) in told}
    fipa = {name for one in PROTOCOLS for name in (one.name, *one.aliases)}
    for index, entry in enumerate(design.file.table):
        if entry.name in fipa:
            where, right = f"table {entry.name}", "give it a name of its own"
            wrong = "has the name of a protocol of FIPA"
            yield Finding(Kind.RESERVED, where, wrong, right, ("table", index, "name"))
        yield from _own_table(entry.name, design.own_tables[entry.name], ("table", index))
        yield from _reserved(entry.name, design.own_tables[entry.name], ("table", index))
        if entry.name not in mute:
            yield from _unreached(entry.name, design.own_tables[entry.name], ("table", index))


def _of_uses(design: Design) -> Iterator[Finding]:
    seen: set[tuple[str, str, str]] = set()
    for use, at in design.written:
        where, of_agents = f"protocol {use.name}", use.initiator not in design.guests
        if use.name in EVENTS:
            wrong = f"{use.name!r} is a word of rows and rules"
            right = f"give it a name that is none of {', '.join(sorted(EVENTS))}"
            yield Finding(Kind.RESERVED, where, wrong, right, (*at, "name"))
        if use.durable and use.latest:
            wrong = "is durable, so every message is kept, and latest, so only the newest counts"
            right = "set one of `durable` and `latest` to false"
            yield Finding(Kind.AT_ODDS, where, wrong, right, (*at, "latest"))
        key = (use.initiator, use.participant, use.follows)
        if of_agents and key in seen:
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
            yield from _follows(design, use, protocol, at)
            if of_agents and _is_lost(use, protocol):
                wrong = (
                    f"is not durable, and {use.follows} has no row for asking again: one lost"
                    " message ends it"
                )
                right = (
                    "set durable = true, or follow a protocol that asks again (query, subscribe)"
                )
                yield Finding(Kind.NOT_ASKED_AGAIN, where, wrong, right, at)


def _is_lost(use: elements.Protocol, protocol: Protocol) -> bool:
    """A conversation that is not durable lives on asking again."""
    rows = protocol.tables[Role.INITIATOR]
    opens = [row for row in rows if row.performative in protocol.openings]
    again = any(row.way is Way.SEND and row.state == row.to for row in opens)
    return not use.durable and not again


def _own_table(name: str, protocol: Protocol, at: Path_) -> Iterator[Finding]:
    """Check that each role somewhere takes what the other may send."""
    acts = {row.performative for table in protocol.tables.values() for row in table}
    for field, named in (("confirmed", protocol.confirmed), ("rounds", protocol.rounds)):
        for act in sorted(named - acts):
            wrong, right = f"no row has {act} of `{field}`", "name acts of its rows"
            yield Finding(Kind.UNDEFINED, f"table {name}", wrong, right, (*at, field))
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


def _met(table: Table) -> frozenset[str]:
    """The states that a chain of rows leads to."""
    return frozenset(
        reached([str(START)], lambda here: [row.to for row in table if row.state == here])
    )


def _unreached(name: str, protocol: Protocol, at: Path_) -> Iterator[Finding]:
    """States of a table that no chain of rows leads to from the start."""
    for role, table in protocol.tables.items():
        met = _met(table)
        for state in sorted(set(table.states) - met):
            where = f"table {name}, {role}"
            wrong = f"no rows lead from {START} to state {state!r}"
            right = "lead a row to it, or drop its rows"
            yield Finding(Kind.UNREACHABLE, where, wrong, right, (*at, str(role)))


EVENTS = frozenset((*Cause, "in", "owes")) - {Cause.TAKE}
"""Words that stand where a row or a rule names a use: `late USE`, `AGENT owes USE`."""


def _reserved(name: str, protocol: Protocol, at: Path_) -> Iterator[Finding]:
    """Words of guards are no states, or a guard would mean one of the two."""
    for role, table in protocol.tables.items():
        for word in sorted({NONE, *WORDS} & set(map(str, table.states))):
            wrong = f"state {word!r} of the {role} is a word of guards, which mean that word"
            right = f"give it a name that is none of {', '.join(sorted({NONE, *WORDS}))}"
            yield Finding(Kind.RESERVED, f"table {name}", wrong, right, (*at, str(role)))


def _follows(
    design: Design, use: elements.Protocol, protocol: Protocol, at: Path_
) -> Iterator[Finding]:
    said = listed(use)
    where = f"protocol {use.name}"
    strange = list(_without_row(use, protocol, at))
    if _is_exchanged(use, protocol):
        opens = next(one for one in use.message if one.performative in protocol.openings)
        wrong = (
            f"its ends are exchanged: {opens.sender} says {opens.performative}, which opens"
            f" {use.follows}, and is not its initiator"
        )
        right = f'write initiator = "{use.participant}" and participant = "{use.initiator}"'
        yield Finding(Kind.NO_ROW, where, wrong, right, (*at, "initiator"))
        return
    opened = said[Role.INITIATOR] & protocol.openings
    if strange and not opened and (others := _others(design, use)):
        acts = ", ".join(dict.fromkeys(one.performative for one in use.message))
        wrong = f"{use.follows} has no rows for its messages ({acts}), and {others[0]} has"
        right = f"follow {' or '.join(others)}, or list other messages"
        yield Finding(Kind.NO_ROW, where, wrong, right, (*at, "follows"))
        return
    yield from strange
    if not opened:
        right = f"list one of {', '.join(sorted(protocol.openings))}"
        yield Finding(Kind.NO_OPENING, where, "no message opens it", right, at)
    elif not strange:
        walked = explore(restricted(protocol, said))
        yield from _never_said(use, said, walked, protocol, at)
        yield from _no_end(where, protocol, said, walked, at)


def _others(design: Design, use: elements.Protocol) -> tuple[str, ...]:
    """The protocols that have rows for all messages of a use, and begin with one of them."""
    tables = {**{one.name: one for one in PROTOCOLS}, **design.own_tables}
    opened = listed(use)[Role.INITIATOR]
    return tuple(
        name
        for name, table in tables.items()
        if opened & table.openings and not any(_without_row(use, table, ()))
    )


def _is_exchanged(use: elements.Protocol, protocol: Protocol) -> bool:
    """Whether its messages have rows with its ends the other way round alone."""
    other = msgspec.structs.replace(use, initiator=use.participant, participant=use.initiator)
    return any(_without_row(use, protocol, ())) and not any(_without_row(other, protocol, ()))


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
    yield from _key(design)
    yield from _signals(design)
    yield from _receipts(design)


def _ends(design: Design, index: int, use: elements.Protocol) -> Iterator[Finding]:
    where, at = f"protocol {use.name}", ("protocol", index)
    channel = design.channels.get(use.channel)
    if channel is None:
        if not design.decomposition.astray:
            right = f"one of {', '.join(design.channels)}"
            wrong = f"channel {use.channel!r} is not there{_gone(design, use.channel)}"
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


def _gone(design: Design, channel: str) -> str:
    """What became of a channel that is not there any more."""
    for number, step in enumerate(design.file.step, start=1):
        for split in step.split:
            if split.channel == channel:
                return f" any more: step {number} split it into {' and '.join(split.into)}"
    return ""


KEY_WORDS = ("system", "sender", "receiver", "protocol", "performative")
"""Words without which two communicates have the same key; the channel follows from its ends."""


_WORD_OF_KEY = re.compile(r"\{([^{}]*)\}")


def _strange(key: str, words: Collection[str]) -> str:
    """What a key names that is no word of it."""
    return ", ".join(f"{{{one}}}" for one in _WORD_OF_KEY.findall(key) if one not in words)


def _key(design: Design) -> Iterator[Finding]:
    """The key tells communicates apart, and rights are made of it: who may say what to whom."""
    words = ("channel", *KEY_WORDS)
    if strange := _strange(design.file.system.key, words):
        wrong = f"its key names {strange}, which is no word of a key"
        right = f"its words are {', '.join(f'{{{one}}}' for one in words)}"
        yield Finding(Kind.KEY_LACKS, "system", wrong, right, ("system", "key"))
    missing = [f"{{{word}}}" for word in KEY_WORDS if f"{{{word}}}" not in design.file.system.key]
    if missing:
        wrong = f"its key {design.file.system.key!r} lacks {' and '.join(missing)}"
        right = f"name {' and '.join(missing)} in it: rights to say and to hear are made of the key"
        yield Finding(Kind.KEY_LACKS, "system", wrong, right, ("system", "key"))


SIGNAL_WORDS = ("system", "owner", "peer", "incarnation")
TO_A_PEER = ("receipt", "ping", "pong", "want", "control")
"""Kinds of signals that one owner writes for one peer (agent_runtime.io)."""
RECEIPT, ALIVE = "receipt", "alive"
"""The kinds of signals by which a receiver tells what it has, and by which an agent says that it
runs.
"""


def _receipts(design: Design) -> Iterator[Finding]:
    """Who takes durable messages may write receipts to the sender, who may read them; else all is
    sent again for ever. A design none of whose agents runs yet (no signal ALIVE) needs none.
    """
    kinds = [entry.kind for entry in design.file.signal]
    signal = design.signals.get(RECEIPT)
    durable = [(use.initiator, use.participant) for use in design.file.protocol if use.durable]
    pairs = dict.fromkeys(pair for ends in durable for pair in (ends, ends[::-1]))
    where = f"signal {RECEIPT}"
    if signal is None:
        if ALIVE in kinds and pairs:
            wrong = "is not there, and durable messages are sent again until their receipt comes"
            names = ", ".join(dict.fromkeys(one for one, _ in pairs if one in design.agents))
            right = f"add a [[signal]] of kind {RECEIPT!r} that {names} write and read"
            yield Finding(Kind.NO_RECEIPT, where, wrong, right, ("signal", kinds.index(ALIVE)))
        return
    reach, at = signal.reach, ("signal", kinds.index(RECEIPT))
    for owner in design.agents:
        peers = [peer for one, peer in pairs if one == owner]
        bounded = any(one == owner for one, _ in reach)
        deaf = [peer for peer in peers if bounded and (owner, peer) not in reach]
        deaf = peers if owner not in signal.writers else deaf
        if deaf:
            names = " and ".join(deaf)
            wrong = f"{owner} takes durable messages of {names}, and may write them no receipt"
            right = f"name {owner} among its writers"
            if bounded:
                right = f"name {', '.join(f'[{owner!r}, {peer!r}]' for peer in deaf)} in its reach"
            again = f"; else {names} would send the same again for ever"
            yield Finding(Kind.NO_RECEIPT, where, wrong, f"{right}{again}", at)
        elif peers and owner not in signal.readers:
            wrong = f"{owner} says durable messages, and may read no receipt of them"
            right = f"name {owner} among its readers; else it sends the same again for ever"
            yield Finding(Kind.NO_RECEIPT, where, wrong, right, at)


def _signals(design: Design) -> Iterator[Finding]:
    if AGENTS in design.agents:
        wrong, right = f"{AGENTS!r} stands for every agent in a [[signal]]", "give it another name"
        where = f"agent {AGENTS}"
        yield Finding(Kind.TWICE, where, wrong, right, ("agent", list(design.agents).index(AGENTS)))
    first: dict[str, str] = {}
    for index, entry in enumerate(design.file.signal):
        signal = design.with_agents(entry)
        where = f"signal {signal.kind}"
        place: Path_ = ("signal", index, "key")
        other = first.setdefault(signal.key, signal.kind)
        if other != signal.kind:
            wrong = f"its key {signal.key!r} is that of signal {other}"
            right = "give each kind a key of its own, or nobody can tell them apart"
            yield Finding(Kind.ONE_KEY, where, wrong, right, place)
        if strange := _strange(signal.key, SIGNAL_WORDS):
            wrong = f"its key {signal.key!r} names {strange}, which is no word of a key"
            right = f"its words are {', '.join(f'{{{one}}}' for one in SIGNAL_WORDS)}"
            yield Finding(Kind.NO_OWNER, where, wrong, right, place)
        if signal.kind in TO_A_PEER and "{peer}" not in signal.key:
            wrong = f"its key {signal.key!r} lacks peer: a {signal.kind} is for one peer"
            yield Finding(Kind.NO_OWNER, where, wrong, "name {peer} in it", place)
        if "{system}" not in signal.key or "{owner}" not in signal.key:
            wrong = f"its key {signal.key!r} lacks system or owner"
            right = "name {system} and {owner} in it"
            yield Finding(Kind.NO_OWNER, where, wrong, right, place)
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
    for use, at in design.written:
        below = list(_below_zero(use, at))
        yield from below
        if below:
            continue
        if use.latency_s <= 0 and use.initiator not in design.guests:
            right = "say `latency_s`, what an answer should need at most"
            where = f"protocol {use.name}"
            yield Finding(Kind.NO_BUDGET, where, "has no latency budget", right, at)
        strange = list(_answers(design, use, at))
        yield from strange or _typical(use, at)
        for number, message in enumerate(use.message):
            yield from _message(use, message, use.message[:number], (*at, "message", number))


def _below_zero(use: elements.Protocol, at: Path_) -> Iterator[Finding]:
    """Times, sizes and counts of a use and of its messages; none is below zero."""
    told: list[tuple[str, elements.Entry, Path_]] = [(f"protocol {use.name}", use, at)]
    for number, message in enumerate(use.message):
        where = f"protocol {use.name}, {message.sender} {message.performative}"
        told.append((where, message, (*at, "message", number)))
    for where, entry, place in told:
        for field in entry.__struct_fields__:
            value = getattr(entry, field)
            if isinstance(value, int | float) and value < 0:
                wrong = f"{field} = {value:g} is below zero"
                yield Finding(Kind.BAD_FIGURE, where, wrong, "say 0 or more", (*place, field))


def _answers(design: Design, use: elements.Protocol, at: Path_) -> Iterator[Finding]:
    """Acts under `answer` that the participant can say by the table."""
    if use.follows not in design.tables:
        return
    table = design.tables[use.follows].tables[Role.PARTICIPANT]
    acts = {row.performative for row in table if row.way is Way.SEND}
    for act in use.answer:
        if act not in acts:
            wrong = f"answer {act} is no act of {use.participant} in {use.follows}"
            right = f"its acts are {', '.join(sorted(acts)) or 'none'}"
            yield Finding(Kind.UNDEFINED, f"protocol {use.name}", wrong, right, (*at, "answer"))


def _typical(use: elements.Protocol, at: Path_) -> Iterator[Finding]:
    """What is typical keeps to the budget: of the answer, and of each message."""
    where = f"protocol {use.name}"
    # with `answer` a conversation's end is what answers: see estimate
    field, takes = "typical_latency_s", use.typical_latency_s
    if use.answer and use.typical_s > takes:
        field, takes = "typical_s", use.typical_s
    if 0 < use.latency_s < takes:
        wrong = f"{field} = {takes:g} is above the budget latency_s = {use.latency_s:g}"
        right = "raise the budget, or say what its answer really takes"
        yield Finding(Kind.OVER_BUDGET, where, wrong, right, (*at, field))
    for number, message in enumerate(use.message):
        if 0 < message.bytes < message.typical_bytes:
            said = f"{where}, {message.sender} {message.performative}"
            wrong = f"typical_bytes = {message.typical_bytes} is above the budget {message.bytes}"
            right = "raise `bytes`, or say how large it really is"
            place = (*at, "message", number, "typical_bytes")
            yield Finding(Kind.OVER_BUDGET, said, wrong, right, place)


def smallest(use: elements.Protocol, message: elements.Message) -> int:
    """The size of the smallest communicate that a message can be [bytes]: ids of one character, and
    a content that is as small as any.
    """
    content = msgspec.Raw(b"\xc0") if message.content else msgspec.UNSET
    said = Communicate(
        performative=message.performative,
        content=content,
        language=message.language if message.content else "",
        ontology=use.ontology if message.content else "",
        protocol=use.follows,
        conversation="1",
        sender=message.sender,
        receiver=use.peer(message.sender),
        id="1",
        sent=1.0,
    )
    return len(encode(said))


def _message(
    use: elements.Protocol,
    message: elements.Message,
    before: tuple[elements.Message, ...],
    at: Path_,
) -> Iterator[Finding]:
    where = f"protocol {use.name}, {message.sender} {message.performative}"
    act = (message.sender, message.performative)
    same = [one for one in before if (one.sender, one.performative) == act]
    for other in same:
        if other.language == message.language and (
            other.content == message.content or not {*other.content}.isdisjoint(message.content)
        ):
            wrong = f"stands there twice with {', '.join(message.content) or 'no content'}"
            yield Finding(Kind.TWICE, where, wrong, "drop one of them", at)
            break
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
    elif message.sender in (use.initiator, use.participant):
        least = smallest(use, message)
        if message.bytes < least:
            wrong = f"its budget of {message.bytes} bytes is below the smallest such message"
            right = f"allow at least {least} bytes, and what its content takes"
            yield Finding(Kind.TOO_SMALL, where, wrong, right, (*at, "bytes"))


# --- What conversations are opened within: a use that is there, no circle, nothing that ends sooner


def within_findings(design: Design) -> Iterator[Finding]:
    """`within` of every use, and `each` of its messages."""
    uses = design.protocols
    listed = f"one of {', '.join(uses)}"
    told: set[str] = set()
    exchanged = _all_exchanged(design)
    for index, use in enumerate(design.file.protocol):
        where, at = f"protocol {use.name}", ("protocol", index)
        for number, message in enumerate(use.message):
            if message.each and message.each not in uses:
                wrong = f"use {message.each!r} is not there"
                said = f"{where}, {message.sender} {message.performative}, each"
                yield Finding(Kind.UNDEFINED, said, wrong, listed, (*at, "message", number, "each"))
        if not use.within:
            continue
        place = (*at, "within")
        around = uses.get(use.within)
        if around is None:
            wrong = f"use {use.within!r} is not there"
            yield Finding(Kind.UNDEFINED, f"{where}, within", wrong, listed, place)
            continue
        way = [use.name]
        while (name := uses[way[-1]].within) in uses and name not in way:
            way.append(name)
        if name == use.name:
            if use.name not in told:
                circle = " within ".join((*way, name))
                wrong = f"is opened within itself: {circle}; an estimate would count 0 of them"
                right = "leave `within` out where a person or the start opens it"
                yield Finding(Kind.WITHIN_ITSELF, where, wrong, right, place)
            told.update(way)
        elif use.durable and not around.durable:
            table = design.tables.get(around.follows)
            if table is not None and _is_lost(around, table):
                continue  # that it is not durable is the cause
            wrong = f"is durable, and opened within {around.name}, which one death ends"
            right = (
                f"set durable = true for {around.name} too, or open it within a durable use: what"
                " it does would go on with nobody left who asked for it"
            )
            yield Finding(Kind.OUTLIVES, where, wrong, right, place)
        elif (
            use.initiator not in (around.initiator, around.participant)
            and use.name not in exchanged
        ):
            wrong = (
                f"{use.initiator} opens it within {around.name}, a use of {around.initiator} and"
                f" {around.participant}"
            )
            right = f"name a use that {use.initiator} has a part in, or leave `within` out"
            yield Finding(Kind.NO_PART, where, wrong, right, place)


# --- Interfaces and messages agree: every entry can be asked and answered, and what opens a
# conversation is an entry


def interface_findings(design: Design) -> Iterator[Finding]:
    """Of every interface, then of every use of a protocol that offers one."""
    exchanged = _all_exchanged(design)
    yield from _asked_by_nobody(design, exchanged)
    for use, at in design.written:
        yield from _stars(use, at)
        if use.name in exchanged:
            continue  # who asks and who answers is the fault
        offered = [design.interfaces[name] for name in use.interface if name in design.interfaces]
        entries = [entry for interface in offered for entry in interface.entries]
        asked, answered = _sayable(design, use)
        for entry in entries:
            yield from _entry(use, entry, asked, answered, at)
        if entries:
            yield from _not_offered(use, entries, asked, at)


def _all_exchanged(design: Design) -> frozenset[str]:
    """The uses whose ends are exchanged."""
    tables = design.tables
    known = (use for use in design.file.protocol if use.follows in tables)
    return frozenset(use.name for use in known if _is_exchanged(use, tables[use.follows]))


def _asked_by_nobody(design: Design, exchanged: Collection[str]) -> Iterator[Finding]:
    """Entries that ask by an act that no use with the interface has."""
    for index, interface in enumerate(design.file.interface):
        offered = (use for use in design.file.protocol if interface.name in use.interface)
        uses = [use for use in offered if use.name not in exchanged]
        acts = {act for use in uses for act, _ in _sayable(design, use)[0]}
        for number, entry in enumerate(interface.entries):
            if uses and entry.performative not in acts:
                where = f"interface {interface.name}, {entry.name}"
                names = " and ".join(use.name for use in uses)
                wrong = f"asks by {entry.performative}, and no message of {names} is one"
                right = f"ask by {' or '.join(sorted(acts)) or 'an act that a message has'}"
                at = ("interface", index, "entries", number)
                yield Finding(Kind.NOT_ASKED, where, wrong, right, at)


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
    acts = {act for act, _ in asked}
    for wanted in (entry.arguments or ("",)) if entry.performative in acts else ():
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
