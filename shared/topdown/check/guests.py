"""Guests: what their uses of protocols name is there, and what they may open is bounded."""

from collections.abc import Iterator

from topdown.model import elements
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind
from topdown.model.loading import Path_


def findings(design: Design) -> Iterator[Finding]:
    """Of every guest."""
    taken = {
        **dict.fromkeys(design.agents, "an agent"),
        **dict.fromkeys((group.name for group in design.file.group), "a group"),
        **dict.fromkeys(design.file.system.recorders, "a recorder"),
    }
    channels = dict.fromkeys(design.channels, "the steps")
    names = dict.fromkeys(design.protocols, "a protocol")
    for number, guest in enumerate(design.file.guest):
        where, at = f"guest {guest.name}", ("guest", number)
        if guest.name in taken:
            wrong = f"is the name of {taken[guest.name]}"
            yield Finding(Kind.TWICE, where, wrong, "give the guest another name", (*at, "name"))
        if guest.each_minute <= 0:
            right = "say `each_minute`, the most it may open within a minute"
            yield Finding(Kind.NO_BUDGET, where, "has no budget", right, (*at, "each_minute"))
        with_agents: dict[str, str] = {}  # agent -> channel
        followed: set[tuple[str, str]] = set()
        for place, use in enumerate(guest.use):
            here, own = (*at, "use", place), f"{where} with {use.agent}"
            yield from _use(design, f"{where}, use {use.name}", use, guest.name, here)
            made = design.guest_uses.get(use.name)
            way = (use.agent, made.follows) if made else (use.agent, "")
            if use.name in names:
                wrong = f"use {use.name} is there already, of {names[use.name]}"
                yield Finding(Kind.TWICE, where, wrong, "every name once", (*here, "name"))
            elif channels.get(use.channel, own) != own:
                wrong = f"channel {use.channel} is there already, by {channels[use.channel]}"
                right = "each pair of a guest and an agent has a channel of its own"
                yield Finding(Kind.NUMBER_TAKEN, where, wrong, right, (*here, "channel"))
            elif with_agents.get(use.agent, use.channel) != use.channel:
                wrong = f"talks with {use.agent} on {with_agents[use.agent]} already"
                right = "one channel with each agent"
                yield Finding(Kind.SECOND_CHANNEL, where, wrong, right, (*here, "channel"))
            elif way in followed:
                wrong = f"{way[1]} with {use.agent} is used already"
                yield Finding(Kind.TWICE, where, wrong, "one use for each protocol", here)
            channels[use.channel], names[use.name] = own, where
            with_agents.setdefault(use.agent, use.channel)
            followed.add(way)


def _use(
    design: Design, where: str, use: elements.GuestUse, guest: str, at: Path_
) -> Iterator[Finding]:
    known = (
        ("like", "protocol", use.like, design.protocols),
        ("agent", "agent", use.agent, design.agents),
    )
    for field, kind, name, there in known:
        if name not in there and not (field == "like" and use.follows):
            right = f"one of {', '.join(there)}"
            yield Finding(
                Kind.UNDEFINED, where, f"{kind} {name!r} is not there", right, (*at, field)
            )
    if use.like and (use.follows or use.message):
        wrong = f"is like {use.like}, and has messages of its own"
        yield Finding(Kind.TWO_FORMS, where, wrong, "one or the other", (*at, "like"))
        return
    for number, message in enumerate(use.message):
        if message.sender not in (guest, use.agent):
            wrong = f"sender {message.sender!r} is not an end of it"
            place = (*at, "message", number, "sender")
            yield Finding(Kind.NO_END, where, wrong, f"{guest} or {use.agent}", place)
    model = design.protocols.get(use.like)
    for name in use.interface if model is not None else ():
        if model is not None and name not in model.interface:
            wrong = f"interface {name!r} is not one of {use.like}"
            right = f"one of {', '.join(model.interface)}"
            yield Finding(Kind.UNDEFINED, where, wrong, right, (*at, "interface"))
