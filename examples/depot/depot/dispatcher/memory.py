"""Memory of a_dispatcher, and the conditions of its states and arcs. Must not know: messages."""

import msgspec


class Order(msgspec.Struct, frozen=True):
    """The order that is worked on, with its conversation."""

    conversation: str
    item: str
    source: str
    target: str


class Memory(msgspec.Struct, frozen=True, omit_defaults=True):
    """`calls`: robot -> its open tender; `pending`: robots whose proposal is still waited for;
    `offers`: robot -> s.

    `rounds`: how often this order was put out; `robot`: who carries it, "" for nobody yet.
    """

    order: Order | None = None
    rounds: int = 0
    calls: dict[str, str] = {}
    pending: tuple[str, ...] = ()
    offers: dict[str, float] = {}
    robot: str = ""
    waited: bool = False
    delivered: int = 0
    failed: int = 0


def order_taken(memory: Memory) -> bool:
    """There is an order to work on."""
    return memory.order is not None


def all_heard(memory: Memory) -> bool:
    """Every robot that was called has answered, or its time is over."""
    return not memory.pending


def decided(memory: Memory) -> bool:
    """The proposals are dealt with."""
    return not memory.offers


def awarded(memory: Memory) -> bool:
    """A robot has the job."""
    return bool(memory.robot)


def carried(memory: Memory) -> bool:
    """The robot has said its last word."""
    return not memory.robot


def pause_over(memory: Memory) -> bool:
    """It is time to call again."""
    return memory.waited


def given_up(memory: Memory) -> bool:
    """The order has failed."""
    return memory.order is None


CONDITIONS = {
    condition.__name__: condition
    for condition in (all_heard, awarded, carried, decided, given_up, order_taken, pause_over)
}
