"""Signals that end a command which started something: SIGTERM and SIGHUP end it as Ctrl-C does, in
order.

The first one raises KeyboardInterrupt where the command stands. While it then ends what it started,
only Ctrl-C is heard again: a person who does not want to wait. `timeout` and a closed terminal send
more than one.
"""

import contextlib
import signal
import time
from collections.abc import Callable, Iterator
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
AGAIN_S = 1.0
"""Ctrl-C within this time is still the first one; estimate: `timeout -s INT` sends its two within a
millisecond.
"""


class _Heard:
    """The handler: once for all signals, then for Ctrl-C alone."""

    def __init__(self) -> None:
        self._last: float | None = None

    def __call__(self, number: int, _: FrameType | None) -> None:
        now = time.monotonic()
        if self._last is None or (number == signal.SIGINT and now - self._last > AGAIN_S):
            self._last = now
            raise KeyboardInterrupt


@contextlib.contextmanager
def heard() -> Iterator[None]:
    """SIGTERM and SIGHUP interrupt as Ctrl-C does, as long as this lasts.

    Ctrl-C does so also where a shell started the command in the background and had it ignored:
    children would inherit that. An ignored SIGHUP stays so: `nohup` means it.
    """
    with _handled(
        _Heard(),
        [number for number in SIGNALS if number is not signal.SIGHUP or not _ignored(number)],
    ):
        yield


@contextlib.contextmanager
def signalled(stop: Callable[[], None]) -> Iterator[None]:
    """Signals only call `stop`, as long as this lasts: who is told goes on to where it can end in
    order.
    """
    with _handled(lambda *_: stop(), [number for number in SIGNALS if not _ignored(number)]):
        yield


@contextlib.contextmanager
def held() -> Iterator[Callable[[], None]]:
    """Signals wait until `let_go`, which this gives: what must be known before it can be ended is
    begun before it.
    """
    waiting: list[int] = []
    before = {number: signal.getsignal(number) for number in SIGNALS if not _ignored(number)}

    def let_go() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)
        before.clear()
        while waiting:
            signal.raise_signal(waiting.pop())

    with _handled(lambda number, _: waiting.append(number), list(before)):
        yield let_go


@contextlib.contextmanager
def put_off() -> Iterator[None]:
    """A signal that raises waits until this is over. One that comes more than AGAIN_S later does
    not: nobody may read what is written.
    """
    waiting: list[tuple[float, int]] = []
    before = {
        number: handler for number in SIGNALS if callable(handler := signal.getsignal(number))
    }

    def later(number: int, frame: FrameType | None) -> None:
        waiting.append((time.monotonic(), number))
        if waiting[-1][0] - waiting[0][0] > AGAIN_S:
            waiting.clear()
            before[signal.Signals(number)](number, frame)

    with _handled(later, list(before)):
        yield
    if waiting:
        signal.raise_signal(waiting[0][1])


@contextlib.contextmanager
def _handled(
    handler: Callable[[int, FrameType | None], None], numbers: list[signal.Signals]
) -> Iterator[None]:
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, handler_before in before.items():
            signal.signal(number, handler_before)


def _ignored(number: signal.Signals) -> bool:
    return signal.getsignal(number) is signal.SIG_IGN
