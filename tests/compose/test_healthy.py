"""deploy/healthy: a service is healthy when what it runs said so since the container's start and
goes on saying so.
"""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

HEALTHY = Path(__file__).resolve().parents[2] / "deploy/healthy"


class Looks:
    """Looks of a container that started now, with clocks that the test moves."""

    def __init__(self, place, run):
        self.place, self.run = place, run
        self.wall, self.up = int(time.time()), 1000
        self._program("date", 'cat "$CLOCKS/wall"')
        self._program("cut", 'cat "$CLOCKS/up"')

    def _program(self, name, text):
        file = self.place / name
        file.write_text(f"#!/bin/sh\n{text}\n")
        file.chmod(0o755)

    def __call__(self, *names, **told):
        """Its exit code and words; `told`: of its environment."""
        (self.place / "wall").write_text(f"{self.wall}\n")
        (self.place / "up").write_text(f"{self.up}\n")
        places = {
            "TMPDIR": str(self.place),
            "CLOCKS": str(self.place),
            "PATH": f"{self.place}:{os.environ['PATH']}",
        }
        environment = {**os.environ, **places, "ROCO_RUN_DIR": str(self.run), **told}
        done = subprocess.run([HEALTHY, *names], env=environment, capture_output=True, timeout=20.0)
        assert done.stderr == b""
        return done.returncode, done.stdout.decode()

    def after(self, seconds):
        """Let this time pass without a look."""
        self.wall, self.up = self.wall + seconds, self.up + seconds

    def until(self, seconds, *names, every_s=5):
        """Look again and again for so long; the last look."""
        told = self(*names)
        for _ in range(seconds // every_s):
            self.after(every_s)
            told = self(*names)
        return told


@pytest.fixture
def look(tmp_path):
    """The health check."""
    place = tmp_path / "container"
    place.mkdir()
    return Looks(place, tmp_path)


def write(path, age_s=0.0):
    """A file that was written so long ago."""
    path.touch()
    os.utime(path, (time.time() - age_s,) * 2)


def test_what_never_said_so_is_not_ready(look):
    """A container that just starts."""
    assert look("km") == (1, "km: not ready yet\n")


def test_in_a_swarm_a_heartbeat_is_enough(tmp_path, look):
    """What is not healthy has no name there, and agents are ready only once they reached each
    other.
    """
    assert look("km", ROCO_HEALTHY="alive") == (1, "km: no heartbeat\n")
    write(tmp_path / "km.heartbeat.json")
    assert look("km", ROCO_HEALTHY="alive") == (0, "")
    assert look("km") == (1, "km: not ready yet\n")


def test_ready_is_not_enough(tmp_path, look):
    """Everything that runs has a heartbeat."""
    write(tmp_path / "router.ready")
    assert look("router") == (1, "router: no heartbeat\n")


def test_ready_from_before_this_start_does_not_count(tmp_path, look):
    """A killed process leaves its files in the volume; /dev is made at each start of a
    container.
    """
    write(tmp_path / "router.heartbeat.json")
    write(tmp_path / "router.ready", time.time() - os.stat("/dev").st_mtime + 10.0)
    assert look("router") == (1, "router: not ready yet\n")


def test_a_heartbeat_keeps_it_healthy(tmp_path, look):
    """An agent writes one each second."""
    write(tmp_path / "km.ready", 1.0)
    write(tmp_path / "km.heartbeat.json", 2.0)
    assert look("km") == (0, "")


def test_a_heartbeat_that_stopped_does_not(tmp_path, look):
    """The process may be there and yet do nothing."""
    write(tmp_path / "km.ready", 1.0)
    write(tmp_path / "km.heartbeat.json", 2.0)
    assert look.until(10, "km") == (0, "")
    look.after(5)
    assert look("km") == (1, "km: no heartbeat for 15 s, more than 10 s\n")


def test_all_that_are_named_must_be_healthy(tmp_path, look):
    """The executor's container has an agent and a loop."""
    for name in ("ex.ready", "ex.heartbeat.json", "loop.heartbeat.json"):
        write(tmp_path / name)
    assert look("loop", "ex") == (1, "loop: not ready yet\n")
    write(tmp_path / "loop.ready")
    assert look("loop", "ex") == (0, "")


@pytest.fixture
def sleeper(tmp_path):
    """Starts processes that do nothing, under a name of ours or another, in this run folder or
    another.
    """
    started = []

    def start(name, run=tmp_path):
        settings = {**os.environ, "ROCO_RUN_DIR": str(run)}
        process = subprocess.Popen(
            [sys.executable, "-c", "import time; time.sleep(50)", name], env=settings
        )
        line = Path(f"/proc/{process.pid}/cmdline")
        while name.encode() not in line.read_bytes():  # Popen returns amid the exec
            time.sleep(0.001)
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.wait()


def beats(tmp_path, pid, age_s):
    """An agent that was ready and last wrote its heartbeat so long ago."""
    write(tmp_path / "km.ready", age_s)
    (tmp_path / "km.heartbeat.json").write_text(f'{{"agent":"km","pid":{pid},"incarnation":2}}')
    write(tmp_path / "km.heartbeat.json", age_s)


def test_an_agent_that_hangs_is_ended(tmp_path, look, sleeper):
    """Docker starts what ended again, not what hangs."""
    hung = sleeper("services.knowledge")
    beats(tmp_path, hung.pid, 1.0)
    assert "ended" not in look.until(20, "km")[1]
    look.after(5)
    code, words = look("km")
    assert code == 1
    assert words.endswith("km: ended, it hung\n")
    assert hung.wait(timeout=10.0) == -9


def test_a_slow_agent_is_not_ended(tmp_path, look, sleeper):
    """Unhealthy, and left to go on; a heartbeat later it is healthy."""
    slow = sleeper("services.knowledge")
    for age in (3.0, 2.0, 1.0):
        beats(tmp_path, slow.pid, age)
        code, words = look.until(20, "km")
        assert code == 1
        assert "ended" not in words
    beats(tmp_path, slow.pid, 0.0)
    assert look("km") == (0, "")
    assert slow.poll() is None


@pytest.mark.parametrize("seconds", [3600, -3600])
def test_a_wall_clock_that_is_set_ends_nobody(tmp_path, look, sleeper, seconds):
    """The next heartbeat has the new time; until then the last one looks an hour old, or not
    written yet.
    """
    agent = sleeper("services.knowledge")
    beats(tmp_path, agent.pid, 1.0)
    assert look("km") == (0, "")
    look.wall += seconds
    look.after(1)
    assert look("km") == (0, "")
    # it was restarted by a supervisor, or its clock only set
    for name in ("km.ready", "km.heartbeat.json"):
        write(tmp_path / name, -seconds)
    look.after(1)
    assert look("km") == (0, "")
    assert agent.poll() is None
    assert look.until(25, "km")[1].endswith("km: ended, it hung\n")
    assert agent.wait(timeout=10.0) == -9


@pytest.mark.parametrize("every_s", [1, 5])
def test_a_machine_that_was_suspended_ends_nobody(tmp_path, look, sleeper, every_s):
    """It looks as if all had been silent for an hour."""
    agent = sleeper("services.knowledge")
    beats(tmp_path, agent.pid, 1.0)
    assert look.until(5, "km", every_s=every_s)[0] == 0
    look.after(3600)
    assert "ended" not in look("km")[1]
    assert agent.poll() is None


def test_nobody_else_is_ended(tmp_path, look, sleeper):
    """A process id may belong to another by now."""
    other = sleeper("somebody-else")
    beats(tmp_path, other.pid, 1.0)
    code, words = look.until(30, "km")
    assert code == 1
    assert "ended" not in words
    assert other.poll() is None


def test_an_agent_that_froze_before_it_was_ready_is_ended(tmp_path, look, sleeper):
    """It beat once and waits for its peers; it would wait for ever."""
    frozen = sleeper("services.knowledge")
    beats(tmp_path, frozen.pid, 1.0)
    (tmp_path / "km.ready").unlink()
    code, words = look.until(25, "km")
    assert code == 1
    assert words.startswith("km: not ready yet\n")
    assert words.endswith("km: ended, it hung\n")
    assert frozen.wait(timeout=10.0) == -9


@pytest.mark.parametrize("earlier", [False, True])
def test_an_agent_that_froze_before_its_first_heartbeat_is_ended(tmp_path, look, sleeper, earlier):
    """Also where an earlier process left one in the volume, with a number that is somebody else's
    now.
    """
    frozen, other = sleeper("services.knowledge"), sleeper("services.knowledge", tmp_path / "other")
    if earlier:
        beats(tmp_path, other.pid, time.time() - os.stat("/dev").st_mtime + 10.0)
    assert look.until(120, "km") == (1, "km: not ready yet\n")
    look.after(5)
    assert look("km") == (1, "km: not ready yet\nkm: ended, no heartbeat within 120 s\n")
    assert frozen.wait(timeout=10.0) == -9
    assert other.poll() is None


def test_what_a_supervisor_keeps_is_left_to_it(tmp_path, look, sleeper):
    """It removes the files of what it starts again; it is ended itself where it never beat."""
    supervisor = sleeper("services.supervisor")
    beats(tmp_path, supervisor.pid, 1.0)
    for suffix in ("ready", "heartbeat.json"):
        (tmp_path / f"km.{suffix}").rename(tmp_path / f"supervisor.{suffix}")
    assert look("loop", "ex", "supervisor") == (1, "loop: not ready yet\nex: not ready yet\n")
    look.after(130)
    assert look("loop", "ex", "supervisor") == (1, "loop: not ready yet\nex: not ready yet\n")
    assert supervisor.poll() is None
    (tmp_path / "supervisor.heartbeat.json").unlink()
    assert look("loop", "ex", "supervisor")[1].endswith(
        "supervisor: ended, no heartbeat within 120 s\n"
    )
    assert supervisor.wait(timeout=10.0) == -9
