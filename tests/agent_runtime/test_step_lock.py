"""Only the holder of the floor steps: one at a time, in order, on the thread that heard if nothing
waits before it.
"""

import math
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from agent_runtime.io.inbox import Class, Failed, Inbox, StepLock

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
