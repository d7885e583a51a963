"""Attacks by the holder of one key on the router's memory and its places."""

import json
import threading
from collections.abc import Iterator
from typing import Any

import pytest
import zenoh
from key_floods import memory_mb
from secured_fleet import SYSTEM, session
from toy_fleet import Fleet, wait_for

from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.secured import client_tls, rights_of, router_tls
from agent_runtime.io.sessions import LONGEST, MORE_SESSIONS, client_config, router_config
from fipa_codec.communicate import MAX_BYTES

pytestmark = pytest.mark.zenoh
MINE = f"roco/{SYSTEM}/_/state/ta"
DENIED = f"roco/{SYSTEM}/C1/co/ta/coordinate/request"
"""A key that hi, the thief's identity here, may not put."""
LARGE, TIMES = 20_000_000, 5
"""Bytes, more than LONGEST; and how often for each priority."""
CONTAINER_MB = 256
"""The router's in deploy/compose.yaml."""
ALL_PRIORITIES = (
    zenoh.Priority.REAL_TIME, zenoh.Priority.INTERACTIVE_HIGH, zenoh.Priority.INTERACTIVE_LOW,
    zenoh.Priority.DATA_HIGH, zenoh.Priority.DATA, zenoh.Priority.DATA_LOW,
    zenoh.Priority.BACKGROUND,
)  # fmt: skip
BLOCK = zenoh.CongestionControl.BLOCK


class Pair:
    """ta tells the console numbers; `heard` has those that came."""

    def __init__(self, fleet: Fleet) -> None:
        self.heard, self.said = list[int](), 0
        self._speaker, self._listener = session(fleet, "ta"), session(fleet, "console")
        self._declared = self._listener.declare_subscriber(
            MINE, lambda one: self.heard.append(int(bytes(one.payload)))
        )
        wait_for(self._through, "the console hears ta")
        wait_for(lambda: self.heard[-1] == self.said - 1, "the console has heard all")
        self.heard.clear()
        self.said = 0

    def say(self) -> None:
        """The next number."""
        self._speaker.put(MINE, b"%d" % self.said, congestion_control=BLOCK)
        self.said += 1

    def _through(self) -> bool:
        self.say()
        return bool(self.heard)

    def close(self) -> None:
        """End both sessions."""
        self._declared.undeclare()
        for one in (self._speaker, self._listener):
            one.close()  # type: ignore[no-untyped-call]


@pytest.fixture
def pair(router: Fleet) -> Iterator[Pair]:
    """An agent and who listens to it."""
    made = Pair(router)
    yield made
    made.close()


@pytest.fixture
def thief(router: Fleet) -> Iterator[zenoh.Session]:
    """A session with hi's key."""
    with session(router, "hi") as opened:
        yield opened


def throw(thief: zenoh.Session, priority: Any) -> None:
    """Large messages on a key without the right, which Zenoh sends in pieces between others'."""
    for _ in range(TIMES):
        thief.put(DENIED, bytes(LARGE), priority=priority, congestion_control=BLOCK)


@pytest.mark.parametrize(
    "priorities", [ALL_PRIORITIES[4:5], ALL_PRIORITIES], ids=["one", "all at once"]
)
def test_large_messages_take_no_memory_and_cut_nobody_off(
    router: Fleet, pair: Pair, thief: zenoh.Session, priorities: tuple[Any, ...]
) -> None:
    """The router drops them, keeps at most LONGEST of each priority meanwhile, and what others say
    arrives in order.

    Throwing at higher priorities delays others' words but does not stop them: some arrive before it
    ends. How many depends on the machine's load.
    """
    pid = router.processes["router"].pid
    before = memory_mb(pid, "VmHWM")
    throwing = [threading.Thread(target=throw, args=(thief, priority)) for priority in priorities]
    for one in throwing:
        one.start()
    while any(one.is_alive() for one in throwing):
        pair.say()
        wait_for(lambda: len(pair.heard) == pair.said, "a word said meanwhile arrives")
    for one in throwing:
        one.join()
    assert pair.heard == list(range(pair.said))
    assert pair.said > 1
    assert not thief.is_closed()
    assert router.processes["router"].poll() is None
    kept = 2 * len(priorities) * LONGEST / 1e6  # twice: it grows by doubling
    assert memory_mb(pid, "VmHWM") < min(before + 10 + kept, CONTAINER_MB)


def test_whoever_takes_many_places_takes_no_more_than_there_are(router: Fleet, pair: Pair) -> None:
    """The next is refused until one is free; sessions that are open stay and go on."""
    keys = router.run / KEYS_FOLDER
    most = len(rights_of(keys, SYSTEM).access_control["subjects"]) + MORE_SESSIONS
    taken = [session(router, "hi") for _ in range(most - 2)]  # the pair has two
    try:
        with pytest.raises(zenoh.ZError):
            session(router, "hi")
        pair.say()
        wait_for(lambda: pair.heard == [0], "the pair talks")
        taken.pop().close()  # type: ignore[no-untyped-call]
        wait_for(lambda: comes_in(router), "who comes next is let in")
    finally:
        for one in taken:
            one.close()  # type: ignore[no-untyped-call]


def comes_in(router: Fleet) -> bool:
    """Whether the router has a place."""
    try:
        session(router, "hi").close()  # type: ignore[no-untyped-call]
    except zenoh.ZError:
        return False
    return True


def test_both_ends_put_no_more_together_than_they_must(router: Fleet) -> None:
    """The longest communicate fits, with some room; without rights the router does not know who
    there is.
    """
    keys = router.run / KEYS_FOLDER
    rights = rights_of(keys, SYSTEM).access_control
    at_router = router_config(router.endpoint, router_tls(keys), rights)
    for config in (at_router, client_config(router.endpoint, client_tls(keys, "co"))):
        longest = json.loads(config.get_json("transport/link/rx/max_message_size"))
        assert MAX_BYTES < longest == 8_000_000
    places = json.loads(at_router.get_json("transport/unicast/max_sessions"))
    assert len(rights["subjects"]) < places < 64
