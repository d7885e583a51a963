"""deploy/healthy: a service is healthy when what it runs said so since the container's start and goes on saying so."""

import os
import subprocess
import time
from pathlib import Path

import pytest

HEALTHY = Path(__file__).resolve().parents[2] / "deploy/healthy"


@pytest.fixture
def look(tmp_path):
    """Its exit code and words."""

    def look(*names):
        done = subprocess.run(
            [HEALTHY, *names], env={**os.environ, "ROCO_RUN_DIR": str(tmp_path)}, capture_output=True, timeout=20.0
        )
        return done.returncode, done.stdout.decode()

    return look


def write(path, age_s=0.0):
    """A file that was written so long ago."""
    path.touch()
    os.utime(path, (time.time() - age_s,) * 2)


def test_what_never_said_so_is_not_ready(look):
    """A container that just starts."""
    assert look("km") == (1, "km: not ready yet\n")


def test_ready_is_enough_for_what_has_no_heartbeat(tmp_path, look):
    """Router, monitor and loop."""
    write(tmp_path / "router.ready")
    assert look("router") == (0, "")


def test_ready_from_before_this_start_does_not_count(tmp_path, look):
    """A killed process leaves its files in the volume; /dev is made at each start of a container."""
    write(tmp_path / "router.ready", time.time() - os.stat("/dev").st_mtime + 10.0)
    assert look("router")[0] == 1


def test_a_heartbeat_keeps_it_healthy(tmp_path, look):
    """An agent writes one each second."""
    write(tmp_path / "km.ready", 1.0)
    write(tmp_path / "km.heartbeat.json", 2.0)
    assert look("km") == (0, "")


def test_a_heartbeat_that_stopped_does_not(tmp_path, look):
    """The process may be there and yet do nothing."""
    write(tmp_path / "km.ready", 1.0)
    write(tmp_path / "km.heartbeat.json", 60.0)
    code, words = look("km")
    assert code == 1
    assert words.startswith("km: last heartbeat ")


def test_all_that_are_named_must_be_healthy(tmp_path, look):
    """The executor's container has an agent and a loop."""
    write(tmp_path / "ex.ready")
    assert look("loop", "ex") == (1, "loop: not ready yet\n")
    write(tmp_path / "loop.ready")
    assert look("loop", "ex") == (0, "")
