"""The method's own entries of a design file: the requirement tree, and the steps of the decomposition.

The paper, section 4, steps 1 and 2. `ruling` on any entry: the paper is silent or contradicts itself, and this is what
the design does.
"""

import msgspec


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An entry of a design file: unknown fields are errors, since they are misspelt ones."""

    ruling: str = ""


class Requirement(Entry, frozen=True):
    """A node of the requirement tree; no `parent`: a root.

    `evidence`: what shows that it is met, each "event:NAME" (of a run's report), "test:PATH" or "test:PATH::NAME",
    "message:USE act" or "message:USE act CLASS" (a communicate of a recording).
    """

    id: str
    text: str
    parent: str = ""
    evidence: tuple[str, ...] = ()


class Division(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A group is divided in two halves, both with coherent tasks."""

    group: str
    into: tuple[str, str]


class Task(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The task of a group."""

    group: str
    text: str


class Reallocation(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The divided group's end of a channel goes to one half."""

    channel: str
    to: str


class Split(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Both halves need the channel: it is retired, and two new ones take its place (first and second half)."""

    channel: str
    into: tuple[str, str]


class Complement(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A channel transmits more than before."""

    channel: str
    adds: str


class NewChannel(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A channel that arises in a step."""

    id: str
    between: tuple[str, str]
    transmits: str


class Stop(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The designer judges the group graspable: it is divided no further."""

    group: str
    reason: str


class Step(Entry, frozen=True):
    """A step of the decomposition, for one or more requirements (paper, section 4, step 2)."""

    requirements: tuple[str, ...]
    divide: Division | None = None
    tasks: tuple[Task, ...] = ()
    reallocate: tuple[Reallocation, ...] = ()
    split: tuple[Split, ...] = ()
    complement: tuple[Complement, ...] = ()
    channels: tuple[NewChannel, ...] = ()
    stop: tuple[Stop, ...] = ()


class Group(Entry, frozen=True):
    """A group that stays a group in this design: divided no further here, and no agent."""

    name: str
    text: str = ""
