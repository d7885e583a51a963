"""Tables of the channels: their ends and protocols, buffers at both ends, and each agent's interface.

The paper's section 4, steps 3 (channels become buffers and protocols) and 4 (agents' interfaces); the
entries of interfaces have the form of its ClassInterfaceInfo (section 5.6).
"""

from collections.abc import Iterable, Iterator

from topdown.draw.document import Grid, Section, listed
from topdown.draw.steps import natural
from topdown.model.design import Design, Rule
from topdown.model.elements import Protocol


def size(count: int) -> str:
    """Bytes in the unit that people read; 0: no budget."""
    if not count:
        return "-"
    for unit, factor in (("MiB", 1 << 20), ("KiB", 1 << 10), ("MB", 1_000_000), ("kB", 1000)):
        if count % factor == 0:
            return f"{count // factor} {unit}"
    return f"{count} B"


def seconds(value: float) -> str:
    """A time in the unit that people read; 0: no budget."""
    if not value:
        return "-"
    return f"{value:g} s" if value >= 1 else f"{value * 1000:g} ms"


def section(design: Design) -> Section:
    """Channels, the protocols on them, the budgets of their messages."""
    channels = sorted(design.channels.values(), key=lambda channel: natural(channel.id))
    uses = sorted(design.file.protocol, key=lambda use: (natural(use.channel), use.name))
    plain = tuple((c.id, "-".join(c.ends), str(c.born), "; ".join(c.transmits)) for c in channels)
    service = tuple(
        (u.channel, u.name, u.follows, u.initiator, u.participant, listed(_languages(u)), u.ontology or "-")
        for u in uses
    )
    budgets = tuple(_budget(design, use) for use in uses)
    grids = (
        Grid("Channels", ("channel", "between", "since step", "transmits"), plain),
        Grid(
            "Direction of service, protocols, languages, ontologies",
            ("channel", "use", "protocol", "asks", "serves", "languages", "ontology"),
            service,
        ),
        Grid(
            "Delivery and budgets",
            ("channel", "use", "delivery", "largest asked", "largest answered", "answer within"),
            budgets,
        ),
    )
    return Section("channels", "Channels", "Who is joined to whom, who asks and who serves, in which words.", grids)


def _languages(use: Protocol) -> tuple[str, ...]:
    return tuple(dict.fromkeys(message.language for message in use.message if message.language))


def _budget(design: Design, use: Protocol) -> tuple[str, ...]:
    """Return the costs of one use of a protocol."""
    asked = max((m.bytes for m in use.message if m.sender == use.initiator), default=0)
    answered = max((m.bytes for m in use.message if m.sender == use.participant), default=0)
    delivery = "durable" if use.durable else "newest value" if use.latest else "asked again"
    return use.channel, use.name, delivery, size(asked), size(answered), seconds(use.latency_s)


def buffers(design: Design) -> Section:
    """The four buffers of each channel: T_x (input) and T_y (output) at both ends."""
    rows: list[tuple[str, ...]] = []
    for channel in sorted(design.channels.values(), key=lambda c: natural(c.id)):
        for end in channel.ends:
            peer = channel.other(end)
            into = _acts(r for r in design.rules.values() if (r.sender, r.receiver) == (peer, end))
            out = _acts(r for r in design.rules.values() if (r.sender, r.receiver) == (end, peer))
            rows.append((channel.id, end, f"T_x c_{end}", f"from {peer}", into))
            rows.append((channel.id, end, f"T_y c_{end}", f"to {peer}", out))
    lead = "Each channel is four buffers: an input buffer T_x and an output buffer T_y at both its ends."
    grid = Grid("Buffers", ("channel", "at", "buffer", "direction", "holds"), tuple(rows))
    return Section("buffers", "Buffers", lead, (grid,))


def _acts(rules: Iterable[Rule]) -> str:
    acts: dict[str, list[str]] = {}
    for rule in rules:
        acts.setdefault(rule.protocol, []).append(rule.performative.value)
    return "; ".join(f"{protocol}: {', '.join(sorted(found))}" for protocol, found in acts.items()) or "-"


def interfaces(design: Design, agent: str | None) -> Section:
    """Each agent's interface: what it sends and receives, what it can be asked and asks."""
    names = design.decomposition.last.groups if agent is None else (design.agent(agent).name,)
    parts = tuple(grid for name in sorted(names) for grid in _interface(design, name))
    lead = "What each agent sends and receives; anything else is answered with not-understood."
    return Section("interfaces", "Interfaces of the agents", lead, parts)


def _interface(design: Design, name: str) -> Iterator[Grid]:
    side = design.side(name)
    rows = (
        ("performatives", listed(sorted(side.sends)), listed(sorted(side.receives))),
        ("languages", listed(sorted(side.languages_sent)), listed(sorted(side.languages_received))),
        ("ontologies", listed(sorted(side.ontologies_sent)), listed(sorted(side.ontologies_received))),
    )
    yield Grid(f"{name}: sets", ("", "sends", "receives"), rows)
    uses = [use for use in design.file.protocol if name in (use.initiator, use.participant)]
    for title, mine in (("answers", True), ("asks", False)):
        entries = tuple(
            (
                use.name,
                use.initiator if mine else use.participant,
                entry.performative.value,
                entry.name,
                listed(entry.arguments),
                " | ".join(entry.answers) or "-",
            )
            for use in uses
            if (use.participant == name) is mine
            for entry in design.entries(use.name)
        )
        peer = "of" if mine else "from"
        if entries:
            head = ("use", peer, "performative", "name", "arguments", "answer")
            yield Grid(f"{name} {title}", head, entries, folded=len(entries) > 8)
