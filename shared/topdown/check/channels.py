"""Every channel carries a protocol, and the ends of a protocol and of its messages are those of its channel."""

from collections.abc import Iterator

from topdown.model import elements
from topdown.model.design import Design
from topdown.model.elements import AGENTS
from topdown.model.findings import Finding, Kind


def findings(design: Design) -> Iterator[Finding]:
    """Check channels and other traffic, then the ends of protocols. Channels in doubt are left out."""
    used = {use.channel for use in design.file.protocol}
    doubtful = design.decomposition.doubtful
    pairs: dict[frozenset[str], str] = {}
    for channel in design.channels.values():
        where, at = f"channel {channel.id}", ("step", channel.born - 1, "channels")
        first = pairs.setdefault(frozenset(channel.ends), channel.id)
        if first != channel.id:
            right = f"one channel for each pair: complement {first}"
            yield Finding(Kind.SECOND_CHANNEL, where, f"joins two groups that have {first}", right, at)
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
            yield Finding(Kind.UNKNOWN_CHANNEL, where, f"channel {use.channel!r} is not there", right, (*at, "channel"))
        return
    if use.channel not in design.decomposition.doubtful:
        for role, agent in (("initiator", use.initiator), ("participant", use.participant)):
            if agent not in channel.ends:
                wrong = f"{role} {agent!r} is not an end of {use.channel}"
                right = f"they are {' and '.join(channel.ends)}"
                yield Finding(Kind.NO_END, where, wrong, right, (*at, role))
        if use.initiator == use.participant:
            yield Finding(Kind.NO_END, where, f"{use.initiator} talks with itself", "name both ends", at)
    for number, message in enumerate(use.message):
        if message.sender not in (use.initiator, use.participant, *channel.ends):
            said, place = f"{where}, {message.sender} {message.performative}", (*at, "message", number, "sender")
            right = f"{use.initiator} or {use.participant}"
            yield Finding(Kind.NO_END, said, f"sender {message.sender!r} is not an end of it", right, place)


def _signals(design: Design) -> Iterator[Finding]:
    if AGENTS in design.agents:
        wrong, right = f"{AGENTS!r} stands for every agent in a [[signal]]", "give it another name"
        yield Finding(Kind.TWICE, f"agent {AGENTS}", wrong, right, ("agent", list(design.agents).index(AGENTS)))
    for index, entry in enumerate(design.file.signal):
        signal = design.with_agents(entry)
        if "{system}" not in signal.key or "{owner}" not in signal.key:
            wrong = f"its key {signal.key!r} lacks system or owner"
            right = "name {system} and {owner} in it"
            yield Finding(Kind.NO_OWNER, f"signal {signal.kind}", wrong, right, ("signal", index, "key"))
        for number, pair in enumerate(signal.reach):
            for name, kind, known in zip(pair, ("writer", "reader"), (signal.writers, signal.readers), strict=True):
                if name not in known:
                    wrong, right = f"reach names {name!r}, which is no {kind} of it", f"one of {', '.join(known)}"
                    yield Finding(
                        Kind.UNDEFINED, f"signal {signal.kind}", wrong, right, ("signal", index, "reach", number)
                    )
