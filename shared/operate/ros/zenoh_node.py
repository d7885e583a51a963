"""What ROS is told, as a node of ROS 2 over Zenoh: for nodes that run with rmw_zenoh.

What comes in are calls of services that only trigger something. Must not know: where messages come
from.
"""

from collections.abc import Callable, Iterable, Mapping
from functools import partial

from agent_runtime.io.ros_wire import Node
from operate.ros.messages import (
    TRIGGER,
    TRIGGER_HASH,
    Entry,
    Topic,
    encoded,
    hashed,
    nanoseconds,
    triggered,
)


class ZenohNode:
    """A node in the graph of ROS. `own`: its router is of this process."""

    def __init__(
        self,
        endpoint: str,
        name: str,
        domain: int,
        services: Mapping[str, Callable[[], tuple[bool, str]]],
    ) -> None:
        """`services`: name -> what it does, which gives whether it is done, and words. Raise
        agent_runtime.io.ros_wire.NoRosRouterError.
        """
        self._node = Node(endpoint, name, domain)
        self.own = self._node.own
        self._publishers: dict[str, Callable[[Callable[[], bytes], int], None]] = {}
        for service, do in services.items():
            self._node.service(service, TRIGGER, TRIGGER_HASH, partial(_answer, do))

    def offer(self, topics: Iterable[Topic]) -> None:
        """Name topics before anything is told on them."""
        for one in topics:
            self._publishers[one.name] = self._node.publisher(
                one.name, one.kind, hashed(one.kind), latched=one.latched
            )

    def tell(self, entry: Entry) -> None:
        """Tell a message; what nobody subscribes to is not encoded."""
        if entry.topic not in self._publishers:
            self.offer([Topic(entry.topic, entry.kind, entry.latched)])
        self._publishers[entry.topic](partial(encoded, entry), nanoseconds(entry.at))

    def answer(self) -> None:
        """Do nothing: the publishers keep what is latched."""

    def close(self) -> None:
        """Leave the graph."""
        self._node.close()


def _answer(do: Callable[[], tuple[bool, str]], request: bytes) -> bytes:
    return triggered(*do())
