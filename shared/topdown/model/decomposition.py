"""Walks the steps of a decomposition: which groups there are in the end, which channels, between
whom (paper, section 4, step 2).

A channel keeps its number through every step. A split (both halves need it) retires the number and
makes two new ones. Here every step is carried out as far as it can be; what cannot be is returned
as a slip, which the checks turn into a finding.
"""

import msgspec

from topdown.model.elements import NewChannel, Step
from topdown.model.findings import Kind


class Channel(msgspec.Struct, frozen=True):
    """A channel between two groups: `born` is the step (from 1) it arose in, `transmits` what it
    carries by now.
    """

    id: str
    ends: tuple[str, str]
    transmits: tuple[str, ...]
    born: int

    def moved(self, old: str, new: str) -> "Channel":
        """The same channel with one end at another group."""
        first, second = self.ends
        ends = (new if first == old else first, new if second == old else second)
        return msgspec.structs.replace(self, ends=ends)

    def other(self, end: str) -> str:
        """The other end."""
        first, second = self.ends
        return second if end == first else first


class Slip(msgspec.Struct, frozen=True):
    """Something a step asks for that cannot be done; `part`: the field of the step's entry that
    does.
    """

    step: int
    kind: Kind
    wrong: str
    right: str
    part: str = ""


class Stage(msgspec.Struct, frozen=True):
    """Groups and channels after a step (0: before the first)."""

    step: int
    groups: tuple[str, ...]
    channels: tuple[Channel, ...]


class Decomposition(msgspec.Struct, frozen=True):
    """All stages, the tasks of every group there ever was, and what could not be done.

    `doubtful`: channels whose ends a slip leaves uncertain, so that nothing else is concluded from
    them.
    """

    stages: tuple[Stage, ...]
    tasks: dict[str, str]
    slips: tuple[Slip, ...]
    doubtful: frozenset[str] = frozenset()

    @property
    def astray(self) -> bool:
        """Whether groups or channels may be missing because a division or a split could not be
        carried out.
        """
        lost = (Kind.NEVER_INTRODUCED, Kind.DIVIDED_TWICE, Kind.SPLIT_WRONGLY)
        return any(slip.kind in lost and slip.part in ("divide", "split") for slip in self.slips)

    @property
    def last(self) -> Stage:
        """The outcome: the set of groups and the set of channels."""
        return self.stages[-1]


def decompose(root: str, steps: tuple[Step, ...]) -> Decomposition:
    """Every stage from the undivided `root` on."""
    walk = _Walk(root)
    stages = [Stage(0, (root,), ())]
    tasks: dict[str, str] = {}
    for step in steps:
        stages.append(walk.take(step))
        tasks.update({task.group: task.text for task in step.tasks})
    return Decomposition(tuple(stages), tasks, tuple(walk.slips), frozenset(walk.doubtful))


class _Walk:
    """Groups and channels as they are after the steps taken so far."""

    def __init__(self, root: str) -> None:
        self.number = 0
        self.groups: tuple[str, ...] = (root,)
        self.divided: dict[str, int] = {}  # group -> the step that divided it
        self.channels: dict[str, Channel] = {}
        self.retired: set[str] = set()
        self.slips: list[Slip] = []
        self.doubtful: set[str] = set()
        self.astray = False  # the present step divides what it cannot divide
        self.misled = False  # it gives a half a channel that the divided group has not

    def take(self, step: Step) -> Stage:
        """Carry a step out as far as it can be."""
        self.number += 1
        halves = self._divide(step)
        self.misled = False
        self._reallocate(step, halves)
        self._split(step, halves)
        self._forgotten(step)
        for new in step.channels:
            self._create(new)
        for more in step.complement:
            if (channel := self._existing(more.channel, "complement")) is not None:
                transmits = (*channel.transmits, more.adds)
                self.channels[more.channel] = msgspec.structs.replace(channel, transmits=transmits)
        return Stage(self.number, self.groups, tuple(self.channels.values()))

    def _slip(self, kind: Kind, wrong: str, right: str, part: str) -> None:
        self.slips.append(Slip(self.number, kind, wrong, right, part))

    def _divide(self, step: Step) -> tuple[str, ...]:
        """The halves to which channels may go."""
        self.astray = step.divide is not None and step.divide.group not in self.groups
        if step.divide is None:
            return ()
        group, halves = step.divide.group, step.divide.into
        known = f"groups are {', '.join(self.groups)}"
        if group in self.divided:
            wrong = f"group {group!r} was divided in step {self.divided[group]} already"
            self._slip(Kind.DIVIDED_TWICE, wrong, known, "divide")
            return halves
        if group not in self.groups:
            kind = Kind.NEVER_INTRODUCED
            self._slip(kind, f"group {group!r} is not there to be divided", known, "divide")
        for half in halves:
            if half in self.groups or half in self.divided or halves.count(half) > 1:
                wrong = f"group {half!r} exists already"
                self._slip(Kind.TWICE, wrong, "a half takes a name never used", "divide")
        self.divided[group] = self.number
        self.groups = tuple(dict.fromkeys((*(g for g in self.groups if g != group), *halves)))
        return halves

    def _existing(self, name: str, part: str) -> Channel | None:
        if name not in self.channels:
            gone = " any more" if name in self.retired else ""
            right = f"channels are {', '.join(self.channels) or 'none yet'}"
            self._slip(Kind.UNKNOWN_CHANNEL, f"channel {name!r} is not there{gone}", right, part)
        return self.channels.get(name)

    def _reallocate(self, step: Step, halves: tuple[str, ...]) -> None:
        for move in step.reallocate:
            channel = self._existing(move.channel, "reallocate")
            if channel is None:
                continue
            old = self._end_to_move(step, channel)
            if not old or move.to not in halves:
                self.doubtful.add(move.channel)
                if self.astray:
                    continue  # the division itself is the fault
                right = "reallocate the divided group's end to one of its halves"
                wrong = f"{move.channel} cannot go to {move.to!r}"
                if not old and step.divide is not None:
                    self.misled = move.to in halves
                    group = step.divide.group
                    wrong += f": it joins {' and '.join(channel.ends)}, and not {group}"
                    mine = [one.id for one in self.channels.values() if group in one.ends]
                    right = f"channels of {group} are {', '.join(mine) or 'none'}"
                self._slip(Kind.MOVED_WRONGLY, wrong, right, "reallocate")
                continue
            self.channels[move.channel] = channel.moved(old, move.to)
            if all(end in self.groups for end in self.channels[move.channel].ends):
                self.doubtful.discard(move.channel)

    def _end_to_move(self, step: Step, channel: Channel) -> str:
        """The divided group's end; of a channel in doubt, the end that is not a group."""
        if step.divide is not None and step.divide.group in channel.ends:
            return step.divide.group
        lost = [end for end in channel.ends if end not in self.groups]
        return lost[0] if lost and channel.id in self.doubtful else ""

    def _split(self, step: Step, halves: tuple[str, ...]) -> None:
        moved = {move.channel for move in step.reallocate}
        for split in step.split:
            channel = self._existing(split.channel, "split")
            if channel is None:
                continue
            fault = self._fault_of_split(step, channel, split.into, moved)
            if fault is not None:
                self._slip(Kind.SPLIT_WRONGLY, *fault, "split")
                self.doubtful |= {split.channel, *split.into}
            old = self._end_to_move(step, channel)
            if not old or not halves:
                continue
            if split.channel in self.doubtful:
                self.doubtful |= set(split.into)
            del self.channels[split.channel]
            self.retired |= {split.channel} - set(split.into)
            for name, half in zip(split.into, halves, strict=True):
                ends = channel.moved(old, half).ends
                self.channels[name] = Channel(name, ends, channel.transmits, self.number)

    def _fault_of_split(
        self, step: Step, channel: Channel, into: tuple[str, str], moved: set[str]
    ) -> tuple[str, str] | None:
        """The fault of a split and its correction."""
        if not self._end_to_move(step, channel):
            return (
                f"{channel.id} does not end at the divided group",
                "split channels of the divided group only",
            )
        if channel.id in moved:
            return (
                f"{channel.id} is reallocated and split",
                "a channel goes to one half or is split for both",
            )
        if channel.id in into or into[0] == into[1]:
            right = "a split retires the number and makes two new ones"
            return f"{channel.id} is split into {into[0]} and {into[1]}", right
        taken = [name for name in into if name in self.channels or name in self.retired]
        if taken:
            return (
                f"{channel.id} is split into {taken[0]}, which was there before",
                "take numbers never used",
            )
        return None

    def _forgotten(self, step: Step) -> None:
        """Channels of the divided group that no half took."""
        if step.divide is None or step.divide.group in self.groups:
            return
        group, halves = step.divide.group, step.divide.into
        for channel in self.channels.values():
            if group not in channel.ends or channel.id in self.doubtful:
                continue
            self.doubtful.add(channel.id)
            if self.misled:
                continue  # the channel that was named in its place is the fault
            other = channel.other(group)
            takes_part = (
                new for new in step.channels if any(half in new.between for half in halves)
            )
            heirs = [new.id for new in takes_part if other in new.between]
            if heirs:
                wrong = (
                    f"channel {channel.id} of the divided group {group!r} ends here, and {heirs[0]}"
                    " takes its place"
                )
                self.doubtful.add(heirs[0])
                right = f"reallocate {channel.id}: numbers never change"
                self._slip(Kind.RENUMBERED, wrong, right, "channels")
                continue
            wrong = f"channel {channel.id} ends at {group!r}, which is divided and so not a group"
            right = f"reallocate it to {halves[0]} or {halves[1]}, or split it"
            self._slip(Kind.NOT_REALLOCATED, wrong, right, "divide")

    def _create(self, new: NewChannel) -> None:
        if new.id in self.channels or new.id in self.retired:
            right = "a new channel takes a number never used before"
            self._slip(Kind.NUMBER_TAKEN, f"channel {new.id} exists already", right, "channels")
            return
        for end in new.between:
            if end in self.groups and new.between[0] != new.between[1]:
                continue
            self.doubtful.add(new.id)
            known = f"groups are {', '.join(self.groups)}"
            if end in self.divided:
                wrong = f"channel {new.id} ends at {end!r}, which step {self.divided[end]} divided"
                self._slip(Kind.HANGING, wrong, known, "channels")
            elif end not in self.groups:
                wrong = f"channel {new.id} ends at {end!r}, which is not a group"
                self._slip(Kind.NEVER_INTRODUCED, wrong, known, "channels")
            else:
                kind = Kind.ONE_END
                self._slip(kind, f"channel {new.id} joins {end!r} with itself", known, "channels")
                break
        self.channels[new.id] = Channel(new.id, new.between, (new.transmits,), self.number)
