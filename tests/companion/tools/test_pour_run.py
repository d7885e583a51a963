"""The main job waits for agents that still stop, when its task has ended: not for ever, and it says
for whom.
"""

import io
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import msgspec
import pytest

from agent_runtime.io.run_files import heartbeat_file, ready_file
from companion.tools.system import SYSTEM
from companion.tools.verbs import pour_run
from console.terminal.console import Console
from console.terminal.draw import Watch
from operate.file_names import FLEET_FILE, LIVE_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus
from operate.live_lines import AgentIn
from operate.supervisor import folder

RESTS = {"ta": "idle", "ex": "idle"}


@pytest.fixture
def told():
    """Text that a person reads."""
    return io.StringIO()


def rested(run, told, alive=True, within_s=0.3):
    """Wait for them."""
    watch = Watch(SYSTEM, run, "title", Console(file=told, width=200))
    return pour_run.at_rest(run, RESTS, watch, lambda: alive, within_s)


def beats(run, agent, state, later_s=60.0):
    """Write what it said last; `later_s` after now."""
    said = {"agent": agent, "state": state, "at": time.time() + later_s}
    heartbeat_file(run, agent).write_bytes(msgspec.json.encode(said))


@contextmanager
def runs(run, process):
    """Be the supervisor of a fleet of one process."""
    with folder.kept(run):
        told = Fleet("roco", "", os.getpid(), time.time(), (process,))
        (run / FLEET_FILE).write_bytes(msgspec.json.encode(told))
        yield


def test_who_rests_is_not_waited_for(tmp_path, told):
    """An agent at rest costs no wait, whatever the bound."""
    for agent in RESTS:
        beats(tmp_path, agent, "idle")
    assert rested(tmp_path, told, within_s=1e9) == []
    assert "waiting" not in told.getvalue()


def test_who_still_stops_is_named_once_and_given_up(tmp_path, told):
    """In one line, though it is looked for again and again."""
    beats(tmp_path, "ta", "idle")
    beats(tmp_path, "ex", "stopping")
    assert rested(tmp_path, told) == ["ex is stopping"]
    assert told.getvalue().count("waiting until the robot is at rest: ex is stopping\n") == 1


def test_what_was_said_before_is_not_believed(tmp_path, told):
    """An agent that was idle before its act still says so until its next heartbeat; one may say
    nothing at all.
    """
    beats(tmp_path, "ta", "idle", later_s=-1.0)
    assert rested(tmp_path, told) == ["", ""]


@pytest.mark.process
def test_a_process_that_is_frozen_is_waited_for(tmp_path, told):
    """A monitor that sleeps through the end of the task has not recorded it; the supervisor starts
    another one.
    """
    for agent in RESTS:
        beats(tmp_path, agent, "idle")
    with subprocess.Popen([sys.executable, "-c", "import signal; signal.pause()"]) as frozen:
        frozen.send_signal(signal.SIGSTOP)
        os.waitpid(frozen.pid, os.WUNTRACED)
        with runs(tmp_path, ProcessStatus("monitor", ProcessState.READY, frozen.pid)):
            assert rested(tmp_path, told) == ["monitor is frozen by a signal"]
        frozen.kill()


@pytest.mark.parametrize("state", ProcessState)
def test_a_process_that_will_be_ready_is_waited_for(tmp_path, told, state):
    """One that was given up, or ended on purpose, is not."""
    for agent in RESTS:
        beats(tmp_path, agent, "idle")
    coming = state in {"waiting", "starting", "backing-off"}
    with runs(tmp_path, ProcessStatus("monitor", state)):
        assert rested(tmp_path, told) == ([f"monitor is {state}"] if coming else [])


@pytest.mark.parametrize("later_s", [-1.0, 1.0, None])
def test_a_monitor_that_began_again_is_waited_for(tmp_path, told, later_s):
    """Until it has recorded something of the robot, of which it hears twice a second; it may never
    have.
    """
    for agent in RESTS:
        beats(tmp_path, agent, "idle")
    ready_file(tmp_path, "monitor").touch()
    if later_s is not None:
        line = AgentIn(t=time.time() + later_s, agent="loop", state="motion")
        (tmp_path / LIVE_FILE).write_bytes(msgspec.json.encode(line) + b"\n")
    heard = later_s is not None and later_s > 0.0
    assert rested(tmp_path, told) == ([] if heard else ["monitor has not heard of the robot"])


def test_a_fleet_that_is_gone_is_not_waited_for(tmp_path, told):
    """Its agents come to no rest any more."""
    beats(tmp_path, "ta", "running")
    assert rested(tmp_path, told, alive=False, within_s=1e9)
