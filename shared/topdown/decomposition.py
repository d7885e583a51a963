"""Walks the steps of a decomposition: which groups there are in the end, which channels, between whom (paper, section
4, step 2).

A channel keeps its number through every step. A split (both halves need it) retires the number and makes two new
ones. Here every step is carried out as far as it can be; what cannot be is returned as a slip, which the checks turn
into a finding.
"""

import msgspec

from topdown.elements import Step


class Channel(msgspec.Struct, frozen=True):
    """A channel between two groups: `born` is the step (from 1) it arose in, `transmits` what it carries by now."""

    id: str
    ends: tuple[str, str]
    transmits: tuple[str, ...]
    born: int

    def moved(self, old: str, new: str) -> "Channel":
        """The same channel with one end at another group."""
        first, second = self.ends
        return msgspec.structs.replace(self, ends=(new if first == old else first, new if second == old else second))

    def other(self, end: str) -> str:
        """The other end."""
        first, second = self.ends
        return second if end == first else first


class Slip(msgspec.Struct, frozen=True):
    """Something a step asks for that cannot be done."""

    step: int
    wrong: str
    right: str


class Stage(msgspec.Struct, frozen=True):
    """Groups and channels after a step (0: before the first)."""

    step: int
    groups: tuple[str, ...]
    channels: tuple[Channel, ...]


class Decomposition(msgspec.Struct, frozen=True):
    """All stages, the tasks of every group there ever was, and what could not be done."""

    stages: tuple[Stage, ...]
    tasks: dict[str, str]
    slips: tuple[Slip, ...]

    @property
    def last(self) -> Stage:
        """The outcome: the set of groups and the set of channels."""
        return self.stages[-1]


def decompose(root: str, steps: tuple[Step, ...]) -> Decomposition:
    """Every stage from the undivided `root` on."""
    stages = [Stage(0, (root,), ())]
    tasks: dict[str, str] = {}
    slips: list[Slip] = []
    for number, step in enumerate(steps, start=1):
        stages.append(_stage(number, step, stages[-1], slips))
        tasks.update({task.group: task.text for task in step.tasks})
    return Decomposition(tuple(stages), tasks, tuple(slips))


def _stage(number: int, step: Step, before: Stage, slips: list[Slip]) -> Stage:
    """The stage after one step."""
    groups = _divided(number, step, before.groups, slips)
    channels = {channel.id: channel for channel in before.channels}
    _reallocate(number, step, channels, slips)
    _split(number, step, channels, slips)
    for new in step.channels:
        if new.id in channels:
            slips.append(
                Slip(number, f"channel {new.id} exists already", "a new channel takes a number never used before")
            )
        channels[new.id] = Channel(new.id, new.between, (new.transmits,), number)
    for more in step.complement:
        if (channel := _existing(number, more.channel, channels, slips)) is not None:
            channels[more.channel] = msgspec.structs.replace(channel, transmits=(*channel.transmits, more.adds))
    slips.extend(_loose_ends(number, groups, channels))
    return Stage(number, groups, tuple(channels.values()))


def _divided(number: int, step: Step, groups: tuple[str, ...], slips: list[Slip]) -> tuple[str, ...]:
    if step.divide is None:
        return groups
    if step.divide.group not in groups:
        slips.append(Slip(number, f"group {step.divide.group!r} is not there", f"groups are {', '.join(groups)}"))
    return (*(group for group in groups if group != step.divide.group), *step.divide.into)


def _existing(number: int, name: str, channels: dict[str, Channel], slips: list[Slip]) -> Channel | None:
    if name not in channels:
        slips.append(
            Slip(number, f"channel {name!r} is not there", f"channels are {', '.join(channels) or 'none yet'}")
        )
    return channels.get(name)


def _reallocate(number: int, step: Step, channels: dict[str, Channel], slips: list[Slip]) -> None:
    for move in step.reallocate:
        channel = _existing(number, move.channel, channels, slips)
        if channel is None:
            continue
        if step.divide is None or step.divide.group not in channel.ends or move.to not in step.divide.into:
            slips.append(
                Slip(
                    number,
                    f"{move.channel} cannot go to {move.to!r}",
                    "reallocate the divided group's end to one of its halves",
                )
            )
            continue
        channels[move.channel] = channel.moved(step.divide.group, move.to)


def _split(number: int, step: Step, channels: dict[str, Channel], slips: list[Slip]) -> None:
    for split in step.split:
        channel = _existing(number, split.channel, channels, slips)
        if channel is None:
            continue
        if step.divide is None or step.divide.group not in channel.ends:
            slips.append(
                Slip(
                    number,
                    f"{split.channel} does not end at the divided group",
                    "split channels of the divided group only",
                )
            )
            continue
        del channels[split.channel]
        for name, half in zip(split.into, step.divide.into, strict=True):
            moved = channel.moved(step.divide.group, half)
            channels[name] = Channel(name, moved.ends, moved.transmits, number)


def _loose_ends(number: int, groups: tuple[str, ...], channels: dict[str, Channel]) -> list[Slip]:
    """Channels that end at a group which is no more, or never was."""
    return [
        Slip(
            number,
            f"channel {channel.id} ends at {end!r}, which is no group",
            f"groups are {', '.join(groups)}: reallocate or split it",
        )
        for channel in channels.values()
        for end in channel.ends
        if end not in groups
    ]
