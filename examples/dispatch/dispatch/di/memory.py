"""Memory of di, and the conditions of its states and arcs. Must not know: messages."""

import msgspec
from companion.design import AnyCommand


class Order(msgspec.Struct, frozen=True, omit_defaults=True):
    """An order that is not done. `tried`: robots that failed in it; `refused`: robot -> how often it did not offer to
    do it; `not_before`: robot -> when it may be called for it again [unix s].
    """

    number: int
    task: AnyCommand
    tried: tuple[str, ...] = ()
    refused: dict[str, int] = {}
    not_before: dict[str, float] = {}


class Memory(msgspec.Struct, frozen=True, omit_defaults=True):
    """`waiting`: orders that nobody has, the oldest first; `heard`: number of the last one; `order`: the one that is
    put out; `calls`: robot -> its open tender; `pending`: robots whose offer is still waited for; `offers`: robot -> s;
    `awards`: robot -> the order that it has.
    """

    waiting: tuple[Order, ...] = ()
    heard: int = 0
    order: Order | None = None
    calls: dict[str, str] = {}
    pending: tuple[str, ...] = ()
    offers: dict[str, float] = {}
    awards: dict[str, Order] = {}
    done: int = 0
    failed: int = 0


def order_waits(memory: Memory) -> bool:
    """There is an order, and a robot to call."""
    return memory.order is not None


def all_heard(memory: Memory) -> bool:
    """Every robot that was called has answered, or its time is over."""
    return not memory.pending


def decided(memory: Memory) -> bool:
    """The offers are dealt with."""
    return memory.order is None


CONDITIONS = {condition.__name__: condition for condition in (all_heard, decided, order_waits)}
