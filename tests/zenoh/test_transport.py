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
from companion.binding import wiring
from fipa_codec.communicate import MAX_BYTES

pytestmark = pytest.mark.zenoh
ADDRESS = "tcp/127.0.0.1:7447"
LARGE, MESSAGES = 852_000, 100
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
def router(tmp_path: Path) -> Iterator[Fleet]:
    """A router in a process of its own."""
    fleet = Fleet(tmp_path)
    fleet.start("router")
    fleet.ready("router")
    yield fleet
    fleet.kill("router")


@pytest.fixture
def slow(router: Fleet) -> Iterator[int]:
    """A process that hears everything and hardly takes anything; its pid."""
    there, over = router.run / "slow.ready", threading.Event()
    command = [
        sys.executable,
        str(Path(__file__).with_name("slow_process.py")),
        router.endpoint,
        str(there),
    ]
    process = subprocess.Popen(command)

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
        yield process.pid
    finally:
        over.set()
        if holding.ident is not None:
            holding.join()
        process.kill()
        process.wait()


@pytest.mark.usefixtures("slow")
def test_one_that_is_slow_costs_the_others_no_message(router: Fleet) -> None:
    """A healthy receiver hears all large messages in order, and the sender's session stays."""
    heard, ended = list[int](), list[object]()
    with (
        zenoh.open(client_config(router.endpoint)) as sender,
        zenoh.open(client_config(router.endpoint)) as receiver,
    ):
        declared = receiver.declare_subscriber(
            "x", lambda one: heard.append(int(bytes(one.payload)[:4]))
        )
        listening = closings(sender, ended)
        publisher = known(sender)
        for number in range(MESSAGES):
            publisher.put(b"%04d" % number + bytes(LARGE))
        wait_for(lambda: len(heard) == MESSAGES or ended, "all arrive")
        assert not ended
        assert heard == list(range(MESSAGES))
        for one in (declared, listening):
            one.undeclare()


def closings(session: zenoh.Session, into: list[object]) -> Any:
    """Note each time that a session loses the router."""
    return session.info.declare_transport_events_listener(
        lambda event: into.append(event) if event.kind == zenoh.SampleKind.DELETE else None
    )


def known(sender: zenoh.Session) -> zenoh.Publisher:
    """A publisher whose receiver is known, so that the first word is not lost."""
    publisher = sender.declare_publisher("x", congestion_control=zenoh.CongestionControl.BLOCK)
    wait_for(lambda: publisher.matching_status.matching, "the receiver is known")
    return publisher


def peak_mb(pid: int) -> float:
    """Most memory of a process so far."""
    line = next(
        line
        for line in Path(f"/proc/{pid}/status").read_text().splitlines()
        if line.startswith("VmHWM")
    )
    return int(line.split()[1]) / 1024


def test_a_message_that_is_too_long_is_dropped_alone(router: Fleet) -> None:
    """The router keeps little of it, the session stays, and the next message passes."""
    heard, ended = list[int](), list[object]()
    with (
        zenoh.open(client_config(router.endpoint)) as sender,
        zenoh.open(client_config(router.endpoint)) as receiver,
    ):
        declared = receiver.declare_subscriber("x", lambda one: heard.append(len(one.payload)))
        listening = closings(sender, ended)
        publisher = known(sender)
        publisher.put(bytes(MAX_BYTES))
        wait_for(lambda: heard == [MAX_BYTES], "the longest communicate passes")
        before = peak_mb(router.processes["router"].pid)
        for size in (LONGEST + 1, 12 * LONGEST):
            publisher.put(bytes(size))
            publisher.put(b"next")
        wait_for(lambda: heard == [MAX_BYTES, 4, 4], "the short ones pass, the long ones do not")
        assert peak_mb(router.processes["router"].pid) < before + 4 * LONGEST / 1e6
        assert not ended
        for one in (declared, listening):
            one.undeclare()


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
