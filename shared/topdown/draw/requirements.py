"""The requirement tree (the paper's Figure 5) and what covers each requirement: steps, groups, agents, channels."""

from collections.abc import Iterator

import msgspec

from topdown.draw.canvas import Box, Canvas, width_of, wrapped
from topdown.draw.document import Figure, Grid, Section, listed, rulings
from topdown.draw.text import hung
from topdown.model.design import Design
from topdown.model.elements import Requirement

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
        """Return a short description of what covers it."""
        if not self.steps:
            return "no step handles it"
        which = ", ".join(str(step) for step in self.steps)
        made = listed([*self.groups, *self.channels], "")
        return f"step {which}" + (f": {made}" if made else "")


def section(design: Design, width: int) -> Section:
    """The tree, and the table of what covers it."""
    tree = covered(design)
    rows = tuple(
        (
            c.id,
            c.text,
            listed([str(step) for step in c.steps], "none"),
            listed(c.groups),
            listed(c.agents),
            listed(c.channels),
        )
        for c in tree
    )
    notes = rulings(*((entry.id, entry.ruling) for entry in design.file.requirement))
    grid = Grid(
        "What covers each requirement",
        ("id", "requirement", "steps", "groups", "agents within", "channels"),
        rows,
    )
    figure = Figure("requirements", "The requirement tree", _draw(design, tree), _plain(tree, width), tree, notes)
    lead = "What the system is for, from the general to the detailed, and the steps that see to it."
    return Section("requirements", "Requirements", lead, (figure, grid, *_evidence(tree)))


def _evidence(tree: tuple[Covered, ...]) -> tuple[Grid, ...]:
    """Return the evidence of the requirements, if the design names any; a leaf without evidence is marked."""
    if not any(entry.evidence for entry in tree):
        return ()
    rows = []
    for entry, after in zip(tree, [*tree[1:], None], strict=True):
        is_leaf = after is None or after.depth <= entry.depth
        rows += [(entry.id, shown) for shown in entry.evidence or (["none"] if is_leaf else [])]
    return (Grid("What shows that they are met", ("id", "event, test or message"), tuple(rows)),)


def covered(design: Design) -> tuple[Covered, ...]:
    """All requirements in the order of the tree."""
    return tuple(_covered(design, entry, depth) for entry, depth in _walk(design.file.requirement, "", 0))


def _walk(entries: tuple[Requirement, ...], parent: str, depth: int) -> Iterator[tuple[Requirement, int]]:
    known = {entry.id for entry in entries}
    for entry in entries:
        if entry.parent == parent or (not parent and entry.parent not in known):
            yield entry, depth
            if entry.id != entry.parent and depth < len(entries):
                yield from _walk(entries, entry.id, depth + 1)


def _covered(design: Design, entry: Requirement, depth: int) -> Covered:
    steps = [(n, step) for n, step in enumerate(design.file.step, start=1) if entry.id in step.requirements]
    groups = [group for _, step in steps if step.divide for group in step.divide.into]
    channels = [c.id for _, step in steps for c in step.channels]
    channels += [name for _, step in steps for split in step.split for name in split.into]
    channels += [c.channel for _, step in steps for c in step.complement]
    final = design.decomposition.last.groups
    agents = [leaf for group in groups for leaf in leaves(design, group) if leaf in final]
    return Covered(
        entry.id,
        entry.text,
        depth,
        tuple(number for number, _ in steps),
        tuple(groups),
        tuple(dict.fromkeys(agents)),
        tuple(dict.fromkeys(channels)),
        entry.evidence,
    )


def leaves(design: Design, group: str) -> tuple[str, ...]:
    """Return the groups into which a group is divided in the end."""
    halves = {step.divide.group: step.divide.into for step in design.file.step if step.divide}
    found, ahead, seen = [], [group], set[str]()
    while ahead:
        here = ahead.pop(0)
        if here in halves and here not in seen:
            ahead = [*halves[here], *ahead]
        else:
            found.append(here)
        seen.add(here)
    return tuple(found)


def _plain(tree: tuple[Covered, ...], width: int) -> str:
    lines: list[str] = []
    for index, entry in enumerate(tree):
        bars = "".join("│  " if _follows(tree, index, depth) else "   " for depth in range(1, entry.depth))
        corner = ("├─ " if _follows(tree, index, entry.depth) else "└─ ") if entry.depth else ""
        below = bars + (("│  " if _follows(tree, index, entry.depth) else "   ") if entry.depth else "")
        below += "│  " if _follows(tree, index, entry.depth + 1) else "   "
        lines += hung(f"{bars}{corner}", f"{entry.id}  {entry.text}  [{entry.by}]", width, below)
    return "\n".join(lines)


def _follows(tree: tuple[Covered, ...], index: int, depth: int) -> bool:
    """Whether a branch at this depth goes on below."""
    for entry in tree[index + 1 :]:
        if entry.depth <= depth:
            return entry.depth == depth
    return False


def _draw(design: Design, tree: tuple[Covered, ...]) -> Canvas:
    canvas = Canvas(f"The requirement tree of {design.file.system.name}")
    texts = [wrapped(entry.text, WORDS) or [""] for entry in tree]
    ids = [width_of(entry.id, "strong") for entry in tree]
    wide = [max(width_of(line) for line in lines) for lines in texts]
    across = max((e.depth * INDENT + i + w + 34 for e, i, w in zip(tree, ids, wide, strict=True)), default=0)
    y, below = 0.0, dict[int, float]()
    for entry, lines, id_width in zip(tree, texts, ids, strict=True):
        x, height = entry.depth * INDENT, 12 + 17.0 * len(lines)
        if entry.depth:
            elbow = x - INDENT + 12
            canvas.line([(elbow, below[entry.depth - 1]), (elbow, y + height / 2), (x, y + height / 2)], "thin")
        canvas.box(Box(x, y, across - x, height), "box" if entry.steps else "gone")
        canvas.words((x + 10, y + 19), entry.id, "strong")
        for number, line in enumerate(lines):
            canvas.words((x + 20 + id_width, y + 19 + 17 * number), line)
        canvas.words((across + 14, y + height / 2 + 4), entry.by, "small marked" if entry.steps else "small alert")
        below[entry.depth] = y + height
        y += height + 9
    return canvas
