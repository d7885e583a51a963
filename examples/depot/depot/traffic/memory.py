"""Memory of a_traffic, and the conditions of its states and arcs. Must not know: messages."""

import msgspec


class Memory(msgspec.Struct, frozen=True, omit_defaults=True):
    """Conversations about the aisle: of the robot that is inside, and of those that wait, the first
    to ask first.
    """

    inside: str = ""
    waiting: tuple[str, ...] = ()


def someone_inside(memory: Memory) -> bool:
    """The aisle is taken."""
    return bool(memory.inside)


def nobody_inside(memory: Memory) -> bool:
    """The aisle is free."""
    return not memory.inside


CONDITIONS = {"nobody_inside": nobody_inside, "someone_inside": someone_inside}
