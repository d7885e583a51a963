"""Memory of a bidder, and the conditions of its states and arcs. Must not know: messages."""

import msgspec
from companion.design import AnyCommand


class Memory(msgspec.Struct, frozen=True, omit_defaults=True):
    """`robot`: the included system; `call`: the conversation of the tender, "" for none, about order `number`, which
    is `task`; `offered`, `awarded`: how far that is; `asked`: the conversation with the robot.
    """

    robot: str
    call: str = ""
    number: int = 0
    task: AnyCommand | None = None
    offered: bool = False
    awarded: bool = False
    asked: str = ""


def called(memory: Memory) -> bool:
    """There is a call to answer."""
    return bool(memory.call)


def planned(memory: Memory) -> bool:
    """The call is answered."""
    return memory.offered or not memory.call


def offer_made(memory: Memory) -> bool:
    """An offer binds it."""
    return memory.offered


def accepted(memory: Memory) -> bool:
    """The offer was accepted."""
    return memory.awarded


def answered(memory: Memory) -> bool:
    """The offer was accepted or rejected."""
    return memory.awarded or not memory.call


def ended(memory: Memory) -> bool:
    """The robot's last word was passed on."""
    return not memory.call


CONDITIONS = {condition.__name__: condition for condition in (accepted, answered, called, ended, offer_made, planned)}
