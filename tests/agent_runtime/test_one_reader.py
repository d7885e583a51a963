"""The queue and the event of one reader: nothing lost, nothing out of order, waits end, safe in
signal handlers.
"""

import itertools
import signal
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from queue import Empty
from types import FrameType

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent_runtime.io.inbox import OneReaderEvent, OneReaderQueue

ROUNDS = 50_000  # SimpleQueue of CPython 3.11 hangs in this loop after 0 to 10,026 of them


@pytest.mark.timeout(30)
def test_a_short_wait_ends() -> None:
    """Put, get, and get again with almost no time."""
    queue = OneReaderQueue[int]()
    for number in range(ROUNDS):
        queue.put(number)
        assert queue.get() == number
        with pytest.raises(Empty):
            queue.get(1e-7)


@given(st.lists(st.integers(0, 3), max_size=40))
def test_it_is_a_queue(steps: list[int]) -> None:
    """Against a list: 0 gets, another number puts it."""
    queue, model = OneReaderQueue[int](), []
    for step in steps:
        if step:
            queue.put(step)
            model.append(step)
        elif model:
            assert queue.get(0.0) == model.pop(0)
        else:
            with pytest.raises(Empty):
                queue.get(0.0)
        assert len(queue) == len(model)


@pytest.mark.parametrize("timeout_s", [-1.0, -1e9, 0.0, 1e-9])
def test_a_time_that_is_over_is_no_wait(timeout_s: float) -> None:
    """Nor is a negative one: a deadline that has passed."""
    with pytest.raises(Empty):
        OneReaderQueue[int]().get(timeout_s)


def writing(
    queue: OneReaderQueue[tuple[int, int]], counts: Sequence[int]
) -> list[threading.Thread]:
    """Threads that put their number and each of so many, started."""

    def put(name: int, count: int) -> None:
        for number in range(count):
            queue.put((name, number))

    writers = [threading.Thread(target=put, args=one) for one in enumerate(counts)]
    for writer in writers:
        writer.start()
    return writers


def expect_all(got: list[tuple[int, int]], counts: Sequence[int]) -> None:
    """All that the threads put, each thread's in its order."""
    for name, count in enumerate(counts):
        assert [number for who, number in got if who == name] == list(range(count))


@pytest.mark.parametrize("timeout_s", [None, 20.0])
def test_writers_wake_the_reader(timeout_s: float | None) -> None:
    """All that four threads put arrives, each thread's in its order, whoever switches when."""
    queue, counts = OneReaderQueue[tuple[int, int]](), [5_000] * 4
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        writers = writing(queue, counts)
        got = [queue.get(timeout_s) for _ in range(sum(counts))]
    finally:
        sys.setswitchinterval(before)
    for writer in writers:
        writer.join()
    expect_all(got, counts)
    assert not len(queue)


@given(
    st.lists(st.integers(0, 60), min_size=1, max_size=4),
    st.lists(st.sampled_from([0.0, 1e-7, 1e-4, 20.0]), min_size=1, max_size=6),
)
@settings(max_examples=60)
def test_nothing_is_lost_whatever_threads_put_and_however_long_is_waited(
    puts: list[int], waits: list[float]
) -> None:
    """Each thread puts its numbers; the reader waits by turns for these times, and is told of what
    it did not get.
    """
    queue, got = OneReaderQueue[tuple[int, int]](), list[tuple[int, int]]()
    writers, turns = writing(queue, puts), itertools.cycle(waits)
    while len(got) < sum(puts):
        with suppress(Empty):
            got.append(queue.get(next(turns)))
    for writer in writers:
        writer.join()
    expect_all(got, puts)
    with pytest.raises(Empty):
        queue.get(0.0)


def test_a_signal_handler_puts_amid_put_and_get() -> None:
    """The handler runs in the thread that puts, gets and waits; nothing stands still and nothing is
    lost.
    """
    queue, put = OneReaderQueue[str](), []

    def handler(*_: object) -> None:
        put.append("signal")
        queue.put("signal")

    before = signal.signal(signal.SIGALRM, handler)
    signal.setitimer(signal.ITIMER_REAL, 1e-4, 1e-4)
    heard = 0
    try:
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            queue.put("own")
            while queue.get(5.0) == "signal":  # woken by the handler where nothing else is there
                heard += 1
            if len(queue) == 0:
                assert queue.get(5.0) == "signal"
                heard += 1
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    while len(queue):
        heard += queue.get() == "signal"
    assert heard == len(put) > 100


def lines_of_a_wait(event: OneReaderEvent, interrupted_at: int) -> int:
    """Wait for an event that a signal's handler sets; the signal comes at this line of the wait.
    Return its lines.
    """
    count = 0

    def trace(frame: FrameType, what: str, _: object) -> object:
        nonlocal count
        if what == "line":
            count += 1
            if count == interrupted_at:
                signal.raise_signal(signal.SIGUSR1)
        return trace

    before = signal.signal(signal.SIGUSR1, lambda *_: event.set())
    sys.settrace(trace)
    try:
        event.wait(0.01)
    finally:
        sys.settrace(None)
        signal.signal(signal.SIGUSR1, before)
    return count


@pytest.mark.timeout(20)
def test_a_signal_handler_sets_an_event_at_any_line_of_its_wait() -> None:
    """threading.Event waits for itself for ever at some of them."""
    event = OneReaderEvent()
    lines = lines_of_a_wait(event, 0)
    assert lines > 5
    assert not event.is_set()
    for line in range(1, lines + 1):
        event = OneReaderEvent()
        lines_of_a_wait(event, line)
        assert event.is_set()
        assert event.wait(60.0)
