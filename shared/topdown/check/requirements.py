"""The requirement tree is a tree, and every requirement is handled by exactly one step (paper, section 4, step 2)."""

from collections.abc import Iterator, Mapping

from topdown.check.trace import evidence, known, said
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind


def findings(design: Design) -> Iterator[Finding]:
    """Parents that are missing, cycles, requirements that no step or that two handle, unknown ones."""
    parents = {entry.id: entry.parent for entry in design.file.requirement}
    listed = f"one of {', '.join(parents)}"
    for index, (name, parent) in enumerate(parents.items()):
        where, at = f"requirement {name}", ("requirement", index)
        if parent and parent not in parents:
            yield Finding(Kind.UNDEFINED, where, f"its parent {parent!r} is not there", listed, (*at, "parent"))
        elif _circular(name, parents):
            yield Finding(Kind.NO_TREE, where, "is its own ancestor", "requirements form a tree", (*at, "parent"))
    handled: dict[str, int] = {}
    for index, step in enumerate(design.file.step):
        for name in step.requirements:
            where, place = f"step {index + 1}", ("step", index, "requirements")
            if name not in parents:
                yield Finding(Kind.UNDEFINED, where, f"requirement {name!r} is not there", listed, place)
            elif name in handled:
                wrong = f"requirement {name} is handled by step {handled[name]} already"
                yield Finding(Kind.COVERED_TWICE, where, wrong, "each requirement in one step", place)
            handled.setdefault(name, index + 1)
    for index, name in enumerate(parents):
        if name not in handled:
            right = "the method stops when all are processed: name it in a step"
            yield Finding(Kind.NOT_COVERED, f"requirement {name}", "no step handles it", right, ("requirement", index))
    yield from _evidence(design)


def _evidence(design: Design) -> Iterator[Finding]:
    """Evidence can be read, and the communicates it names are the design's."""
    for index, entry in enumerate(design.file.requirement):
        for word in entry.evidence:
            where, at = f"requirement {entry.id}", ("requirement", index, "evidence")
            try:
                one = evidence(word)
                strange = one.kind == "message" and not known(design, said(one.name))
            except ValueError as error:
                right = "write event:NAME, test:PATH::NAME or message:USE act LANGUAGE.Class"
                yield Finding(Kind.NO_EVIDENCE, where, str(error).partition(";")[0], right, at)
                continue
            if strange:
                right = "name a protocol, an act and a class that a message lists"
                yield Finding(Kind.NO_EVIDENCE, where, f"no message of the design is {one.name!r}", right, at)


def _circular(name: str, parents: Mapping[str, str]) -> bool:
    """Whether a requirement is among its own ancestors."""
    seen, here = {name}, parents.get(name, "")
    while here and here not in seen:
        seen.add(here)
        here = parents.get(here, "")
    return here == name


# --- The steps can be carried out, every group has a task, and every group left is an agent or said to stay a group


def step_findings(design: Design) -> Iterator[Finding]:
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
