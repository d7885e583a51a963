"""Attacks without a key, from a place in the network: connections that never become a session, many
a second.
"""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, suppress
from pathlib import Path

import msgspec
import pytest
from key_floods import repeated
from toy_fleet import wait_for

from agent_runtime.io.heartbeat import Heartbeat
from agent_runtime.io.reaching import free_port
from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.secured import client_tls
from agent_runtime.io.sessions import open_client
from console.runs import folders

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(120)]
EVERY_S = 0.01
"""20 a second are enough to lock a listener (measured)."""
PATIENCE_S = 3.0
"""A session takes some milliseconds; at a flooded listener none is opened in it (measured)."""
NETWORK = "127.0.0.2"
"""Stands for the address that this host has in a network: the supervisor takes it for one."""


class Host:
    """A supervisor with a router that other hosts reach, and two agents that meet there."""

    def __init__(self, run: Path) -> None:
        self.run, self.port = run, free_port()
        self.open_address = f"tls/{NETWORK}:{self.port}"
        command = [sys.executable, "-m", "operate.supervisor", "--run-dir", str(run), "--no-latest"]
        command += ["--connect", self.open_address, "--only", "router,co,hi"]
        with (run / "supervisor.log").open("ab") as log:
            self._process = subprocess.Popen(command, stdout=log, stderr=log)

    def beat(self, name: str) -> Heartbeat:
        """The agent's last heartbeat."""
        file = self.run / f"{name}.heartbeat.json"
        return msgspec.json.decode(file.read_bytes(), type=Heartbeat)

    def in_reach(self) -> bool:
        """Whether both agents live and reach each other."""
        with suppress(OSError):
            return "hi" in self.beat("co").peers and "co" in self.beat("hi").peers
        return False

    def own_address(self) -> str:
        """Return the address at which the agents meet."""
        told = folders.fleet(self.run)
        assert told is not None
        return told.connect

    def comes_in(self, address: str) -> bool:
        """Whether a session of the console is opened there in time."""
        until = time.monotonic() + PATIENCE_S
        tls = client_tls(self.run / KEYS_FOLDER, "console")
        session = open_client(address, lambda: time.monotonic() > until, tls=tls)
        if session is not None:
            session.close()  # type: ignore[no-untyped-call]
        return session is not None

    def stormed(self) -> AbstractContextManager[None]:
        """Bare connections to the open port, until the end of the block."""

        def connect(_: int) -> None:
            time.sleep(EVERY_S)
            with suppress(OSError), socket.create_connection((NETWORK, self.port), 1.0):
                pass

        return repeated(connect, 0, 200)

    def end(self) -> None:
        """Stop it in order."""
        self._process.send_signal(signal.SIGTERM)
        self._process.wait(60.0)


@pytest.fixture
def host(tmp_path: Path) -> Iterator[Host]:
    """The agents live and reach each other."""
    made = Host(tmp_path)
    try:
        wait_for(made.in_reach, "co and hi reach each other", 60.0)
        yield made
    finally:
        made.end()


def test_agents_of_the_routers_host_come_back_amid_a_storm(host: Host) -> None:
    """At the open port nobody gets in. An agent that is killed is back at once, by the listener on
    loopback.
    """
    assert host.comes_in(host.open_address)
    before = host.beat("co")
    with host.stormed():
        assert not host.comes_in(host.open_address), "it shows nothing: nobody is locked out"
        assert host.comes_in(host.own_address())
        os.kill(before.pid, signal.SIGKILL)
        lives = lambda: host.beat("co").incarnation  # noqa: E731
        wait_for(lambda: lives() > before.incarnation and host.in_reach(), "co is back")
        wait_for(lambda: host.beat("hi").peers.get("co") == lives(), "hi reaches the new co")
        assert not host.comes_in(host.open_address), "the storm was over before"
