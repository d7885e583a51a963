"""Every leaf requirement -> the groups its steps made -> the agents those became -> their channels -> what shows it.

Evidence stands with the requirement (elements.Requirement): an event of a run's report, a test, a communicate. Without
a recording events and communicates are only named; with one they are looked for in it. Tests are looked for by whoever
has the files: `exists` says whether one is there.
"""

from collections.abc import Callable, Iterator
from enum import StrEnum

import msgspec

from fipa_codec.performatives import Performative
from topdown.check.observe import Observed, use_of
from topdown.model import elements
from topdown.model.design import Design

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
    """A piece of evidence, read: "event", "test" or "message", what it names, whether it was seen, how often."""

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


class Said(msgspec.Struct, frozen=True):
    """A communicate named as evidence: "USE act" or "USE act CLASS"."""

    use: str
    act: str
    content: str = ""


KINDS = ("event", "test", "message")


def said(name: str) -> Said:
    """Return what the words of a message evidence name. Raises ValueError, which says how they are written."""
    parts = name.split()
    if len(parts) not in (2, 3):
        raise ValueError(f"{name!r} names no communicate; write `message:USE act` or `message:USE act LANGUAGE.Class`")
    return Said(*parts)


def evidence(word: str) -> Evidence:
    """A piece of evidence as it is written. ValueError says how."""
    kind, colon, name = word.partition(":")
    if not colon or kind not in KINDS or not name.strip():
        raise ValueError(f"{word!r} is not evidence; write event:NAME, test:PATH::NAME or message:USE act CLASS")
    return Evidence(kind, name.strip())


def leaves(design: Design) -> tuple[elements.Requirement, ...]:
    """Requirements that no other refines."""
    parents = {entry.parent for entry in design.file.requirement}
    return tuple(entry for entry in design.file.requirement if entry.id not in parents)


def trace(design: Design, run: Observed | None = None, exists: Exists | None = None) -> tuple[Traced, ...]:
    """Every leaf requirement, in the file's order. Raises ValueError for evidence that cannot be read."""
    return tuple(_traced(design, leaf, run, exists) for leaf in leaves(design))


def _traced(design: Design, leaf: elements.Requirement, run: Observed | None, exists: Exists | None) -> Traced:
    steps = [(n, step) for n, step in enumerate(design.file.step, start=1) if leaf.id in step.requirements]
    groups = tuple(dict.fromkeys(group for number, step in steps for group in _groups(design, number, step)))
    channels = tuple(dict.fromkeys(name for _, step in steps for name in _channels(step)))
    return Traced(
        id=leaf.id,
        text=leaf.text,
        steps=tuple(number for number, _ in steps),
        groups=groups,
        agents=tuple(dict.fromkeys(agent for group in groups for agent in descendants(design, group))),
        channels=channels,
        evidence=tuple(_looked_for(design, evidence(word), run, exists) for word in leaf.evidence),
    )


def _groups(design: Design, number: int, step: elements.Step) -> Iterator[str]:
    """The halves a step makes; of one that divides nothing the ends of the channels it touches."""
    if step.divide is not None:
        yield from step.divide.into
        return
    stage = {channel.id: channel for channel in design.decomposition.stages[number].channels}
    for name in _channels(step):
        yield from stage[name].ends if name in stage else ()


def _channels(step: elements.Step) -> Iterator[str]:
    """The channels a step makes or gives more to carry; reallocated ones were there for something else."""
    yield from (new.id for new in step.channels)
    yield from (name for split in step.split for name in split.into)
    yield from (more.channel for more in step.complement)


def descendants(design: Design, group: str) -> tuple[str, ...]:
    """The groups of the finished design that a group became."""
    halves = {step.divide.group: step.divide.into for step in design.file.step if step.divide is not None}
    if group not in halves:
        return (group,)
    first, second = halves[group]
    return (*descendants(design, first), *descendants(design, second))


def _looked_for(design: Design, one: Evidence, run: Observed | None, exists: Exists | None) -> Evidence:
    if one.kind == "test":
        if exists is None:
            return one
        path, _, name = one.name.partition("::")
        return msgspec.structs.replace(one, shown=Shown.SEEN if exists(path, name) else Shown.MISSING)
    if run is None:
        return one
    count = run.events.count(one.name) if one.kind == "event" else _heard(design, said(one.name), run)
    return msgspec.structs.replace(one, shown=Shown.SEEN if count else Shown.MISSING, count=count)


def _heard(design: Design, wanted: Said, run: Observed) -> int:
    """Return the number of times that a communicate was heard."""
    found = 0
    for one in run.communicates:
        use = use_of(design, one)
        if use is not None and (use.name, one.performative) == (wanted.use, wanted.act):
            found += not wanted.content or wanted.content == one.content
    return found


def known(design: Design, wanted: Said) -> bool:
    """Whether the design has such a communicate at all."""
    rules = [rule for rule in design.rules.values() if rule.use == wanted.use and rule.performative == wanted.act]
    acts = {str(act) for act in Performative}
    fits = any(not wanted.content or wanted.content in rule.contents for rule in rules)
    return wanted.act in acts and fits
