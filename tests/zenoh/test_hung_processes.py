"""Processes that hang, under a real supervisor: each is killed and started again, whatever it was
at.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from toy_fleet import wait_for

from operate.cli.runs import folders
from operate.fleet_file import ProcessState, ProcessStatus
from operate.supervisor import core, folder

pytestmark = [pytest.mark.zenoh, pytest.mark.long, pytest.mark.process, pytest.mark.timeout(400)]

PARTS = ("router", "monitor", "loop", "km")
WITHIN_S = core.BORN_WITHIN_S + 90.0  # the longest patience, and a start on a busy machine


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Path]:
    """A run folder with a supervisor of four processes, of which km never gets ready: its peers are
    not there.
    """
    place = tmp_path / "runs" / "hung"
    command = [
        sys.executable,
        "-m",
        "services.supervisor",
        "--run-dir",
        str(place),
        "--speed",
        "max",
    ]
    with subprocess.Popen([*command, "--only", ",".join(PARTS)]) as supervisor:
        yield place
        supervisor.terminate()
        assert supervisor.wait(150.0) == 0


def status(run: Path, name: str) -> ProcessStatus | None:
    """A process as the supervisor tells of it."""
    told = folders.fleet(run)
    return next((one for one in told.processes if one.name == name), None) if told else None


def freeze(run: Path, name: str) -> float:
    """SIGSTOP; when."""
    os.kill(int(folder.pid_file(run, name).read_text()), signal.SIGSTOP)
    return time.monotonic()


def test_each_that_hangs_is_killed_and_started_again(run: Path) -> None:
    """The loop before its first heartbeat, km before it is ready, router and monitor after; all at
    once.
    """

    def so(name: str, condition: Callable[[ProcessStatus], bool]) -> Callable[[], bool]:
        return lambda: (one := status(run, name)) is not None and condition(one)

    wait_for(folder.pid_file(run, "loop").exists, "the loop was started", WITHIN_S)
    freeze(run, "loop")
    for name in ("router", "monitor"):
        wait_for(
            so(name, lambda one: one.state is ProcessState.READY), f"{name} is ready", WITHIN_S
        )
    wait_for(lambda: folder.beat(run, "km"), "km beats", WITHIN_S)
    for name in ("km", "monitor", "router"):
        freeze(run, name)
    for name in ("km", "router", "monitor", "loop"):
        wait_for(so(name, lambda one: one.restarts == 1), f"{name} was started again", WITHIN_S)
    for name in ("router", "monitor", "loop"):
        wait_for(
            so(name, lambda one: one.state is ProcessState.READY),
            f"{name} is ready again",
            WITHIN_S,
        )
    for name in PARTS:
        assert so(name, lambda one: one.restarts == 1)(), folders.fleet(run)
