"""Memory of a_desk, and the conditions of its states and arcs. Must not know: messages."""

import msgspec

from depot.desk.people import Wish


class Memory(msgspec.Struct, frozen=True, omit_defaults=True):
    """`wishes`: not ordered yet; `heard`: number of the last one taken; `order`: the conversation
    of the present one.

    `watch`: the subscription, which a death takes too; `watched`: the life of the dispatcher that
    knows of it; `ended`: how many orders have ended, and `delivered` of them.
    """

    wishes: tuple[Wish, ...] = ()
    heard: int = 0
    order: str = ""
    watch: str = ""
    watched: int = 0
    ended: int = 0
    delivered: int = 0


def order_there(memory: Memory) -> bool:
    """A person wants something."""
    return bool(memory.wishes)


def order_ended(memory: Memory) -> bool:
    """Whether the order has ended."""
    return not memory.order


CONDITIONS = {"order_ended": order_ended, "order_there": order_there}
