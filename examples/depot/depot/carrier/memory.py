"""Memory of a robot that carries, and the conditions of its states and arcs. Must not know:
messages.
"""

import msgspec

from depot.world import Point


class Job(msgspec.Struct, frozen=True):
    """A transport it has offered to do, with the conversation of the tender."""

    conversation: str
    item: str
    source: str
    target: str


class Memory(msgspec.Struct, frozen=True, omit_defaults=True):
    """`trips`: stations still to go to, the present one first; `way`: the conversation about the
    aisle, "" for none.

    `speed` in m/s; `here`: where it was last [m]; `driving`: the wheels were told to.
    """

    home: str
    speed: float
    here: Point
    job: Job | None = None
    awarded: bool = False
    trips: tuple[str, ...] = ()
    way: str = ""
    driving: bool = False
    at_goal: bool = False


def offer_made(memory: Memory) -> bool:
    """An offer binds it."""
    return memory.job is not None


def accepted(memory: Memory) -> bool:
    """The offer was accepted."""
    return memory.awarded


def answered(memory: Memory) -> bool:
    """The offer was accepted or rejected."""
    return memory.awarded or memory.job is None


def arrived(memory: Memory) -> bool:
    """It stands where the present trip ends."""
    return memory.at_goal


CONDITIONS = {"accepted": accepted, "answered": answered, "arrived": arrived, "offer_made": offer_made}
