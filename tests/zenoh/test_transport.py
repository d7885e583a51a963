"""Effects of one session on others through the router: holding them up, or making the router keep
what it sends.
"""

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh
from toy_fleet import Fleet, wait_for

from agent_runtime.io.inbox import Inbox
from agent_runtime.io.sessions import (
    LONGEST,
    TooLongError,
    client_config,
    free_endpoint,
    open_links,
    router_config,
)
from agent_runtime.io.zenoh_wire import ZenohWire
from companion.design import wiring
from fipa_codec.communicate import MAX_BYTES

pytestmark = pytest.mark.zenoh
ADDRESS = "tcp/127.0.0.1:7447"
LARGE, MESSAGES = 852_000, 100
SLOW = """
import sys
import threading
from pathlib import Path

import zenoh

from agent_runtime.io.sessions import client_config

with zenoh.open(client_config(sys.argv[1])) as session:
    declared = session.declare_subscriber("**", lambda sample: None)
    Path(sys.argv[2]).touch()
    threading.Event().wait()
"""
"""Hears everything; the test stops it again and again."""
STOPPED_S, RUNNING_S = 0.45, 0.003
"""The slow one is never stopped as long as a session was once waited for at both ends, 0.5 s, and
reads little.
"""


def setting(config: zenoh.Config, name: str) -> int:
    """A number of `transport/link`."""
    return int(json.loads(config.get_json(f"transport/link/{name}")))


def test_the_router_loses_its_patience_well_before_a_client() -> None:
    """Else the sender's session is closed, which did nothing wrong."""
    router, client = router_config(ADDRESS), client_config(ADDRESS)
    name = "tx/queue/congestion_control/block/wait_before_close"
    assert 10 * setting(router, name) <= setting(client, name)


@pytest.fixture
def slow(router: Fleet) -> Iterator[None]:
    """A process that hears everything and hardly takes anything."""
    there, over = router.run / "slow.ready", threading.Event()
    process = subprocess.Popen([sys.executable, "-c", SLOW, router.endpoint, str(there)])

    def hold_up() -> None:
        while not over.is_set():
            process.send_signal(signal.SIGSTOP)
            over.wait(STOPPED_S)
            process.send_signal(signal.SIGCONT)
            over.wait(RUNNING_S)

    holding = threading.Thread(target=hold_up)
    try:
        wait_for(there.exists, "it subscribes")
        holding.start()
        yield
    finally:
        over.set()
        if holding.ident is not None:
            holding.join()
        process.kill()
        process.wait()


class Listened:
    """A publisher and who hears it, over the router. `heard`: what came; `ended`: each time that
    the sender lost the router.
    """

    def __init__(self, endpoint: str) -> None:
        self.heard, self.ended = list[bytes](), list[object]()
        self._sessions = [zenoh.open(client_config(endpoint)) for _ in range(2)]
        sender, receiver = self._sessions
        self._declared = [
            receiver.declare_subscriber("x", lambda one: self.heard.append(bytes(one.payload))),
            sender.info.declare_transport_events_listener(self._noted),
        ]
        block = zenoh.CongestionControl.BLOCK
        self.publisher = sender.declare_publisher("x", congestion_control=block)
        # else the first word is lost
        wait_for(lambda: self.publisher.matching_status.matching, "the receiver is known")

    def _noted(self, event: Any) -> None:
        if event.kind == zenoh.SampleKind.DELETE:
            self.ended.append(event)

    def close(self) -> None:
        """End both sessions."""
        for one in self._declared:
            one.undeclare()
        for session in self._sessions:
            session.close()  # type: ignore[no-untyped-call]


@pytest.fixture
def listened(router: Fleet) -> Iterator[Listened]:
    """Two sessions."""
    made = Listened(router.endpoint)
    yield made
    made.close()


@pytest.mark.usefixtures("slow")
def test_one_that_is_slow_costs_the_others_no_message(listened: Listened) -> None:
    """A healthy receiver hears all large messages in order, and the sender's session stays."""
    for number in range(MESSAGES):
        listened.publisher.put(b"%04d" % number + bytes(LARGE))
    wait_for(lambda: len(listened.heard) == MESSAGES or listened.ended, "all arrive")
    assert not listened.ended
    assert [int(one[:4]) for one in listened.heard] == list(range(MESSAGES))


def peak_mb(pid: int) -> float:
    """Most memory of a process so far."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


def test_a_message_that_is_too_long_is_dropped_alone(router: Fleet, listened: Listened) -> None:
    """The router keeps little of it, the session stays, and the next message passes."""
    sizes, put = lambda: list(map(len, listened.heard)), listened.publisher.put
    put(bytes(MAX_BYTES))
    wait_for(lambda: sizes() == [MAX_BYTES], "the longest communicate passes")
    before = peak_mb(router.processes["router"].pid)
    for size in (LONGEST + 1, 12 * LONGEST):
        put(bytes(size))
        put(b"next")
    wait_for(lambda: sizes() == [MAX_BYTES, 4, 4], "the short ones pass, the long ones do not")
    assert peak_mb(router.processes["router"].pid) < before + 4 * LONGEST / 1e6
    assert not listened.ended


def test_what_is_published_is_not_longer_than_the_router_takes(router: Fleet) -> None:
    """It would be dropped on the way, and nobody told."""
    with zenoh.open(client_config(router.endpoint)) as session:
        wire = ZenohWire(open_links(free_endpoint(), ()), wiring("hi", "roco"), 1, Inbox())
        wire.join(session)
        wire.publish("state", bytes(MAX_BYTES))
        said = (
            f"_/state/hi has {MAX_BYTES + 1} bytes, at most {MAX_BYTES} are put: .* put it in parts"
        )
        with pytest.raises(TooLongError, match=said):
            wire.publish("state", bytes(MAX_BYTES + 1))
        wire.close()
