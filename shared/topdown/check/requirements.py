"""The requirement tree is a tree, and every requirement is handled by exactly one step (paper,
section 4, step 2).
"""

from collections.abc import Callable, Iterable, Iterator
from enum import StrEnum
from typing import NamedTuple

import msgspec

from fipa_codec.exploration import reached
from fipa_codec.performatives import Performative
from topdown.check.recorded import Observed, use_of
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind

Exists = Callable[[str, str], bool]
"""(path, name of a test in it or "") -> whether it is there."""


class Shown(StrEnum):
    """State of a piece of evidence."""

    SEEN = "seen"
    """In the recording; of a test: it is there."""
    NAMED = "named"
    """Not looked for, without a recording."""
    MISSING = "missing"
    """Looked for, and not there."""


class Evidence(msgspec.Struct, frozen=True):
    """A piece of evidence, read: "event", "test" or "message", what it names, whether it was seen,
    how often.
    """

    kind: str
    name: str
    shown: Shown = Shown.NAMED
    count: int = 0


class Traced(msgspec.Struct, frozen=True):
    """A leaf requirement with all that follows from it; `steps` from 1."""

    id: str
    text: str
    steps: tuple[int, ...]
    groups: tuple[str, ...]
    agents: tuple[str, ...]
    channels: tuple[str, ...]
    evidence: tuple[Evidence, ...]

    @property
    def bare(self) -> bool:
        """Nothing shows it: no evidence, or none that is there."""
        return all(one.shown is Shown.MISSING for one in self.evidence)


class EvidenceMessage(msgspec.Struct, frozen=True):
    """A communicate named as evidence: "USE act" or "USE act CLASS"."""

    use: str
    act: str
    content: str = ""


KINDS = ("event", "test", "message")


def evidence_message(name: str) -> EvidenceMessage:
    """What the words of a message evidence name. Raises ValueError, which says how they are
    written.
    """
    parts = name.split()
    if len(parts) not in (2, 3):
        raise ValueError(
            f"{name!r} names no communicate; write `message:USE act` or `message:USE act"
            " LANGUAGE.Class`"
        )
    return EvidenceMessage(*parts)


def evidence(word: str) -> Evidence:
    """A piece of evidence as it is written. ValueError says how."""
    kind, colon, name = word.partition(":")
    if not colon or kind not in KINDS or not name.strip():
        raise ValueError(
            f"{word!r} is not evidence; write event:NAME, test:PATH::NAME or message:USE act CLASS"
        )
    return Evidence(kind, name.strip())


def leaves(design: Design) -> tuple[elements.Requirement, ...]:
    """Requirements that no other refines."""
    parents = {entry.parent for entry in design.file.requirement}
    return tuple(entry for entry in design.file.requirement if entry.id not in parents)


def trace(
    design: Design, run: Observed | None = None, exists: Exists | None = None
) -> tuple[Traced, ...]:
    """Every leaf requirement, in the file's order. Raises ValueError for evidence that cannot be
    read.
    """
    return tuple(_traced(design, leaf, run, exists) for leaf in leaves(design))


def _traced(
    design: Design, leaf: elements.Requirement, run: Observed | None, exists: Exists | None
) -> Traced:
    numbered = enumerate(design.file.step, start=1)
    steps = {number: step for number, step in numbered if leaf.id in step.requirements}
    found = (group for number, step in steps.items() for group in _groups(design, number, step))
    groups = tuple(dict.fromkeys(found))
    agents = dict.fromkeys(agent for group in groups for agent in descendants(design, group))
    channels = dict.fromkeys(name for step in steps.values() for name in channels_of(step))
    shown = tuple(_looked_for(design, evidence(word), run, exists) for word in leaf.evidence)
    made = (tuple(steps), groups, tuple(agents), tuple(channels), shown)
    return Traced(leaf.id, leaf.text, *made)


def _groups(design: Design, number: int, step: elements.Step) -> Iterator[str]:
    """The halves a step makes; of one that divides nothing the ends of the channels it touches."""
    if step.divide is not None:
        yield from step.divide.into
        return
    stage = {channel.id: channel for channel in design.decomposition.stages[number].channels}
    for name in channels_of(step):
        yield from stage[name].ends if name in stage else ()


def channels_of(step: elements.Step) -> Iterator[str]:
    """The channels a step makes or gives more to carry; reallocated ones were there for something
    else.
    """
    yield from (new.id for new in step.channels)
    yield from (name for split in step.split for name in split.into)
    yield from (more.channel for more in step.complement)


def descendants(design: Design, group: str) -> tuple[str, ...]:
    """The groups of the finished design that a group became."""
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


def _looked_for(
    design: Design, one: Evidence, run: Observed | None, exists: Exists | None
) -> Evidence:
    if one.kind == "test":
        if exists is None:
            return one
        path, _, name = one.name.partition("::")
        shown = Shown.SEEN if exists(path, name) else Shown.MISSING
        return msgspec.structs.replace(one, shown=shown)
    if run is None:
        return one
    count = run.events.count(one.name) if one.kind == "event" else 0
    if one.kind == "message":
        wanted = evidence_message(one.name)
        for heard in run.communicates:
            use = use_of(design, heard)
            if use is not None and (use.name, heard.performative) == (wanted.use, wanted.act):
                count += not wanted.content or wanted.content == heard.content
    return msgspec.structs.replace(one, shown=Shown.SEEN if count else Shown.MISSING, count=count)


def known(design: Design, wanted: EvidenceMessage) -> bool:
    """Whether the design has such a communicate at all."""
    uses = (rule for rule in design.rules.values() if rule.use == wanted.use)
    rules = [rule for rule in uses if rule.performative == wanted.act]
    acts = {str(act) for act in Performative}
    fits = any(not wanted.content or wanted.content in rule.contents for rule in rules)
    return wanted.act in acts and fits


# --- Requirements that are lost with an agent


class Loss(NamedTuple):
    """Ids of the leaf requirements that are lost with an agent, and of those that are lost in
    part.
    """

    whole: tuple[str, ...]
    part: tuple[str, ...]


def lost_without(design: Design, agent: str) -> Loss:
    """What nobody can meet once an agent is gone for good: a requirement each of whose uses has the
    agent at an end; in part, where some of them have.
    """
    whole, part = [], []
    for one in trace(design):
        gone = [agent in (use.initiator, use.participant) for use in _uses_of(design, one)]
        if gone and all(gone):
            whole.append(one.id)
        elif any(gone):
            part.append(one.id)
    return Loss(tuple(whole), tuple(part))


def _uses_of(design: Design, one: Traced) -> list[elements.Protocol]:
    """The uses of the communicates that are its evidence, and their like with other peers: what one
    robot shows, another can do. Without such evidence the uses on the channels of its steps.
    """
    named = {word.name.split(" ")[0] for word in one.evidence if word.kind == "message"}
    shown = [use for use in design.file.protocol if use.name in named]
    alike = [use for use in design.file.protocol if any(_alike(use, other) for other in shown)]
    return alike or [use for use in design.file.protocol if use.channel in one.channels]


def _alike(one: elements.Protocol, other: elements.Protocol) -> bool:
    """Whether two uses ask the same of one agent, or are asked the same by one."""
    same = (one.follows, one.interface) == (other.follows, other.interface)
    return same and (one.initiator == other.initiator or one.participant == other.participant)


# --- The requirement tree is a tree, every requirement is handled by exactly one step (paper,
# section 4, step 2)


def findings(design: Design) -> Iterator[Finding]:
    """Parents that are missing, cycles, requirements that no step or that two handle, unknown
    ones.
    """
    parents = {entry.id: entry.parent for entry in design.file.requirement}
    listed = f"one of {', '.join(parents)}"
    for index, (name, parent) in enumerate(parents.items()):
        where, at = f"requirement {name}", ("requirement", index)
        if parent and parent not in parents:
            wrong = f"its parent {parent!r} is not there"
            yield Finding(Kind.UNDEFINED, where, wrong, listed, (*at, "parent"))
        elif parent and name in reached([parent], lambda one: filter(None, [parents.get(one)])):
            wrong = "is its own ancestor"
            yield Finding(Kind.NO_TREE, where, wrong, "requirements form a tree", (*at, "parent"))
    handled: dict[str, int] = {}
    for index, step in enumerate(design.file.step):
        for name in step.requirements:
            where, place = f"step {index + 1}", ("step", index, "requirements")
            if name not in parents:
                wrong = f"requirement {name!r} is not there"
                yield Finding(Kind.UNDEFINED, where, wrong, listed, place)
            elif name in handled:
                wrong = f"requirement {name} is handled by step {handled[name]} already"
                right = "each requirement in one step"
                yield Finding(Kind.COVERED_TWICE, where, wrong, right, place)
            handled.setdefault(name, index + 1)
    yield from _order(design, parents)
    missing = [name for name in parents if name not in handled]
    idle = [index for index, step in enumerate(design.file.step) if not step.requirements]
    for index in idle:
        here = f" ({', '.join(missing)}: no step handles it)" if missing else ""
        right = f"name the requirement it is for{here}, or drop the step"
        where, place = f"step {index + 1}", ("step", index, "requirements")
        yield Finding(Kind.NO_REQUIREMENT, where, "handles no requirement", right, place)
    for index, name in enumerate(parents):
        if name in missing and not idle:  # else the idle step is the cause
            right = "the method stops when all are processed: name it in a step"
            where, at = f"requirement {name}", ("requirement", index)
            yield Finding(Kind.NOT_COVERED, where, "no step handles it", right, at)
    yield from _evidence(design)


def _order(design: Design, parents: dict[str, str]) -> Iterator[Finding]:
    """The method goes from the top down: a step handles no requirement before its parent."""
    order = {name: None for step in design.file.step for name in step.requirements}
    seen: set[str] = set()
    for index, step in enumerate(design.file.step):
        for name in step.requirements:
            seen.add(name)
            parent = parents.get(name, "")
            if parent in order and parent not in seen and parent != name:
                wrong = f"handles requirement {name} before its parent {parent}"
                right = f"handle {parent} in an earlier step, or name it before {name} in this one"
                at = ("step", index, "requirements")
                yield Finding(Kind.CHILD_FIRST, f"step {index + 1}", wrong, right, at)


def _evidence(design: Design) -> Iterator[Finding]:
    """Evidence can be read, and the communicates it names are the design's."""
    for index, entry in enumerate(design.file.requirement):
        for word in entry.evidence:
            where, at = f"requirement {entry.id}", ("requirement", index, "evidence")
            try:
                one = evidence(word)
                strange = one.kind == "message" and not known(design, evidence_message(one.name))
            except ValueError as error:
                right = "write event:NAME, test:PATH::NAME or message:USE act LANGUAGE.Class"
                yield Finding(Kind.NO_EVIDENCE, where, str(error).partition(";")[0], right, at)
                continue
            if strange:
                right = "name a protocol, an act and a class that a message lists"
                wrong = f"no message of the design is {one.name!r}"
                yield Finding(Kind.NO_EVIDENCE, where, wrong, right, at)


# --- The steps can be carried out, every group has a task, and every group left is an agent or said
# to stay a group


def step_findings(design: Design) -> Iterator[Finding]:
    """The findings of replaying the steps (paper, section 4, step 2)."""
    for slip in design.decomposition.slips:
        at = ("step", slip.step - 1, slip.part) if slip.part else ("step", slip.step - 1)
        yield Finding(slip.kind, f"step {slip.step}", slip.wrong, slip.right, at)
    yield from _tasks(design)
    yield from _stops(design)
    if not design.decomposition.astray:
        yield from _left(design)  # else what is left follows from the division that failed


def _tasks(design: Design) -> Iterator[Finding]:
    """Each half has clear, coherent tasks of its own, said in the step that makes it."""
    texts: dict[str, tuple[int, str]] = {}
    for index, step in enumerate(design.file.step):
        halves = step.divide.into if step.divide else ()
        told = [task.group for task in step.tasks]
        for half in halves:
            if half not in told:
                agent = ", an agent," if half in design.agents else ""
                wrong = f"group {half}{agent} has no task"
                right = "each half has clear, coherent tasks: say it under `tasks`"
                yield Finding(Kind.NO_TASK, f"step {index + 1}", wrong, right, ("step", index))
        for number, task in enumerate(step.tasks):
            if task.group not in halves:
                continue  # a finding of its own
            place = ("step", index, "tasks", number)
            before, group = texts.setdefault(_plain(task.text), (index + 1, task.group))
            if group != task.group:
                wrong = f"group {task.group} has the task of {group} (step {before}): {task.text!r}"
                right = f"say what {task.group} does that {group} does not"
                yield Finding(Kind.SAME_TASK, f"step {index + 1}", wrong, right, place)
        for group in told:
            if group not in halves:
                wrong = f"a task is given to {group!r}, which is not a half"
                right = f"halves are {' and '.join(halves) or 'none in this step'}"
                where = f"step {index + 1}"
                yield Finding(Kind.NEVER_INTRODUCED, where, wrong, right, ("step", index, "tasks"))


def _plain(text: str) -> str:
    """Words alone: two texts that differ in case, blanks or a full stop are the same."""
    return " ".join(text.lower().split()).rstrip(".")


def _stops(design: Design) -> Iterator[Finding]:
    """A group that is said to be graspable is there, and is divided no further."""
    stopped: dict[str, int] = {}
    stages = design.decomposition.stages
    for index, step in enumerate(design.file.step):
        where, at = f"step {index + 1}", ("step", index)
        if step.divide and step.divide.group in stopped:
            wrong = (
                f"group {step.divide.group!r} is divided although step {stopped[step.divide.group]}"
                " stopped there"
            )
            right = "drop the stop decision or the division"
            yield Finding(Kind.STOP, where, wrong, right, (*at, "divide"))
        for stop in step.stop:
            if stop.group not in stages[index + 1].groups:
                right = f"groups are {', '.join(stages[index + 1].groups)}"
                wrong = f"stops at {stop.group!r}, which is not a group"
                yield Finding(Kind.STOP, where, wrong, right, (*at, "stop"))
            if stop.group in stopped:
                wrong = f"stops at {stop.group}, as step {stopped[stop.group]} does"
                right = "say once why a group is divided no further"
                yield Finding(Kind.STOP, where, wrong, right, (*at, "stop"))
            stopped.setdefault(stop.group, index + 1)
    told = stopped and not design.decomposition.astray
    for group in design.decomposition.last.groups if told else ():
        if group not in stopped:
            right = "say under `stop` why it is divided no further, as for the others"
            yield Finding(Kind.STOP, f"group {group}", "has no stop decision", right)


def _left(design: Design) -> Iterator[Finding]:
    """Groups and agents are the same but for the groups that stay groups."""
    groups = design.decomposition.last.groups
    staying = {entry.name: index for index, entry in enumerate(design.file.group)}
    bare = [group for group in groups if group not in design.agents and group not in staying]
    strange = [agent for agent in design.agents if agent not in groups]
    renamed = len(bare) == len(strange) == 1  # one name, written in two ways
    for group in bare if not renamed else ():
        right = "give it an agent entry, or a group entry that says it stays a group"
        wrong = "is divided no further and is not an agent"
        yield Finding(Kind.LEFT_OVER, f"group {group}", wrong, right)
    listed = f"groups are {', '.join(groups)}"
    for index, agent in enumerate(design.agents):
        if agent not in groups:
            wrong = "no step ends in this group"
            wrong += f", and group {bare[0]} has no agent" if renamed else ""
            yield Finding(Kind.NEVER_INTRODUCED, f"agent {agent}", wrong, listed, ("agent", index))
    for name, index in staying.items():
        if name not in groups:
            wrong = "no step ends in it"
            yield Finding(Kind.NEVER_INTRODUCED, f"group {name}", wrong, listed, ("group", index))
        elif name in design.agents:
            where, wrong = f"group {name}", "is an agent as well"
            yield Finding(Kind.TWICE, where, wrong, "an agent or a group", ("group", index))


def outcome_findings(design: Design) -> Iterator[Finding]:
    """The outcome as the designer writes it down must be that of the steps; none needs to be
    stated.
    """
    outcome = design.file.outcome
    if outcome is None:
        return
    where = outcome.where
    yield from _missing_or_extra(where, "agents", outcome.agents, design.agents)
    groups = [entry.name for entry in design.file.group]
    yield from _missing_or_extra(where, "groups", outcome.groups, groups)
    stated = {channel.id: channel for channel in outcome.channels}
    if not design.decomposition.astray:
        for channel in stated.values():
            yield from _stated(design, where, channel)
        listed = [set(stated.between) for stated in outcome.channels]
        for known in design.channels.values():
            if set(known.ends) not in listed and known.id not in design.decomposition.doubtful:
                wrong = f"leaves out {known.id}, between {' and '.join(known.ends)}"
                yield Finding(Kind.OUTCOME, where, wrong, "list it", ("outcome", "channels"))


def _missing_or_extra(
    where: str, what: str, stated: Iterable[str], known: Iterable[str]
) -> Iterator[Finding]:
    extra, missing = sorted(set(stated) - set(known)), sorted(set(known) - set(stated))
    for name in extra:
        right = f"{what} are {', '.join(known) or 'none'}"
        yield Finding(Kind.OUTCOME, where, f"lists {name} among the {what}", right, ("outcome",))
    for name in missing:
        wrong = f"leaves {name} out of the {what}"
        yield Finding(Kind.OUTCOME, where, wrong, "list it", ("outcome",))


def _stated(design: Design, where: str, stated: elements.StatedChannel) -> Iterator[Finding]:
    known = design.channels.get(stated.id)
    if stated.id in design.decomposition.doubtful or (
        known is not None and set(known.ends) == set(stated.between)
    ):
        return
    ends = " and ".join(stated.between)
    between = set(stated.between)
    same = [one.id for one in design.channels.values() if set(one.ends) == between]
    if same:
        wrong = f"calls the channel of {ends} {stated.id}"
        right = f"the steps made it {same[0]}: numbers never change"
        yield Finding(Kind.RENUMBERED, where, wrong, right, ("outcome", "channels"))
    else:
        right = f"{known.id} joins {' and '.join(known.ends)}" if known else "no step makes it"
        wrong = f"has {stated.id} between {ends}"
        yield Finding(Kind.OUTCOME, where, wrong, right, ("outcome", "channels"))
