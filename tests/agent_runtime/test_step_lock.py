"""Only the holder of the floor steps: one at a time, in order, on the thread that heard if nothing
waits before it.
"""

import itertools
import math
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from queue import Empty
from types import FrameType
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent_runtime.io.inbox import Class, Failed, Inbox, OneReaderEvent, OneReaderQueue, StepLock

HEARD = Class.STREAM


class Steps:
    """A floor whose steps write down what was taken on which thread; `then(item)` runs within
    each.
    """

    def __init__(self) -> None:
        self.inbox = Inbox()
        self.done: list[Any] = []
        self.threads: list[int] = []
        self.at = math.inf
        self.then: Callable[[Any], object] = lambda item: None
        self.floor = StepLock(self.inbox, self._take, lambda: self.at)

    def _take(self, item: Any) -> None:
        self.done.append(item)
        self.threads.append(threading.get_ident())
        self.then(item)

    def rest(self) -> list[Any]:
        """Return the contents of the inbox."""
        return list(iter(lambda: self.inbox.get(0.0), None))


@pytest.fixture
def steps() -> Steps:
    """A floor that is open."""
    one = Steps()
    one.floor.open()
    return one


def elsewhere(work: Any) -> int:
    """Run it on a thread of its own to its end; that thread's number."""
    thread = threading.Thread(target=work)
    thread.start()
    thread.join(timeout=10.0)
    assert not thread.is_alive()
    assert thread.ident is not None
    return thread.ident


def test_what_is_heard_while_nothing_waits_is_taken_by_who_heard_it(steps: Steps) -> None:
    """No other thread is needed."""
    hearing = elsewhere(lambda: steps.floor.put(HEARD, 1))
    assert (steps.done, steps.threads) == ([1], [hearing])
    assert steps.inbox.idle
    assert steps.rest() == []


def test_before_it_is_open_and_after_it_is_closed_all_waits_for_the_loop() -> None:
    """An agent that has not started, or ends, steps on its loop thread only."""
    one = Steps()
    one.floor.put(HEARD, "early")
    assert one.rest() == ["early"]
    one.inbox.get(0.0)
    one.floor.open()
    one.floor.close()
    one.floor.put(HEARD, "late")
    assert one.rest() == ["late"]
    assert one.done == []


def test_what_is_heard_during_a_step_waits_its_turn(steps: Steps) -> None:
    """The thread that hears never waits for the step of another."""
    steps.then = lambda item: (
        item == "first" and elsewhere(lambda: steps.floor.put(HEARD, "second"))
    )
    steps.floor.put(HEARD, "first")
    assert steps.done == ["first"]
    assert steps.rest() == ["second"]


def test_nothing_overtakes_what_waits_or_what_the_loop_has_in_hand(steps: Steps) -> None:
    """Between the loop's taking an entry out and its step, the floor is free and the inbox empty:
    still its turn.
    """
    steps.inbox.put(HEARD, 1)
    steps.floor.put(HEARD, 2)
    assert steps.done == [], "1 waits"
    assert steps.inbox.get(0.0) == 1
    assert steps.inbox.get(0.0) == 2
    steps.floor.put(HEARD, 3)
    assert steps.done == [], "2 is in the loop's hand"
    with steps.floor.held():
        steps.floor.step(2)
    assert steps.rest() == [3]
    steps.floor.put(HEARD, 4)
    assert steps.done == [2, 4]


def test_a_signal_in_hand_holds_nobody_up(steps: Steps) -> None:
    """It is not an entry that somebody waits behind, and it takes no lock."""
    steps.inbox.interrupt("stop")
    steps.inbox.put(HEARD, "heard")
    assert [steps.inbox.get(0.0) for _ in range(2)] == ["stop", "heard"]
    for _ in range(3):
        assert steps.inbox.get(0.0) is None
        assert steps.inbox.idle


def test_what_the_own_side_posts_in_a_step_follows_it_at_once_but_not_for_ever(
    steps: Steps,
) -> None:
    """Its words are taken on the same thread; what they lead to waits, so that others have their
    turn.
    """
    steps.then = lambda item: steps.floor.post(item + 1)
    hearing = elsewhere(lambda: steps.floor.put(HEARD, 1))
    assert (steps.done, steps.threads) == ([1, 2], [hearing, hearing])
    assert steps.rest() == [3]


def test_what_the_own_side_posts_on_its_own_thread_waits(steps: Steps) -> None:
    """Such a thread has work of its own, like watching a motion."""
    steps.floor.post("word")
    steps.then = lambda item: elsewhere(lambda: steps.floor.post("another"))
    with steps.floor.held():
        steps.floor.step("heard")
    assert steps.done == ["heard"]
    assert steps.rest() == ["word", "another"]


def test_a_step_that_fails_where_it_was_heard_ends_on_the_loop_thread(steps: Steps) -> None:
    """The loop is told the error, and nobody steps any more meanwhile."""
    error = ValueError("a bug of the agent")

    def fail(item: Any) -> None:
        raise error

    steps.then = fail
    steps.floor.put(HEARD, 1)
    steps.floor.put(HEARD, 2)
    assert steps.done == [1]
    assert steps.rest() == [Failed(error), 2]


def test_the_loop_is_woken_where_a_step_wants_something_sooner(steps: Steps) -> None:
    """Once: an entry without content, so that the loop looks at the time; later wishes need no
    wake.
    """
    steps.at = 20.0
    with steps.floor.held():
        pass
    assert steps.floor.until == 20.0
    steps.floor.put(HEARD, "nothing new")
    assert steps.inbox.idle
    steps.at = 10.0
    steps.floor.put(HEARD, "sooner")
    assert not steps.inbox.idle
    assert steps.inbox.get(0.0) is None
    assert steps.inbox.get(0.0) is None
    assert steps.inbox.idle
    steps.at = 15.0
    steps.floor.put(HEARD, "later")
    assert steps.inbox.idle
    assert steps.floor.until == 10.0


def test_the_loop_has_the_floor_next_when_it_wants_it(steps: Steps) -> None:
    """However fast others hear: else its times would pass, heartbeats and questions to be asked
    again.
    """

    def look() -> None:
        with steps.floor.held():
            steps.done.append("the loop")

    loop = threading.Thread(target=look)

    def then(item: int) -> None:
        if item == 1:
            loop.start()
            end = time.monotonic() + 10.0
            while not steps.floor._wanted and time.monotonic() < end:
                pass

    steps.then = then
    for number in range(1, 1000):
        steps.floor.put(Class.OWN, number)
    loop.join(timeout=10.0)
    assert steps.done == [1, "the loop"], (
        "the rest waits behind 2, which was heard while the loop wanted the floor"
    )
    assert steps.rest() == list(range(2, 1000))


def test_many_threads_that_hear_keep_their_order_and_lose_nothing(steps: Steps) -> None:
    """A loop and four that hear: one step at a time, each one's words in their order, all of them
    taken.
    """
    count, writers = 200, 4
    inside, alone = threading.Semaphore(1), []
    over = threading.Event()

    def then(item: tuple[int, int]) -> None:
        alone.append(inside.acquire(blocking=False))
        inside.release()
        if len(steps.done) == count * writers:
            over.set()

    def hear(writer: int) -> None:
        for number in range(count):
            steps.floor.put(Class.OWN, (writer, number))

    def loop() -> None:
        while not over.is_set():
            item = steps.inbox.get(0.01)
            if item is not None:
                with steps.floor.held():
                    steps.floor.step(item)

    steps.then = then
    threads = [threading.Thread(target=hear, args=(n,)) for n in range(writers)]
    for thread in (threads := [threading.Thread(target=loop), *threads]):
        thread.start()
    for thread in threads:
        thread.join(timeout=30.0)
    assert over.is_set()
    assert all(alone)
    for writer in range(writers):
        assert [number for who, number in steps.done if who == writer] == list(range(count))


# --- Many writers, one reader ---------------------------------------------------------------------


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
