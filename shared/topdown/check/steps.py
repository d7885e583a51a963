"""The steps can be carried out, every group has a task, and every group left is an agent or said to stay a group."""

from collections.abc import Iterator

from topdown.model.design import Design
from topdown.model.findings import Finding, Kind


def findings(design: Design) -> Iterator[Finding]:
    """Return the findings of replaying the steps (paper, section 4, step 2)."""
    for slip in design.decomposition.slips:
        at = ("step", slip.step - 1, slip.part) if slip.part else ("step", slip.step - 1)
        yield Finding(slip.kind, f"step {slip.step}", slip.wrong, slip.right, at)
    yield from _tasks(design)
    yield from _stops(design)
    if not design.decomposition.astray:
        yield from _left(design)  # else what is left follows from the division that failed


def _tasks(design: Design) -> Iterator[Finding]:
    """Each half has clear, coherent tasks, said in the step that makes it."""
    for index, step in enumerate(design.file.step):
        halves = step.divide.into if step.divide else ()
        told = [task.group for task in step.tasks]
        for half in halves:
            if half not in told:
                agent = ", an agent," if half in design.agents else ""
                wrong = f"group {half}{agent} has no task"
                right = "each half has clear, coherent tasks: say it under `tasks`"
                yield Finding(Kind.NO_TASK, f"step {index + 1}", wrong, right, ("step", index))
        for group in told:
            if group not in halves:
                wrong = f"a task is given to {group!r}, which is not a half"
                right = f"halves are {' and '.join(halves) or 'none in this step'}"
                yield Finding(Kind.NEVER_INTRODUCED, f"step {index + 1}", wrong, right, ("step", index, "tasks"))


def _stops(design: Design) -> Iterator[Finding]:
    """A group that is said to be graspable is there, and is divided no further."""
    stopped: dict[str, int] = {}
    stages = design.decomposition.stages
    for index, step in enumerate(design.file.step):
        where, at = f"step {index + 1}", ("step", index)
        if step.divide and step.divide.group in stopped:
            wrong = f"group {step.divide.group!r} is divided although step {stopped[step.divide.group]} stopped there"
            yield Finding(Kind.STOP, where, wrong, "drop the stop decision or the division", (*at, "divide"))
        for stop in step.stop:
            if stop.group not in stages[index + 1].groups:
                right = f"groups are {', '.join(stages[index + 1].groups)}"
                yield Finding(Kind.STOP, where, f"stops at {stop.group!r}, which is not a group", right, (*at, "stop"))
            stopped.setdefault(stop.group, index + 1)
    for group in design.decomposition.last.groups if stopped and not design.decomposition.astray else ():
        if group not in stopped:
            right = "say under `stop` why it is divided no further, as for the others"
            yield Finding(Kind.STOP, f"group {group}", "has no stop decision", right)


def _left(design: Design) -> Iterator[Finding]:
    """Groups and agents are the same but for the groups that stay groups."""
    groups = design.decomposition.last.groups
    staying = {entry.name: index for index, entry in enumerate(design.file.group)}
    for group in groups:
        if group not in design.agents and group not in staying:
            right = "give it an agent entry, or a group entry that says it stays a group"
            yield Finding(Kind.LEFT_OVER, f"group {group}", "is divided no further and is not an agent", right)
    listed = f"groups are {', '.join(groups)}"
    for index, agent in enumerate(design.agents):
        if agent not in groups:
            yield Finding(
                Kind.NEVER_INTRODUCED, f"agent {agent}", "no step ends in this group", listed, ("agent", index)
            )
    for name, index in staying.items():
        if name not in groups:
            yield Finding(Kind.NEVER_INTRODUCED, f"group {name}", "no step ends in it", listed, ("group", index))
        elif name in design.agents:
            yield Finding(Kind.TWICE, f"group {name}", "is an agent as well", "an agent or a group", ("group", index))
