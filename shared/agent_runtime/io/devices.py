"""Devices of an agent: a worker process, the loop, an HTTP server, or a plain function in
tests.

`turn.tell(struct)` reaches the device's `tell`; what the device `post`s reaches the agent as Local(struct). The shell
and the pretend wires use the same interface, so an agent and its devices are wired alike in both.
"""

from collections.abc import Callable, Iterable
from typing import Any, Protocol

from agent_runtime.io.worker import Worker


class Post(Protocol):
    """A device's way to its agent and to people; may be used on any thread and never blocks."""

    def __call__(self, content: Any, delay_s: float = 0.0) -> None:
        """Hand a Struct to the agent as Local, after `delay_s`."""

    def publish(self, kind: str, data: bytes) -> None:
        """Put something on the agent's key of this kind (`telemetry`, `truth`); dropped where it would have to wait."""


class Device(Protocol):
    """`busy`: it computes and will post soon; the pretend wires' clock stands still meanwhile."""

    @property
    def busy(self) -> bool: ...

    def tell(self, content: Any) -> None:
        """Take a word of the agent; must not block. On one thread at a time, not always the same."""

    def close(self) -> None:
        """The agent's process ends (or died, in the pretend wires)."""


DeviceMaker = Callable[[Post], Device]


class NoDevice:
    """The device of agents without devices; a message to it is a bug of the agent."""

    busy = False

    def tell(self, content: Any) -> None:
        """Refuse."""
        raise TypeError(f"this agent has no device to tell {type(content).__name__} to: give shell or wires one")

    def close(self) -> None:
        """Nothing to close."""


class Called:
    """A function as a device: called with each word, it gives what to post back after how many seconds."""

    busy = False

    def __init__(self, post: Post, answer: Callable[[Any], Iterable[tuple[float, Any]]]) -> None:
        self._post, self._answer = post, answer

    def tell(self, content: Any) -> None:
        """Call the function and post what it gives."""
        for delay_s, reply in self._answer(content):
            self._post(reply, delay_s)

    def close(self) -> None:
        """Nothing to close."""


class Errand:
    """A worker process as a device: a word of class `begin` starts a new one (the old one is killed), one of class
    `stop` kills it, any other is handed on.

    The worker answers each message with one message; it is busy until then. `ended(exit code)` makes the message that
    is posted when the worker ends by itself, None for none.
    """

    def __init__(
        self, post: Post, entry: str, *, answers: Any, begin: type, stop: type, ended: Callable[[int], Any]
    ) -> None:
        self._post, self._entry, self._answers = post, entry, answers
        self._begin, self._stop, self._ended = begin, stop, ended
        self._worker: Worker | None = None
        self._told = self._said = 0

    @property
    def busy(self) -> bool:
        """The worker computes."""
        return self._told > self._said

    def tell(self, content: Any) -> None:
        """Start, stop or tell the worker."""
        if isinstance(content, self._stop | self._begin):
            self.close()
        if isinstance(content, self._begin):
            self._worker = Worker(self._entry, answers=self._answers, on_message=self._heard, on_end=self._over)
        if self._worker is not None:
            self._told += 1
            self._worker.tell(content)

    def close(self) -> None:
        """Kill the worker, if there is one."""
        if self._worker is not None:
            self._worker.kill()
        self._worker, self._told, self._said = None, 0, 0

    def _heard(self, message: Any) -> None:
        self._post(message)
        self._said += 1  # after the post: between the two the device must not look idle

    def _over(self, code: int) -> None:
        word = self._ended(code)
        if word is not None:
            self._post(word)
        self._said = self._told
