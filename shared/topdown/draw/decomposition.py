"""The requirement tree (the paper's Figure 5) and what covers each requirement: steps, groups,
agents, channels.
"""

import re
from collections.abc import Iterable, Iterator
from itertools import product

import msgspec

from topdown.check.requirements import channels_of, descendants
from topdown.draw.canvas import Box, Canvas, spread, tracks, width_of, wrapped
from topdown.draw.document import Figure, Grid, Section, listed, outline, rulings
from topdown.model.decomposition import Channel, Stage
from topdown.model.design import Design
from topdown.model.elements import Requirement, Step
from topdown.model.errors import NoSuchEntry

INDENT = 30.0
WORDS = 420.0  # how wide a requirement's words may be before they are broken [px]


class Covered(msgspec.Struct, frozen=True):
    """A requirement with what the design does for it; `depth` in the tree, `steps` from 1."""

    id: str
    text: str
    depth: int
    steps: tuple[int, ...]
    groups: tuple[str, ...]
    agents: tuple[str, ...]
    channels: tuple[str, ...]
    evidence: tuple[str, ...]

    @property
    def by(self) -> str:
        """A short description of what covers it."""
        if not self.steps:
            return "no step handles it"
        which = ", ".join(str(step) for step in self.steps)
        made = listed([*self.groups, *self.channels], "")
        return f"step {which}" + (f": {made}" if made else "")


def requirements_section(design: Design, width: int) -> Section:
    """The tree, and the table of what covers it."""
    tree, title = covered(design), "What covers each requirement"
    rows = []
    for c in tree:
        steps = listed([str(step) for step in c.steps], "none")
        rows.append((c.id, c.text, steps, listed(c.groups), listed(c.agents), listed(c.channels)))
    head = ("id", "requirement", "steps", "groups", "agents within", "channels")
    notes = rulings(*((entry.id, entry.ruling) for entry in design.file.requirement))
    words = "\n".join(outline([(c.depth, f"{c.id}  {c.text}  [{c.by}]") for c in tree], width))
    caption, picture = "The requirement tree", _draw(design, tree)
    figure = Figure("requirements", caption, picture, words, tree, notes)
    lead = "What the system is for, from the general to the detailed, and the steps that see to it."
    parts: list[Grid | Figure] = [figure, Grid(title, head, tuple(rows)), *_evidence(tree)]
    return Section("requirements", "Requirements", lead, tuple(parts))


def _evidence(tree: tuple[Covered, ...]) -> tuple[Grid, ...]:
    """The evidence of the requirements, if the design names any; a leaf without evidence is
    marked.
    """
    if not any(entry.evidence for entry in tree):
        return ()
    rows = []
    for entry, after in zip(tree, [*tree[1:], None], strict=True):
        is_leaf = after is None or after.depth <= entry.depth
        rows += [(entry.id, shown) for shown in entry.evidence or (["none"] if is_leaf else [])]
    return (Grid("What shows that they are met", ("id", "event, test or message"), tuple(rows)),)


def covered(design: Design) -> tuple[Covered, ...]:
    """All requirements in the order of the tree."""
    final, found = design.decomposition.last.groups, []
    for entry, depth in _walk(design.file.requirement, "", 0):
        numbered = enumerate(design.file.step, start=1)
        steps = {number: step for number, step in numbered if entry.id in step.requirements}
        groups = [g for step in steps.values() if step.divide for g in step.divide.into]
        leaves = (leaf for group in groups for leaf in descendants(design, group) if leaf in final)
        channels = (name for step in steps.values() for name in channels_of(step))
        made = (tuple(groups), tuple(dict.fromkeys(leaves)), tuple(dict.fromkeys(channels)))
        found.append(Covered(entry.id, entry.text, depth, tuple(steps), *made, entry.evidence))
    return tuple(found)


def _walk(
    entries: tuple[Requirement, ...], parent: str, depth: int
) -> Iterator[tuple[Requirement, int]]:
    known = {entry.id for entry in entries}
    for entry in entries:
        if entry.parent == parent or (not parent and entry.parent not in known):
            yield entry, depth
            if entry.id != entry.parent and depth < len(entries):
                yield from _walk(entries, entry.id, depth + 1)


def _draw(design: Design, tree: tuple[Covered, ...]) -> Canvas:
    canvas = Canvas(f"The requirement tree of {design.file.system.name}")
    texts = [wrapped(entry.text, WORDS) or [""] for entry in tree]
    across = 0.0
    for entry, lines in zip(tree, texts, strict=True):
        words = width_of(entry.id, "strong") + max(map(width_of, lines))
        across = max(across, entry.depth * INDENT + words + 34)
    y, below = 0.0, dict[int, float]()
    for entry, lines in zip(tree, texts, strict=True):
        x, height = entry.depth * INDENT, 12 + 17.0 * len(lines)
        if entry.depth:
            elbow, middle = x - INDENT + 12, y + height / 2
            canvas.line([(elbow, below[entry.depth - 1]), (elbow, middle), (x, middle)], "thin")
        canvas.box(Box(x, y, across - x, height), "box" if entry.steps else "gone")
        canvas.words((x + 10, y + 19), entry.id, "strong")
        canvas.column((x + 20 + width_of(entry.id, "strong"), y + 19), lines, 17)
        css = "small marked" if entry.steps else "small alert"
        canvas.words((across + 14, y + height / 2 + 4), entry.by, css)
        below[entry.depth] = y + height
        y += height + 9
    return canvas


# --- The decomposition tree with its channels after any step (the paper's Figure 6, and the
# pictures of Tables 1 and 2) Groups that are divided stand above, darker; the fringe (the groups of
# that step) is one row below, and the channels run under it, each in a track of its own.


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
        """The number of levels below."""
        return 1 + max(half.depth for half in self.halves) if self.halves else 0


def grown(design: Design, step: int) -> Node:
    """The tree after a step; halves are turned so that the channels of the finished design are
    short, at each step alike.
    """
    names = tuple(dict.fromkeys(entry.divide.group for entry in design.file.step if entry.divide))
    some = (False, True) if len(names) <= FLIPPED else (False,)
    last, channels = len(design.file.step), design.decomposition.last.channels

    def length(turn: tuple[bool, ...]) -> int:
        fringe = as_filed(design, last, names, turn).fringe
        place = {node.name: index for index, node in enumerate(fringe)}
        ends = (channel.ends for channel in channels)
        return sum(abs(place[a] - place[b]) ** 2 for a, b in ends if a in place and b in place)

    return as_filed(design, step, names, min(product(some, repeat=len(names)), key=length))


def as_filed(
    design: Design, step: int, names: tuple[str, ...] = (), turn: tuple[bool, ...] = ()
) -> Node:
    """The tree after a step, halves in the order of the file; or the other way round in the groups
    that are turned.
    """
    divided: dict[str, tuple[int, tuple[str, str]]] = {}
    for number, entry in enumerate(design.file.step[:step], start=1):
        if entry.divide:
            divided.setdefault(entry.divide.group, (number, entry.divide.into))
    turned = dict(zip(names, turn, strict=True))

    def node(name: str, above: tuple[str, ...]) -> Node:
        if name not in divided or name in above:
            return Node(name, 0, ())
        number, halves = divided[name]
        order = reversed(halves) if turned.get(name) else halves
        return Node(name, number, tuple(node(half, (*above, name)) for half in order))

    return node(design.file.system.root, ())


def plain(design: Design, step: int, width: int) -> str:
    """The tree and the channels as text."""
    stage = design.decomposition.stages[step]

    def told(node: Node, depth: int) -> Iterator[tuple[int, str]]:
        channels = ", ".join(channel.id for channel in stage.channels if node.name in channel.ends)
        task = design.decomposition.tasks.get(node.name, "")
        note = f"divided in step {node.step}" if node.step else task
        mark = f"  [{channels}]" if channels else ""
        yield depth, f"{node.name}{mark}  {note}".rstrip()
        for half in node.halves:
            yield from told(half, depth + 1)

    lines = outline([*told(as_filed(design, step), 0)], width)
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
        self.before: Stage = design.decomposition.stages[max(0, step - 1)]
        self.step, tasks = step, design.decomposition.tasks
        tree = grown(design, step)
        names = [leaf.name for leaf in tree.fringe]
        self.words = {name: wrapped(tasks.get(name, ""), 132, "small") for name in names}
        self.height = 30 + 14.0 * max(len(lines) for lines in self.words.values())
        self.base = tree.depth * LEVEL
        self.boxes: dict[str, Box] = {}
        x = 0.0
        for name in names:
            self.boxes[name] = Box(x, self.base, self._width(name), self.height)
            x = self.boxes[name].right + GAP
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
        x, new = box.middle[0], node.name not in self.before.groups
        self.canvas.box(box, "fresh" if new else "box")
        self.canvas.words((x, box.y + 19), node.name, "strong", "middle")
        self.canvas.column((x, box.y + 35), self.words[node.name], 14, "small quiet", "middle")

    def _channels(self) -> None:
        """Channels whose ends are there, shortest on top; ports of a group turn to where its
        channels lead.
        """
        shown = [c for c in self.stage.channels if all(end in self.boxes for end in c.ends)]
        ports = {(c.id, end): self._port(shown, c, end) for c in shown for end in c.ends}
        spans = [(ports[c.id, c.ends[0]], ports[c.id, c.ends[1]]) for c in shown]
        bottom = self.base + self.height
        upright = [x for span in spans for x in span]
        for channel, span, track in zip(shown, spans, tracks(spans), strict=True):
            low, high = sorted(span)
            y = bottom + 24 + TRACK * track
            # what the step changed of it besides moving it
            before = [c.transmits for c in self.before.channels if c.id == channel.id]
            grown = any(transmits != channel.transmits for transmits in before)
            news = "new" if channel.born == self.step else "more" if grown else ""
            css = f"channel dashed{' new' if news else ''}"
            self.canvas.line([(low, bottom), (low, y), (high, y), (high, bottom)], css)
            words = f"{channel.id} {news}".strip()
            at = (_free(low, high, words, upright), y + 4)
            self.canvas.patched(at, words, "strong small marked", "middle")

    def _port(self, shown: list[Channel], channel: Channel, end: str) -> float:
        box = self.boxes[end]
        here = [c for c in shown if end in c.ends]
        middles = {c.id: self.boxes[c.other(end)].middle[0] - box.middle[0] for c in here}
        # to the left first, the shortest outermost; then to the right, the shortest outermost again
        order = sorted(here, key=lambda c: (middles[c.id] > 0, -middles[c.id], c.id))
        return spread(len(here), box.x, box.right)[order.index(channel)]


def _free(low: float, high: float, words: str, upright: list[float]) -> float:
    """A place on a line where words meet no line that goes down: near the middle, if possible."""
    half = width_of(words, "strong small") / 2 + 6
    middle = (low + high) / 2
    room = max(0.0, (high - low) / 2 - half)
    places = [middle + sign * room * part / 6 for part in range(6) for sign in (1, -1)]
    others = [x for x in upright if x not in (low, high)]
    return next((x for x in places if all(abs(x - o) > half for o in others)), middle)


# --- The steps of the decomposition, each as the paper's Tables 1 and 2 summarize it --------------


def steps_section(design: Design, step: int | None, width: int) -> Section:
    """A table and a tree for each step, or for one."""
    parts: list[Grid | Figure] = []
    for number in range(1, len(design.file.step) + 1) if step is None else [_checked(design, step)]:
        parts.append(_table(design, number))
        parts.append(_figure(design, number, width, f"step-{number}"))
    lead = (
        "Each step handles requirements: it divides a group in two, moves its channels to the"
        " halves, and creates or complements channels. A channel keeps its number."
    )
    return Section("steps", "Steps of the decomposition", lead, tuple(parts), paired=True)


def tree_section(design: Design, step: int | None, width: int) -> Section:
    """The tree after a step (none: the last one)."""
    number = _checked(design, len(design.file.step) if step is None else step)
    lead = "Groups that were divided stand above, the fringe below; broken lines are channels."
    stage = design.decomposition.stages[number]
    channels = channels_grid(f"Channels after step {number}", stage.channels)
    figure = _figure(design, number, width, "tree")
    return Section("tree", "Decomposition tree", lead, (figure, channels))


def channels_grid(title: str, channels: Iterable[Channel]) -> Grid:
    """Channels with their ends and what they are for."""
    rows = ((c.id, "-".join(c.ends), str(c.born), "; ".join(c.transmits)) for c in channels)
    return Grid(title, ("channel", "between", "since step", "transmits"), tuple(rows))


def _checked(design: Design, step: int) -> int:
    last = len(design.file.step)
    if not 0 <= step <= last:
        raise NoSuchEntry("step", str(step), (str(number) for number in range(last + 1)))
    return step


def _figure(design: Design, number: int, width: int, name: str) -> Figure:
    caption = f"Groups and channels after step {number}" if number else "Before the first step"
    words = plain(design, number, width)
    return Figure(name, caption, draw(design, number), words, design.decomposition.stages[number])


def _table(design: Design, number: int) -> Grid:
    """One step in the rows of the paper's Table 1. Step 0 changes nothing."""
    if not number:
        return Grid("Step 0", ("", ""), (("Groups", design.file.system.root),))
    step, stages = design.file.step[number - 1], design.decomposition.stages
    rows = tuple(_rows(design, step, stages[number - 1], stages[number]))
    slips = [s for s in design.decomposition.slips if s.step == number]
    notes = (f"cannot be carried out: {s.wrong} ({s.right})" for s in slips)
    return Grid(f"Step {number}", ("", ""), rows, (*notes, *rulings(("ruling", step.ruling))))


def _rows(design: Design, step: Step, before: Stage, after: Stage) -> Iterator[tuple[str, str]]:
    texts = {entry.id: entry.text for entry in design.file.requirement}
    handled = (f"{name} {texts.get(name, '')}".strip() for name in step.requirements)
    yield "Requirements", "; ".join(handled) or "-"
    cut = step.divide
    yield "Division", f"{cut.group} := <{', '.join(cut.into)}>" if cut else "-"
    for task in step.tasks:
        yield f"Tasks of {task.group}", task.text
    old = {channel.id: channel for channel in before.channels}
    new = {channel.id: channel for channel in after.channels}
    moves = [f"{_at(old, m.channel)} ↦ {_at(new, m.channel)}" for m in step.reallocate]
    yield "Channel reallocation", listed(moves)
    if step.split:
        halves = (
            f"{_at(old, s.channel)} ↦ {', '.join(_at(new, name) for name in s.into)}"
            for s in step.split
        )
        yield "Channel split", listed(tuple(halves))
    if step.complement:
        added = (f"{_at(new, c.channel)} also transmits {c.adds}" for c in step.complement)
        yield "Complemented channels", "; ".join(added)
    yield "New channels", listed([_at(new, channel.id) for channel in step.channels])
    for channel in step.channels:
        yield f"{channel.id} transmits", channel.transmits
    for stop in step.stop:
        yield f"{stop.group} is divided no further", stop.reason
    yield "Groups after it", listed(after.groups)
    yield "Channels after it", listed([_at(new, name) for name in sorted(new, key=natural)])


def _at(channels: dict[str, Channel], name: str) -> str:
    """A channel with its ends."""
    return f"{name} {'-'.join(channels[name].ends)}" if name in channels else f"{name} (not there)"


def natural(name: str) -> tuple[tuple[int, str], ...]:
    """For sorting: C2 before C10."""
    parts = filter(None, re.split(r"(\d+)", name))
    return tuple((int(part), "") if part.isdigit() else (0, part) for part in parts)


def in_order(channels: Iterable[Channel]) -> list[Channel]:
    """Channels by their names."""
    return sorted(channels, key=lambda channel: natural(channel.id))
