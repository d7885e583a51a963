"""A fleet is its living processes: found by their variables, and reached where the run folder is
gone.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from agent_runtime.io.fleet_processes import deleted_files, set_stop, started_in
from agent_runtime.io.run_files import FLEET_VARIABLE, RUN_FOLDER_VARIABLE, STOP_FILE, STOP_HELD

pytestmark = pytest.mark.process
LOOP = """
import mmap, os, sys, time
file = os.open(sys.argv[1], os.O_RDWR | os.O_CREAT, 0o600)
os.pwrite(file, b"\\0", 0)
byte = mmap.mmap(file, 1)
print("mapped", flush=True)
while byte[:1] != b"\\1":
    time.sleep(0.001)
print("held", flush=True)
while byte[:1] != b"\\0":
    time.sleep(0.001)
print("released", flush=True)
"""
"""As the control loop does: it has the stop flag mapped."""
Loops = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run folder."""
    folder = tmp_path / "run"
    folder.mkdir()
    return folder


@pytest.fixture
def loop() -> Iterator[Loops]:
    """Starts a process with the stop flag of a run mapped, of a fleet or of none."""
    started: list[subprocess.Popen[str]] = []

    def begin(run: Path, fleet: str = "f1") -> "subprocess.Popen[str]":
        variables = os.environ | {RUN_FOLDER_VARIABLE: str(run), FLEET_VARIABLE: fleet}
        command = [sys.executable, "-P", "-c", LOOP, str(run / STOP_FILE)]
        started.append(subprocess.Popen(command, env=variables, stdout=subprocess.PIPE, text=True))
        assert line(started[-1]) == "mapped"
        return started[-1]

    yield begin
    for process in started:
        process.kill()
        process.communicate()


def line(process: "subprocess.Popen[str]") -> str:
    """The next line of a process; pytest's time-out ends a wait for ever."""
    assert process.stdout is not None
    return process.stdout.readline().strip()


@pytest.mark.parametrize("gone", [False, True])
def test_a_stop_reaches_a_loop_whose_folder_is_gone(run: Path, loop: Loops, gone: bool) -> None:
    """So does the release; in a folder that was made again the flag tells the same."""
    process = loop(run)
    if gone:
        shutil.rmtree(run)
        run.mkdir()
    set_stop(run, held=True)
    assert line(process) == "held"
    assert (run / STOP_FILE).read_bytes() == STOP_HELD
    set_stop(run, held=False)
    assert line(process) == "released"


def test_a_stop_without_any_folder_is_no_error_if_a_loop_hears_it(run: Path, loop: Loops) -> None:
    """Without a loop it is one."""
    process = loop(run)
    shutil.rmtree(run)
    set_stop(run, held=True)
    assert line(process) == "held"
    process.kill()
    process.wait()
    with pytest.raises(FileNotFoundError):
        set_stop(run, held=True)


def test_only_processes_of_the_fleet_are_meant(run: Path, loop: Loops, tmp_path: Path) -> None:
    """Neither a shell in which the run folder is set, nor what runs for another folder."""
    mine, shell = loop(run), loop(run, fleet="")
    (tmp_path / "other").mkdir()
    other = loop(tmp_path / "other")
    assert started_in(run) == (mine.pid,)
    shutil.rmtree(run)
    assert {file.parts[2] for file in deleted_files(run, STOP_FILE)} == {str(mine.pid)}
    assert {shell.poll(), other.poll()} == {None}
