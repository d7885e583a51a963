"""The decomposition tree with its channels after any step (the paper's Figure 6, and the pictures of Tables 1 and 2).

Groups that are divided stand above, darker; the fringe (the groups of that step) is one row below, and the channels
run under it, each in a track of its own.
"""

from collections.abc import Mapping
from itertools import product

import msgspec

from topdown.draw.canvas import Box, Canvas, width_of, wrapped
from topdown.draw.layout import spread, tracks
from topdown.draw.text import hung
from topdown.model.decomposition import Channel, Stage
from topdown.model.design import Design

LEVEL, GAP, TRACK = 66.0, 26.0, 30.0
FLIPPED = 10  # with more divisions than this, halves keep the order of the file


class Node(msgspec.Struct, frozen=True):
    """A group, the step that divides it (0: none so far) and its halves."""

    name: str
    step: int
    halves: tuple["Node", ...]

    @property
    def fringe(self) -> tuple["Node", ...]:
        """The undivided groups in it, from left to right."""
        return tuple(leaf for half in self.halves for leaf in half.fringe) or (self,)

    @property
    def depth(self) -> int:
        """Return the number of levels below."""
        return 1 + max(half.depth for half in self.halves) if self.halves else 0


def grown(design: Design, step: int) -> Node:
    """The tree after a step; halves are turned so that the channels of the finished design are short, at each step
    alike.
    """
    names = tuple(dict.fromkeys(entry.divide.group for entry in design.file.step if entry.divide))
    turns = list(product((False, True), repeat=len(names))) if len(names) <= FLIPPED else [(False,) * len(names)]
    last, channels = len(design.file.step), design.decomposition.last.channels
    best = min(turns, key=lambda turn: _length(as_filed(design, last, names, turn), channels))
    return as_filed(design, step, names, best)


def as_filed(design: Design, step: int, names: tuple[str, ...] = (), turn: tuple[bool, ...] = ()) -> Node:
    """The tree after a step, halves in the order of the file; or the other way round in the groups that are turned."""
    divided: dict[str, tuple[int, tuple[str, str]]] = {}
    for number, entry in enumerate(design.file.step[:step], start=1):
        if entry.divide:
            divided.setdefault(entry.divide.group, (number, entry.divide.into))
    return _node(design.file.system.root, divided, dict(zip(names, turn, strict=True)), ())


def _node(
    name: str, divided: Mapping[str, tuple[int, tuple[str, str]]], turned: Mapping[str, bool], above: tuple[str, ...]
) -> Node:
    if name not in divided or name in above:
        return Node(name, 0, ())
    number, halves = divided[name]
    order = reversed(halves) if turned.get(name) else halves
    return Node(name, number, tuple(_node(half, divided, turned, (*above, name)) for half in order))


def _length(tree: Node, channels: tuple[Channel, ...]) -> int:
    place = {node.name: index for index, node in enumerate(tree.fringe)}
    ends = (channel.ends for channel in channels)
    return sum(abs(place[a] - place[b]) ** 2 for a, b in ends if a in place and b in place)


def plain(design: Design, step: int, width: int) -> str:
    """The tree and the channels as text."""
    stage = design.decomposition.stages[step]
    tasks = design.decomposition.tasks
    lines: list[str] = []

    def write(node: Node, before: str, corner: str, below: str) -> None:
        channels = ", ".join(channel.id for channel in stage.channels if node.name in channel.ends)
        note = f"divided in step {node.step}" if node.step else tasks.get(node.name, "")
        mark = f"  [{channels}]" if channels else ""
        under = below + ("│  " if node.halves else "   ")
        lines.extend(hung(before + corner, f"{node.name}{mark}  {note}".rstrip(), width, before + under))
        for number, half in enumerate(node.halves):
            last = number == len(node.halves) - 1
            write(half, before + below, "└─ " if last else "├─ ", "   " if last else "│  ")

    write(as_filed(design, step), "", "", "")
    for channel in stage.channels:
        new = "  new" if channel.born == step else ""
        lines.append(f"{channel.id}: {channel.ends[0]} ┄┄ {channel.ends[1]}{new}")
    return "\n".join(lines)


def draw(design: Design, step: int) -> Canvas:
    """The tree after a step as a drawing."""
    return _Drawing(design, step).canvas


class _Drawing:
    def __init__(self, design: Design, step: int) -> None:
        name = design.file.system.name
        self.canvas = Canvas(f"{name}: groups and channels after step {step}")
        self.stage: Stage = design.decomposition.stages[step]
        self.step, self.tasks = step, design.decomposition.tasks
        self.before: Stage = design.decomposition.stages[max(0, step - 1)]
        tree = grown(design, step)
        self.words = {leaf.name: wrapped(self.tasks.get(leaf.name, ""), 132, "small") for leaf in tree.fringe}
        self.height = 30 + 14.0 * max(len(lines) for lines in self.words.values())
        self.base = tree.depth * LEVEL
        self.boxes: dict[str, Box] = {}
        x = 0.0
        for leaf in tree.fringe:
            box = Box(x, self.base, self._width(leaf.name), self.height)
            self.boxes[leaf.name] = box
            x = box.right + GAP
        self._node(tree, 0)
        self._channels()

    def _width(self, name: str) -> float:
        ports = sum(name in channel.ends for channel in self.stage.channels)
        lines = (width_of(line, "small") for line in self.words[name])
        return max(92.0, width_of(name, "strong") + 24, 26.0 * ports + 16, *(w + 20 for w in lines))

    def _node(self, node: Node, depth: int) -> float:
        """Draw a group with all that is in it; where its middle is."""
        if not node.halves:
            self._leaf(node)
            return self.boxes[node.name].middle[0]
        middles = [self._node(half, depth + 1) for half in node.halves]
        x, y = (middles[0] + middles[1]) / 2, depth * LEVEL
        width = max(76.0, width_of(node.name, "strong") + 24)
        for half, middle in zip(node.halves, middles, strict=True):
            top = (depth + 1) * LEVEL if half.halves else self.base
            self.canvas.line([(x, y + 38), (x, y + 52), (middle, y + 52), (middle, top)], "thin")
        self.canvas.box(Box(x - width / 2, y, width, 38), "gone")
        self.canvas.words((x, y + 16), node.name, "strong", "middle")
        self.canvas.words((x, y + 31), f"step {node.step}", "small quiet", "middle")
        return x

    def _leaf(self, node: Node) -> None:
        box = self.boxes[node.name]
        new = node.name not in self.before.groups
        self.canvas.box(box, "fresh" if new else "box")
        self.canvas.words((box.middle[0], box.y + 19), node.name, "strong", "middle")
        for number, line in enumerate(self.words[node.name]):
            self.canvas.words((box.middle[0], box.y + 35 + 14 * number), line, "small quiet", "middle")

    def _channels(self) -> None:
        """Channels whose ends are there, shortest on top; ports of a group turn to where its channels lead."""
        shown = [c for c in self.stage.channels if all(end in self.boxes for end in c.ends)]
        ports = {(c.id, end): self._port(shown, c, end) for c in shown for end in c.ends}
        spans = [(ports[c.id, c.ends[0]], ports[c.id, c.ends[1]]) for c in shown]
        bottom = self.base + self.height
        upright = [x for span in spans for x in span]
        for channel, span, track in zip(shown, spans, tracks(spans), strict=True):
            low, high = sorted(span)
            y = bottom + 24 + TRACK * track
            news = self._news(channel)
            new = " new" if news else ""
            self.canvas.line([(low, bottom), (low, y), (high, y), (high, bottom)], f"channel dashed{new}")
            words = f"{channel.id} {news}".strip()
            self.canvas.patched((_free(low, high, words, upright), y + 4), words, "strong small marked", "middle")

    def _news(self, channel: Channel) -> str:
        """Return the change of a channel by the step besides moving it."""
        if channel.born == self.step:
            return "new"
        return (
            "more" if any(c.id == channel.id and c.transmits != channel.transmits for c in self.before.channels) else ""
        )

    def _port(self, shown: list[Channel], channel: Channel, end: str) -> float:
        box = self.boxes[end]
        here = [c for c in shown if end in c.ends]
        middles = {c.id: self.boxes[c.other(end)].middle[0] - box.middle[0] for c in here}
        # to the left first, the shortest outermost; then to the right, the shortest outermost again
        order = sorted(here, key=lambda c: (middles[c.id] > 0, -middles[c.id], c.id))
        return spread(len(here), box.x, box.right)[order.index(channel)]


def _free(low: float, high: float, words: str, upright: list[float]) -> float:
    """Return a place on a line where words meet no line that goes down: near the middle, if possible."""
    half = width_of(words, "strong small") / 2 + 6
    middle = (low + high) / 2
    room = max(0.0, (high - low) / 2 - half)
    places = [middle + sign * room * part / 6 for part in range(6) for sign in (1, -1)]
    clear = (x for x in places if all(abs(x - other) > half for other in upright if other not in (low, high)))
    return next(clear, middle)
