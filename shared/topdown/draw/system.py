"""The system figure (the paper's Figure 10): agents with their control subsystems and buffers,
channels between them.

A group that stays a group (no agent of its name) has a broken outline, and so has an included
system, which is one box. Each end of a channel is a pair of buffers on the border: x receives, y
sends.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator

import msgspec

from topdown.draw.canvas import Box, Canvas, Point, placed, spread, tracks, width_of, wrapped
from topdown.draw.decomposition import channels_grid, in_order, natural
from topdown.draw.document import Figure, Grid, Section, hung, listed
from topdown.model.decomposition import Channel
from topdown.model.design import Design, Rule
from topdown.model.elements import Protocol
from topdown.model.rights import Action, families, identities, rights

INNER = 196.0  # least width of a box [px]
PORT = 15.0
PAIR = 2 * PORT + 12  # room for the two buffers of a channel [px]
LINE = 15.0
_ANY = "SYSTEM"  # stands for the name of a system in keys


class Join(msgspec.Struct, frozen=True):
    """A channel with its label and the side of each end's box it leaves from."""

    channel: Channel
    label: tuple[str, ...]
    sides: tuple[str, str]

    @property
    def width(self) -> float:
        """The width of its label [px]."""
        head, *uses = self.label
        return max(width_of(head, "strong"), *(width_of(use, "small") for use in uses), 0.0) + 8

    @property
    def height(self) -> float:
        """The height of its label [px]."""
        return LINE * len(self.label) + 6

    @property
    def beside(self) -> bool:
        """Between two boxes of one row."""
        return self.sides[0] in ("left", "right")

    @property
    def around(self) -> bool:
        """Outside around the boxes between its ends."""
        return self.sides[0] == self.sides[1]


def system_section(design: Design, width: int) -> Section:
    """The system figure."""
    lead = (
        "The agents, their control subsystems and buffers, and the channels between them with their"
        " protocols."
    )
    note = (
        "x: input buffer T_x, y: output buffer T_y of the control subsystem; a → b: a asks, b"
        " serves."
    )
    caption = f"The system {design.file.system.name}"
    figure = Figure("system", caption, draw(design), _plain(design, width), None, (note,))
    return Section("system", "The system", lead, (figure,))


def labels(design: Design, channel: Channel) -> tuple[str, ...]:
    """The label of a channel: its id, and who asks whom in which protocol."""
    every = (*design.file.protocol, *design.included_uses.values())
    uses = (use for use in every if use.channel == channel.id)
    told = (f"{use.follows}: {use.initiator} → {use.participant}" for use in uses)
    return channel.id, *dict.fromkeys(told)


def boxes(design: Design) -> tuple[str, ...]:
    """The groups of the finished design, and the included systems that agents talk with."""
    outside = dict.fromkeys(use.participant for use in design.included_uses.values())
    return (*design.decomposition.last.groups, *outside)


def joins(design: Design) -> tuple[Channel, ...]:
    """The channels of the finished design, and one to each included system."""
    ends = {(use.channel, use.initiator, use.participant) for use in design.included_uses.values()}
    outside = (Channel(name, (agent, there), (), 0) for name, agent, there in sorted(ends))
    return (*in_order(design.channels.values()), *outside)


def kind_of(design: Design, group: str) -> str:
    """What a box is, in words."""
    if group in design.included:
        return "included system"
    return "agent" if group in design.agents else "group of agents"


def task_of(design: Design, group: str) -> str:
    """The task of a group: from the step that made it, or from the entry of a group that stays one,
    or of an included system.
    """
    texts = {entry.name: entry.text for entry in design.file.group}
    texts |= {entry.name: entry.text for entry in design.file.include}
    return design.decomposition.tasks.get(group, "") or texts.get(group, "")


def _plain(design: Design, width: int) -> str:
    lines: list[str] = []
    for group in boxes(design):
        kind = kind_of(design, group)
        lines += hung("", f"[{group}] {kind}: {task_of(design, group)}".rstrip(": "), width, "  ")
        for channel in (c for c in joins(design) if group in c.ends):
            head, *uses = labels(design, channel)
            words = f"{head} ┄ [{channel.other(group)}]  {'; '.join(uses)}"
            lines += hung("  ", words, width, "     ")
    return "\n".join(lines)


def draw(design: Design) -> Canvas:
    """The figure."""
    return _Drawing(design).canvas


class _Drawing:
    def __init__(self, design: Design) -> None:
        self.design = design
        self.canvas = Canvas(f"Agents and channels of {design.file.system.name}")
        groups = boxes(design)
        channels = (c for c in joins(design) if c.ends[0] != c.ends[1])
        shown = [c for c in channels if all(end in groups for end in c.ends)]
        self.cells = placed(groups, [c.ends for c in shown])
        self.joins = [Join(c, labels(design, c), self._sides(c)) for c in shown]
        room = INNER - 2 * PORT - 24
        self.words = {g: wrapped(task_of(design, g), room, "small") for g in groups}
        found = (width_of(line, "small") for lines in self.words.values() for line in lines)
        widest = max(found, default=0.0)
        ports = (PAIR * self._most(group, ("top", "bottom")) + 20 for group in groups)
        # a word longer than a line is not broken
        self.width = max(INNER, widest + 2 * PORT + 24, *ports)
        beside = max((j.height for j in self.joins if j.beside), default=0.0)
        high = max(self._most(group, ("left", "right")) for group in groups)
        lines = max(len(words) for words in self.words.values())
        self.height = max(118.0 + 14 * lines, (max(beside, PAIR) + 10) * high + 20)
        self.pitch = self.width + max([80.0, *(j.width + 44 for j in self.joins if j.beside)])
        self.lane = max((j.height for j in self.joins if j.around), default=0.0) + 10
        self._place()
        for group in groups:
            self._box(group)
        for join in self.joins:
            self._ports(join)

    def _sides(self, channel: Channel) -> tuple[str, str]:
        (row, column), (other_row, other_column) = (self.cells[end] for end in channel.ends)
        if row != other_row:
            return ("bottom", "top") if row == 0 else ("top", "bottom")
        if abs(column - other_column) == 1:
            return ("right", "left") if column < other_column else ("left", "right")
        return ("top", "top") if row == 0 else ("bottom", "bottom")

    def _at(self, group: str, side: str) -> list[Join]:
        """The channels at one side of a group, from left to right by where they lead."""
        here = [j for j in self.joins if (group, side) in zip(j.channel.ends, j.sides, strict=True)]
        mine = self.cells[group][1]

        def order(join: Join) -> tuple[float, str]:
            other = self.cells[join.channel.other(group)][1] - mine
            # lines around nest: of those to one side, the farther one starts nearer to the middle
            return (1 / other if join.around else float(other)), join.channel.id

        return sorted(here, key=order)

    def _most(self, group: str, sides: tuple[str, ...]) -> int:
        return max(len(self._at(group, side)) for side in sides)

    def _place(self) -> None:
        """Boxes, with the corridor as high as the labels in it need."""
        corridor = 96.0
        while True:
            down, size = self.height + corridor, (self.width, self.height)
            cells = self.cells.items()
            self.boxes = {group: Box(c * self.pitch, r * down, *size) for group, (r, c) in cells}
            spots = self._spots()
            if spots is not None or corridor > 3000:
                break
            corridor += 24
        for join in self.joins:
            self.canvas.line(self._path(join), "channel")
        if spots is not None:
            for join in self.joins:
                self._label(join, spots[join.channel.id])

    def _port(self, join: Join, end: int) -> Point:
        group, side = join.channel.ends[end], join.sides[end]
        here, box = self._at(group, side), self.boxes[group]
        place = here.index(join)
        if side in ("left", "right"):
            y = spread(len(here), box.y, box.bottom)[place]
            return (box.x if side == "left" else box.right), y
        x = spread(len(here), box.x, box.right)[place]
        return x, (box.y if side == "top" else box.bottom)

    def _path(self, join: Join) -> list[Point]:
        one, other = self._port(join, 0), self._port(join, 1)
        if join.beside:  # both boxes may have another number of channels there
            y = (one[1] + other[1]) / 2
            return [(one[0], y), (other[0], y)] if one[1] == other[1] else [one, other]
        if not join.around:
            return [one, other]
        outside = [j for j in self.joins if j.sides == join.sides and j.around]
        spans = [(self._port(j, 0)[0], self._port(j, 1)[0]) for j in outside]
        track = tracks(spans)[outside.index(join)]
        away = 20 + join.height / 2 + self.lane * track
        y = one[1] - away if join.sides[0] == "top" else one[1] + away
        return [one, (one[0], y), (other[0], y), other]

    def _spots(self) -> dict[str, Point] | None:
        """Middles of the labels, each at a place where it meets no box and no other label; None: no
        room.
        """
        taken = list(self.boxes.values())
        found: dict[str, Point] = {}
        for join in sorted(self.joins, key=lambda j: (not j.beside, not j.around)):
            path = self._path(join)
            a, b = (path[1], path[2]) if join.around else (path[0], path[-1])
            for part in (0.5, 0.42, 0.58, 0.34, 0.66, 0.26, 0.74, 0.18, 0.82):
                x, y = a[0] + (b[0] - a[0]) * part, a[1] + (b[1] - a[1]) * part
                spot = Box(x - join.width / 2, y - join.height / 2, join.width, join.height)
                if not any(spot.meets(other, 4) for other in taken):
                    taken.append(spot)
                    found[join.channel.id] = (x, y)
                    break
            else:
                return None
        return found

    def _label(self, join: Join, middle: Point) -> None:
        x, top = middle[0], middle[1] - join.height / 2
        box = Box(x - join.width / 2, top, join.width, join.height)
        self.canvas.box(box, "patch", 3, solid=False)
        self.canvas.words((x, top + 14), join.label[0], "strong marked", "middle")
        self.canvas.column((x, top + 14 + LINE), join.label[1:], LINE, "small", "middle")

    def _box(self, group: str) -> None:
        box = self.boxes[group]
        agent = self.design.agents.get(group)
        self.canvas.box(box, "box" if agent else "group", 8)
        x = box.middle[0]
        self.canvas.words((x, box.y + 40), group, "strong large", "middle")
        kind = kind_of(self.design, group)
        self.canvas.words((x, box.y + 55), kind, "small quiet", "middle")
        self.canvas.column((x, box.y + 72), self.words[group], 14, "small", "middle")
        if agent:
            inner = Box(box.x + 26, box.bottom - 50, box.width - 52, 28)
            self.canvas.box(inner, "inner", 4, solid=False)
            words = f"c_{group}: {len(agent.state)} states" if agent.state else f"c_{group}"
            self.canvas.words((x, inner.y + 18), words, "small", "middle")

    def _ports(self, join: Join) -> None:
        for end, side in enumerate(join.sides):
            x, y = self._port(join, end)
            for number, letter in enumerate("xy"):
                shift = PORT * (number - 1)
                if side in ("left", "right"):
                    corner = (x if side == "left" else x - PORT, y + shift)
                else:
                    corner = (x + shift, y if side == "top" else y - PORT)
                square, text = ("port full", " knock") if number else ("port", "")
                self.canvas.box(Box(*corner, PORT, PORT), square, 2, solid=False)
                middle = (corner[0] + PORT / 2, corner[1] + 11)
                self.canvas.words(middle, letter, f"small strong{text}", "middle")


# --- Tables of the channels: their ends and protocols, buffers at both ends, and each agent's
# interface


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


def channels_section(design: Design) -> Section:
    """Channels, the protocols on them, the budgets of their messages."""
    uses = sorted(design.file.protocol, key=lambda use: (natural(use.channel), use.name))
    service = []
    for use in uses:
        languages = dict.fromkeys(message.language for message in use.message if message.language)
        ends = (use.follows, use.initiator, use.participant)
        service.append((use.channel, use.name, *ends, listed([*languages]), use.ontology or "-"))
    title = "Direction of service, protocols, languages, ontologies"
    head = ("channel", "use", "protocol", "asks", "serves", "languages", "ontology")
    costs = ("channel", "use", "delivery", "largest asked", "largest answered", "answer within")
    grids = (
        channels_grid("Channels", in_order(design.channels.values())),
        Grid(title, head, tuple(service)),
        Grid("Delivery and budgets", costs, tuple(_budget(use) for use in uses)),
    )
    lead = "Who is joined to whom, who asks and who serves, in which words."
    return Section("channels", "Channels", lead, grids)


def _budget(use: Protocol) -> tuple[str, ...]:
    """The costs of one use of a protocol."""
    asked = max((m.bytes for m in use.message if m.sender == use.initiator), default=0)
    answered = max((m.bytes for m in use.message if m.sender == use.participant), default=0)
    delivery = "durable" if use.durable else "newest value" if use.latest else "asked again"
    return use.channel, use.name, delivery, size(asked), size(answered), seconds(use.latency_s)


def buffers(design: Design) -> Section:
    """The four buffers of each channel: T_x (input) and T_y (output) at both ends."""
    rows: list[tuple[str, ...]] = []
    for channel in in_order(design.channels.values()):
        for end in channel.ends:
            peer = channel.other(end)
            into = _acts(r for r in design.rules.values() if (r.sender, r.receiver) == (peer, end))
            out = _acts(r for r in design.rules.values() if (r.sender, r.receiver) == (end, peer))
            rows.append((channel.id, end, f"T_x c_{end}", f"from {peer}", into))
            rows.append((channel.id, end, f"T_y c_{end}", f"to {peer}", out))
    lead = (
        "Each channel is four buffers: an input buffer T_x and an output buffer T_y at both its"
        " ends."
    )
    grid = Grid("Buffers", ("channel", "at", "buffer", "direction", "holds"), tuple(rows))
    return Section("buffers", "Buffers", lead, (grid,))


def _acts(rules: Iterable[Rule]) -> str:
    acts: dict[str, list[str]] = {}
    for rule in rules:
        acts.setdefault(rule.protocol, []).append(rule.performative.value)
    told = (f"{protocol}: {', '.join(sorted(found))}" for protocol, found in acts.items())
    return "; ".join(told) or "-"


def interfaces(design: Design, agent: str | None) -> Section:
    """Each agent's interface: what it sends and receives, what it can be asked and asks."""
    names = design.decomposition.last.groups if agent is None else (design.agent(agent).name,)
    parts = tuple(grid for name in sorted(names) for grid in _interface(design, name))
    lead = "What each agent sends and receives; anything else is answered with not-understood."
    return Section("interfaces", "Interfaces of the agents", lead, parts)


def _interface(design: Design, name: str) -> Iterator[Grid]:
    side = design.side(name)
    sets: tuple[tuple[str, Iterable[str], Iterable[str]], ...] = (
        ("performatives", side.sends, side.receives),
        ("languages", side.languages_sent, side.languages_received),
        ("ontologies", side.ontologies_sent, side.ontologies_received),
    )
    rows = tuple((kind, listed(sorted(out)), listed(sorted(into))) for kind, out, into in sets)
    yield Grid(f"{name}: sets", ("", "sends", "receives"), rows)
    uses = [use for use in design.file.protocol if name in (use.initiator, use.participant)]
    for title, mine in (("answers", True), ("asks", False)):
        entries: list[tuple[str, ...]] = []
        for use in (use for use in uses if (use.participant == name) is mine):
            peer = use.initiator if mine else use.participant
            for entry in design.entries(use.name):
                told = (listed(entry.arguments), " | ".join(entry.answers) or "-")
                entries.append((use.name, peer, entry.performative.value, entry.name, *told))
        if entries:
            who = "of" if mine else "from"
            head = ("use", who, "performative", "name", "arguments", "answer")
            yield Grid(f"{name} {title}", head, tuple(entries), folded=len(entries) > 8)


def rights_section(design: Design, identity: str | None) -> Section:
    """Who may write and who gets each key; of one identity its own keys.

    Raises NoSuchEntry for an identity that the design does not have.
    """
    if identity is not None and identity not in identities(design):
        design.agent(identity)
    ends: dict[str, tuple[list[str], list[str]]] = defaultdict(lambda: ([], []))
    for right in rights(design, _ANY):
        ends[right.key][right.action not in (Action.PUT, Action.TOKEN)].append(right.identity)
    said: dict[tuple[str, ...], list[str]] = defaultdict(list)  # key, writers, readers -> acts
    other: list[tuple[str, ...]] = []
    for family in families(design, _ANY):
        writes, reads = ends[family.key]
        if identity is None or identity in (*writes, *reads):
            key = family.key.partition(f"/{_ANY}/")[2]
            who = (", ".join(writes), ", ".join(reads))
            if family.act:
                above, _, act = key.rpartition("/")
                said[(above, *who)].append(act)
            else:
                other.append((key, *who))
    rows = ((key, ", ".join(sorted(acts)), *who) for (key, *who), acts in sorted(said.items()))
    of = "" if identity is None else f" of {identity}"
    lead = f"Who may write a key and who gets it. The rest is denied. Keys begin with roco/{_ANY}/."
    return Section("rights", f"Rights{of}", lead, (
        Grid("Messages", ("key", "acts", "may write", "gets it"), tuple(rows), folded=True),
        Grid("Other keys", ("key", "may write", "gets it"), tuple(other), folded=True),
    ))  # fmt: skip
