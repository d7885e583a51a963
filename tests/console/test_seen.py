"""Findings of a look at a process: from /proc, from heartbeats, from two looks."""

import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from console.fleet import checkup, process_status
from console.fleet.checkup import Level
from console.fleet.compose import SHEET, Sheet, sheet
from console.fleet.local import Local
from console.fleet.process_status import Beat, Look, Seen
from operate import proc
from operate.fleet_file import Fleet, ProcessState, ProcessStatus
from operate.proc import Used

pytestmark = pytest.mark.process


@pytest.fixture
def idle(called: Callable[..., int]) -> int:
    """The pid of a process that does nothing and looks like one of ours."""
    return called("services.pretended")


@pytest.fixture
def run(tmp_path: Path, idle: int) -> Path:
    """A run folder of that process, with a heartbeat as an agent writes it."""
    status = ProcessStatus("km", ProcessState.READY, idle, module="services.pretended")
    fleet = Fleet("test", "", idle, 0.0, (status,))
    (tmp_path / "fleet.json").write_bytes(msgspec.json.encode(fleet))
    beat = {"agent": "km", "pid": idle, "incarnation": 3, "step": 5, "state": "idle", "up": True}
    beat |= {"peers": {"pl": 1}, "unreceipted": {"pl": 2}, "due": {"ta": 1}, "at": 0.0}
    (tmp_path / "km.heartbeat.json").write_bytes(msgspec.json.encode(beat))
    (tmp_path / "stop").write_bytes(b"\x01")
    return tmp_path


def test_a_process_is_seen_with_its_heartbeat_and_what_it_uses(run: Path, idle: int) -> None:
    """As /proc and the heartbeat's file say."""
    (row,) = process_status.rows(Local(run).look(), Local(run).look())
    assert (row.name, row.state, row.pid) == ("km", "idle", idle)
    assert (row.incarnation, row.waiting, row.trouble) == (3, 3, "")
    assert 1 << 20 < (row.memory or 0) < 1 << 28
    assert row.heartbeat_s is not None
    assert row.heartbeat_s < 30
    assert Local(run).look().stop_held


def test_a_process_stopped_by_a_signal_is_called_frozen(run: Path, idle: int) -> None:
    """Its heartbeat is young still, and the pid is there."""
    os.kill(idle, signal.SIGSTOP)
    while not (found := process_status.trouble(Local(run).look().seen[0])):
        time.sleep(0.01)
    assert found == "frozen by a signal"


def test_an_old_heartbeat_is_one_of_a_process_that_hangs(run: Path) -> None:
    """Also of one that is there."""
    os.utime(run / "km.heartbeat.json", (0, time.time() - 60))
    assert re.search(
        "hangs: last heartbeat 6[0-9] s ago", process_status.trouble(Local(run).look().seen[0])
    )


def test_a_child_counts_for_its_parent() -> None:
    """Lines as Linux writes them, with a name that has a parenthesis."""
    rest = "0 0 0 0 0 0 0 0 0 {ticks} 0 0 0 20 0 1 0 0 0 {pages} 0"
    lines = [
        f"7 (a) b) S 1 {rest.format(ticks=10, pages=3)}",
        f"8 (c) S 7 {rest.format(ticks=5, pages=2)}",
        f"9 (d) T 1 {rest.format(ticks=1, pages=1)}",
        "10 (cut) S",
        f"11 (e) Z 1 {rest.format(ticks=1, pages=0)}",
    ]
    found = proc.stats(lines)
    assert sorted(found) == [7, 8, 9, 11]
    assert proc.used(7, found) == Used(15 * proc.TICK_S, 5 * proc.PAGE, False)
    assert proc.used(9, found) == Used(proc.TICK_S, proc.PAGE, True)
    assert proc.used(10, found) is None
    assert proc.used(11, found) is None, "it has ended: no signal reaches it"


def look(pid: int, cpu_s: float, at: float) -> Look:
    """A look at one process."""
    status = ProcessStatus("ta", ProcessState.READY, pid)
    return Look(None, (Seen(status, Beat(pid=pid), 0.1, Used(cpu_s, 1, False)),), False, at)


def test_the_share_of_a_processor_is_between_two_looks_at_the_same_process() -> None:
    """Half a second of work in two seconds; another process begins again."""
    assert process_status.rows(look(5, 1.0, 10.0), look(5, 1.5, 12.0))[0].cpu == pytest.approx(25.0)
    assert process_status.rows(look(5, 1.0, 10.0), look(6, 1.5, 12.0))[0].cpu is None


def looked_at(run: Path, path: str) -> Sheet:
    """What the script says of a run folder, run by a shell here, as it is in a container."""
    own = {"PATH": path, "ROCO_RUN_DIR": str(run)}
    return sheet(subprocess.check_output(["sh", "-c", SHEET], env=own, timeout=20))


def test_a_sheet_of_a_container_says_what_its_files_say(run: Path, idle: int) -> None:
    """The script is run by a shell here, as it is in a container."""
    (run / "km.ready").write_text("1")
    read = looked_at(run, os.environ["PATH"])
    beat, age = read.beat("km")
    assert beat is not None
    assert (beat.incarnation, beat.peers) == (3, {"pl": 1})
    assert age is not None
    assert age < 30
    assert read.stop_held
    assert read.fleet is not None
    assert read.fleet.processes[0].pid == idle
    assert read.pid("km") == idle
    assert proc.used(idle, read.stats) is not None
    assert read.ready("km")
    assert not read.ready("pl")
    assert read.beat("pl") == (None, None)


def test_a_file_that_goes_while_it_is_looked_at_is_not_there(run: Path, tmp_path: Path) -> None:
    """A process that starts removes what its last life said."""
    real, pretended = shutil.which("stat"), tmp_path / "bin" / "stat"
    pretended.parent.mkdir()
    pretended.write_text(f'#!/bin/sh\ncase "$*" in *km.ready) exit 1 ;; esac\nexec {real} "$@"\n')
    pretended.chmod(0o755)
    (run / "km.ready").write_text("1")
    read = looked_at(run, f"{pretended.parent}:{os.environ['PATH']}")
    assert not read.ready("km")
    assert read.beat("km")[0] is not None


@pytest.mark.parametrize("data", [b"", b"nothing\n", b"@@ now 1.0\n@@ stat 0\n"])
def test_an_empty_sheet_says_nothing(data: bytes) -> None:
    """As of a container that ended meanwhile."""
    read = sheet(data)
    assert read.fleet is None
    assert not read.ready("km")
    assert read.pid("km") == 0


@pytest.mark.parametrize(
    ("used", "age_s", "words"),
    [
        (Used(0.0, 1, True), 0.1, "frozen by a signal"),
        (Used(0.0, 1, False), 290.0, "hangs: last heartbeat 290 s ago"),
    ],
)
def test_who_is_stuck_before_it_is_ready_is_not_waited_for(
    used: Used, age_s: float, words: str
) -> None:
    """Doctor does not say "wait" of it, nor of one that is optional."""
    status = ProcessStatus("km", ProcessState.STARTING, 7, optional=True)
    seen = (Seen(status, Beat(pid=7), age_s, used),)
    (check,) = checkup.processes(Local(Path()), Look(None, seen, False, 0.0))
    assert (check.level, check.what) == (Level.WRONG, words)
    assert "roco agent restart km" in check.remedy


def test_the_heartbeat_of_an_earlier_process_says_nothing_of_this_one() -> None:
    """A container's volume keeps it until the new process writes its own."""
    status = ProcessStatus("km", ProcessState.STARTING, 7)
    assert process_status.stuck(Seen(status, Beat(pid=6), 60.0, Used(0.0, 1, False))) == ""


def test_nobody_keeps_a_fleet_whose_supervisor_is_dead_or_stuck() -> None:
    """Of a fleet of which nothing runs that is no matter."""
    keeper = ProcessStatus("supervisor", ProcessState.READY, 5)
    runs = (ProcessStatus("km", ProcessState.READY, 7),)

    def unkept(supervisor: int, processes: tuple[ProcessStatus, ...], age_s: float) -> str:
        return process_status.unkept(
            Fleet("s", "", supervisor, 0.0, processes), Seen(keeper, Beat(pid=5), age_s)
        )

    assert unkept(5, runs, 0.5) == ""
    assert unkept(0, runs, 0.5) == process_status.UNSUPERVISED
    assert (
        unkept(5, runs, 60.0) == "the supervisor (pid 5) is stuck, hangs: last heartbeat 60 s ago"
    )
    assert unkept(0, (ProcessStatus("km", ProcessState.STOPPED),), 0.5) == ""
