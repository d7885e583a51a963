"""`roco down` on a fleet whose supervisor has died: in order, as the supervisor would have ended
it.
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import msgspec
import pytest

from console.fleet import starting
from operate.file_names import FLEET_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus

pytestmark = pytest.mark.process

NAMES = ("router", "monitor", "ta", "co")
SERVES = """
import signal, sys, time
from pathlib import Path
name, run = sys.argv[1], Path(sys.argv[2])
def end(*_):
    if name == "monitor":
        time.sleep(3.0)
    with (run / "ended").open("a") as file:
        file.write(name + "\\n")
    sys.exit()
signal.signal(signal.SIGTERM, end)
(run / (name + ".ready")).touch()
signal.pause()
"""
"""A process that notes its end. The monitor's takes 3 s: its report."""


@pytest.fixture
def left(tmp_path: Path) -> Iterator[Path]:
    """The run folder of such processes, with a supervisor that is gone."""
    with ExitStack() as stack:
        told = []
        for name in NAMES:
            command = [sys.executable, "-c", SERVES, name, str(tmp_path), f"toys.{name}"]
            process = stack.enter_context(subprocess.Popen(command))
            stack.callback(process.kill)
            (tmp_path / f"{name}.pid").write_text(str(process.pid))
            told.append(ProcessStatus(name, ProcessState.READY, process.pid, module=f"toys.{name}"))
        until = time.monotonic() + 20.0
        while len(list(tmp_path.glob("*.ready"))) < len(NAMES):
            assert time.monotonic() < until
            os.sched_yield()
        fleet = Fleet("test", "", 0, 0.0, tuple(told))
        (tmp_path / FLEET_FILE).write_bytes(msgspec.json.encode(fleet))
        yield tmp_path


def test_the_monitor_ends_after_the_others_and_has_its_time(
    left: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is not killed amid its report, as others are after LEFT_S; the router ends last."""
    monkeypatch.setattr(starting, "LEFT_S", 2.0)
    assert starting.down(left) == NAMES
    ended = (left / "ended").read_text().split()
    assert (sorted(ended[:2]), ended[2:]) == (["co", "ta"], ["monitor", "router"])
