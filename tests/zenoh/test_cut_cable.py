"""A cable is pulled under a busy sender: it learns within the lease that its session is lost, not
when it is back.

Over TLS, a close waits for a write that is stuck in the socket, unless the socket's buffer has a
size of its own.
"""

import datetime as dt
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import IO

import pytest

from agent_runtime.io import issuing
from agent_runtime.io.secured import Rights
from agent_runtime.io.sessions import LEASE_MS

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from namespaces import CannotError, Host, two_hosts  # noqa: E402  (after the path is set)

pytestmark = [pytest.mark.zenoh, pytest.mark.process]

WEEK = dt.timedelta(days=7)
LOST_WITHIN_S = 2.0 * LEASE_MS / 1000.0
"""The lease runs from the last sign of the other end; with a large message on its way 2.6 s were
measured.
"""
ROUTER = """
import sys, threading
from pathlib import Path
from agent_runtime.io.secured import router_tls
from agent_runtime.io.sessions import open_router
session = open_router(f"tls/{sys.argv[2]}:7447", router_tls(Path(sys.argv[1])))
print("listens", flush=True)
threading.Event().wait()
"""
SENDER = """
import sys, threading, time
from pathlib import Path
from agent_runtime.io.secured import client_tls
from agent_runtime.io.sessions import open_client
import zenoh
keys = client_tls(Path(sys.argv[1]), "co")
session = open_client(f"tls/{sys.argv[2]}:7447", lambda: False, tls=keys)
def send():
    while True:
        data, block = bytes(int(sys.argv[3])), zenoh.CongestionControl.BLOCK
        session.put("roco/test/busy", data, congestion_control=block)
        time.sleep(1.0 / float(sys.argv[4]))
threading.Thread(target=send, daemon=True).start()
there = None
while True:
    if bool(session.info.routers_zid()) != there:
        there = not there
        print("there" if there else "lost", time.time(), flush=True)
    time.sleep(0.02)
"""


def can() -> bool:
    """Whether namespaces can be made here: root alone is not enough in some containers."""
    with suppress(CannotError), two_hosts():
        return True
    return False


@pytest.fixture
def hosts() -> Iterator[tuple[Host, Host]]:
    """The desk and the robot, joined by a cable."""
    if os.geteuid() != 0 or not can():
        pytest.skip(
            "needs network namespaces (as root, with iproute2, in a container with CAP_SYS_ADMIN)"
        )
    with two_hosts() as pair:
        yield pair


@pytest.mark.parametrize(("size", "rate"), [(654, 200), (98_000, 50)])
def test_a_busy_sender_learns_of_a_cut_while_the_cable_is_out(
    hosts: tuple[Host, Host], tmp_path: Path, size: int, rate: int
) -> None:
    """And has its router again when the cable is back. Without so_sndbuf it learnt so when the
    cable was back.
    """
    desk, robot = hosts
    now = dt.datetime.now(dt.UTC)
    issuer = issuing.authority("authority", now - WEEK, now + WEEK)
    issuing.publish(tmp_path, issuer, Rights((), {}))
    issuing.certify(tmp_path, issuer, "router", now, now + WEEK, (robot.address,))
    issuing.certify(tmp_path, issuer, "co", now, now + WEEK)
    with ExitStack() as ending:
        router = started(ending, robot, ROUTER, str(tmp_path), robot.address)
        assert router.readline() == "listens\n"
        sender = started(ending, desk, SENDER, str(tmp_path), robot.address, str(size), str(rate))
        assert sender.readline().startswith("there")
        cut = time.time()
        robot.cable(plugged=False)
        told, at = sender.readline().split()
        assert told == "lost"
        assert float(at) - cut < LOST_WITHIN_S
        robot.cable(plugged=True)
        assert sender.readline().startswith("there")


def started(ending: ExitStack, where: Host, program: str, *words: str) -> IO[str]:
    """Start a program on a host, killed at the end, and return its lines."""
    command = where.inside(sys.executable, "-c", program, *words)
    process = ending.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
    ending.callback(process.kill)
    assert process.stdout is not None
    return process.stdout
