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
        role = Role.INITIATOR if message.sender == use.initiator else Role.PARTICIPANT
        rows = {row.performative for row in protocol.tables[role] if row.way is Way.SEND}
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
