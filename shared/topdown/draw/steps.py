"""The steps of the decomposition, each as the paper's Tables 1 and 2 summarize it, with the tree after it."""

import re
from collections.abc import Iterator

from topdown.draw import decomposition_tree
from topdown.draw.document import Figure, Grid, Section, listed, rulings
from topdown.model.decomposition import Channel, Stage
from topdown.model.design import Design
from topdown.model.elements import Step
from topdown.model.errors import NoSuchEntry


def section(design: Design, step: int | None, width: int) -> Section:
    """A table and a tree for each step, or for one."""
    parts: list[Grid | Figure] = []
    for number in _numbers(design, step):
        parts.append(_table(design, number))
        parts.append(_figure(design, number, width, f"step-{number}"))
    lead = (
        "Each step handles requirements: it divides a group in two, moves its channels to the halves, and creates or "
        "complements channels. A channel keeps its number."
    )
    return Section("steps", "Steps of the decomposition", lead, tuple(parts), paired=True)


def tree_section(design: Design, step: int | None, width: int) -> Section:
    """The tree after a step (none: the last one)."""
    number = _checked(design, len(design.file.step) if step is None else step)
    stage = design.decomposition.stages[number]
    rows = tuple((c.id, "-".join(c.ends), str(c.born), "; ".join(c.transmits)) for c in stage.channels)
    lead = "Groups that were divided stand above, the fringe below; broken lines are channels."
    grid = Grid(f"Channels after step {number}", ("channel", "between", "since step", "transmits"), rows)
    return Section("tree", "Decomposition tree", lead, (_figure(design, number, width, "tree"), grid))


def _numbers(design: Design, step: int | None) -> list[int]:
    return list(range(1, len(design.file.step) + 1)) if step is None else [_checked(design, step)]


def _checked(design: Design, step: int) -> int:
    last = len(design.file.step)
    if not 0 <= step <= last:
        raise NoSuchEntry("step", str(step), (str(number) for number in range(last + 1)))
    return step


def _figure(design: Design, number: int, width: int, name: str) -> Figure:
    caption = f"Groups and channels after step {number}" if number else "Before the first step"
    words = decomposition_tree.plain(design, number, width)
    return Figure(name, caption, decomposition_tree.draw(design, number), words, design.decomposition.stages[number])


def _table(design: Design, number: int) -> Grid:
    """One step in the rows of the paper's Table 1. Step 0 changes nothing."""
    if not number:
        return Grid("Step 0", ("", ""), (("Groups", design.file.system.root),))
    step, stages = design.file.step[number - 1], design.decomposition.stages
    rows = tuple(_rows(design, step, stages[number - 1], stages[number]))
    slips = (f"cannot be carried out: {s.wrong} ({s.right})" for s in design.decomposition.slips if s.step == number)
    return Grid(f"Step {number}", ("", ""), rows, (*slips, *rulings(("ruling", step.ruling))))


def _rows(design: Design, step: Step, before: Stage, after: Stage) -> Iterator[tuple[str, str]]:
    texts = {entry.id: entry.text for entry in design.file.requirement}
    yield "Requirements", "; ".join(f"{name} {texts.get(name, '')}".strip() for name in step.requirements) or "-"
    yield "Division", f"{step.divide.group} := <{', '.join(step.divide.into)}>" if step.divide else "-"
    for task in step.tasks:
        yield f"Tasks of {task.group}", task.text
    old = {channel.id: channel for channel in before.channels}
    new = {channel.id: channel for channel in after.channels}
    moves = [f"{_at(old, m.channel)} ↦ {_at(new, m.channel)}" for m in step.reallocate]
    yield "Channel reallocation", listed(moves)
    if step.split:
        halves = (f"{_at(old, s.channel)} ↦ {', '.join(_at(new, name) for name in s.into)}" for s in step.split)
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
    return tuple((int(part), "") if part.isdigit() else (0, part) for part in re.split(r"(\d+)", name) if part)
