"""Devices of an agent: a worker process, the loop, an HTTP server, or a plain function in tests.

`turn.tell(struct)` reaches the device's `tell`; what the device `post`s reaches the agent as
Local(struct). The shell and the pretend wires use the same interface, so an agent and its devices
are wired alike in both.
"""

from collections.abc import Callable, Iterable
from typing import Any, Protocol

from fipa_codec.communicate import Communicate


class Post(Protocol):
    """A device's way to its agent and to people; may be used on any thread and never blocks."""

    def __call__(self, content: Any, delay_s: float = 0.0) -> None:
        """Hand a Struct to the agent as Local, after `delay_s`."""

    def publish(self, kind: str, data: bytes, *peer: str) -> None:
        """Put something on the agent's key of this kind (`telemetry`, `truth`), or on the one for
        `peer`; dropped where it would have to wait.
        """

    def hear(self, kind: str, on_data: Callable[[bytes], None]) -> None:
        """Have `on_data` called with what others put on their keys of this kind for the agent, on
        any thread; it must only keep it.
        """

    def hear_guests(self, on_data: Callable[[str, bytes], None]) -> None:
        """Have `on_data` called with key and bytes of what guests of the design say to the agent,
        on any thread.
        """

    def say_to_guest(self, communicate: Communicate) -> None:
        """Say something to a guest; dropped where it would have to wait."""


class Device(Protocol):
    """`busy`: it computes and will post soon; the pretend wires' clock stands still meanwhile."""

    @property
    def busy(self) -> bool: ...

    def tell(self, content: Any) -> None:
        """Take a word of the agent; must not block. On one thread at a time, not always the
        same.
        """

    def close(self) -> None:
        """The agent's process ends (or died, in the pretend wires)."""


DeviceMaker = Callable[[Post], Device]


class NoDevice:
    """The device of agents without devices; a message to it is a bug of the agent."""

    busy = False

    def tell(self, content: Any) -> None:
        """Refuse."""
        raise TypeError(
            f"this agent has no device to tell {type(content).__name__} to: give shell or wires one"
        )

    def close(self) -> None:
        """Nothing to close."""


class Called:
    """A function as a device: called with each word, it gives what to post back after how many
    seconds.
    """

    busy = False

    def __init__(self, post: Post, answer: Callable[[Any], Iterable[tuple[float, Any]]]) -> None:
        self._post, self._answer = post, answer

    def tell(self, content: Any) -> None:
        """Call the function and post what it gives."""
        for delay_s, reply in self._answer(content):
            self._post(reply, delay_s)

    def close(self) -> None:
        """Nothing to close."""
