"""A fleet in containers, seen through a pretended docker that runs the real scripts."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
from calling import printed, roco

from companion.run_files import HiAddress
from companion.tools.verbs.hi import address
from console.errors import DockerError, UsageError
from console.fleet import checkup, targets
from console.fleet.checkup import Level
from console.fleet.interfaces import opened
from operate.file_names import FAULTS_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus

pytestmark = pytest.mark.process

DEADLINE_S = 20.0
DOCKER = Path(__file__).with_name("fake_docker.py")


def wait_for(condition: Callable[[], object]) -> None:
    """Look until it is so."""
    until = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < until, f"not within {DEADLINE_S} s"


def container(world: Path, name: str, state: str = "running") -> Path:
    """The folder of a container, in this state."""
    folder = world / name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "state").write_text(state)
    return folder


@pytest.fixture
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Containers of two services and of ex, which has a supervisor with two processes; a foreign
    one beside them.
    """
    root, bin = tmp_path / "containers", tmp_path / "bin"
    for name in ("one.router", "one.hi", "one.ex", "other.cache"):
        (container(root, name) / "stop").write_bytes(b"\0")
    for service in ("router", "hi"):
        ready = root / f"one.{service}" / f"{service}.ready"
        ready.touch()
        os.utime(ready, (4e9, 4e9))  # after any /dev was made
    (root / "one.hi" / "hi.heartbeat.json").write_text(
        f'{{"pid":{os.getpid()},"incarnation":2,"state":"listening"}}'
    )
    (root / "one.hi" / "hi.json").write_bytes(msgspec.json.encode(HiAddress(1, "t")))
    both = tuple(ProcessStatus(name, ProcessState.READY, 7) for name in ("loop", "ex"))
    fleet = Fleet("roco", "", 1, 0.0, both)
    (root / "one.ex" / "fleet.json").write_bytes(msgspec.json.encode(fleet))
    bin.mkdir()
    (bin / "docker").write_text(f'#!/bin/sh\nexec "{sys.executable}" -I -S "{DOCKER}" "$@"\n')
    (bin / "docker").chmod(0o755)
    monkeypatch.setenv("PATH", f"{bin}:{os.environ['PATH']}")
    monkeypatch.setenv("FAKE_DOCKER", str(root))
    monkeypatch.delenv("ROCO_RUN_DIR", raising=False)
    monkeypatch.chdir(tmp_path)
    return root


def test_containers_are_found_out_where_nothing_runs_here(world: Path) -> None:
    """Every process in its container, those of ex as their supervisor says; the foreign container
    is none of ours.
    """
    found = targets.find().look()
    assert [one.name for one in found.seen] == ["router", "loop", "ex", "hi"]
    assert {one.status.state for one in found.seen} == {ProcessState.READY}
    hi = found.seen[-1]
    assert hi.beat is not None
    assert (hi.beat.incarnation, hi.home, hi.status.pid) == (2, "hi", os.getpid())
    assert address(targets.find()) == HiAddress(1, "t")


def test_a_service_is_stopped_and_started_by_docker(world: Path) -> None:
    """It stays down meanwhile, and the status says what to do."""
    roco("agent", "stop", "hi", code=0)
    assert (world / "one.hi" / "state").read_text() == "exited"
    said = roco("status", code=1)
    assert "roco agent start hi" in said.stdout
    roco("agent", "start", "hi", "--format", "json", code=0)
    assert (world / "one.hi" / "state").read_text() == "running"


def test_who_shares_a_container_is_switched_by_its_supervisor(world: Path) -> None:
    """By the file in its run folder; the container stays up."""
    fleet = targets.find("compose")
    fleet.switch("loop", on=False)
    fleet.switch("ex", on=False)
    assert {path.name for path in (world / "one.ex").glob("*.off")} == {"loop.off", "ex.off"}
    assert (world / "one.ex" / "state").read_text() == "running"
    fleet.switch("loop", on=True)
    assert {path.name for path in (world / "one.ex").glob("*.off")} == {"ex.off"}
    with pytest.raises(UsageError, match="'nobody'; there are router, loop, ex, hi"):
        fleet.switch("nobody", on=True)


def test_stop_reaches_the_loop_in_place(world: Path) -> None:
    """The byte that the loop has mapped changes, no other file takes its place."""
    flag = world / "one.ex" / "stop"
    number = flag.stat().st_ino
    # without it, the fleets of other tests are stopped, too
    roco("stop", "--target", "one", code=0)
    assert (flag.read_bytes(), flag.stat().st_ino) == (b"\x01", number)
    assert printed("agents", code=None)["where"] == "compose project one"
    assert targets.find().look().stop_held
    roco("release", code=0)
    assert flag.read_bytes() == b"\x00"


def test_which_project_is_meant_must_be_said_where_there_are_two(world: Path) -> None:
    """By its name; one that has ended can be named, too."""
    two = container(world, "two.router")
    done = roco("status", code=2)
    assert "one or two" in done.stderr
    (two / "state").write_text("exited")
    assert targets.find().where == "compose project one"
    assert targets.find("two").look().seen[0].status.state is ProcessState.STOPPED
    roco("status", "--target", "two", code=3)
    roco("status", "--target", "three", code=3)


def test_down_ends_the_router_last(world: Path) -> None:
    """All that ran are named."""
    assert set(targets.find().down()) == {"router", "ex", "hi"}
    assert (world / "one.router" / "state").read_text() == "exited"
    assert (world / "other.cache" / "state").read_text() == "running"


def test_the_monitors_file_is_read_from_a_byte_on(world: Path) -> None:
    """And a service that does not run is told."""
    with pytest.raises(DockerError, match="service monitor of compose project one does not run"):
        targets.find().live(0)
    (container(world, "one.monitor") / "live.jsonl").write_text("abcdef")
    assert targets.find().live(2) == b"cdef"


def test_without_docker_nothing_is_found_there(
    world: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No error of docker, but that nothing runs."""
    monkeypatch.setenv("PATH", "/nowhere")
    done = roco("status", code=3)
    assert "roco up" in done.stderr


def test_of_several_robots_one_is_meant(world: Path) -> None:
    """PROJECT/ROBOT: its own services, though their names have numbers, and what all share; no
    other's.
    """
    judged = (
        '{"t":1.0,"verdict":"legal","bytes":1,"channel":"C2","sender":"hi","receiver":"co",'
        '"conversation":"hi-1-1"}\n'
    )
    both = "velma1,velma2"
    systems = {"router": both, "monitor": both, "hi": "velma1", "ex": "velma1"}
    for service, system in (systems | {"hi2": "velma2", "ex2": "velma2"}).items():
        folder = container(world, f"one.{service}")
        (folder / "stop").write_bytes(b"\0")
        variable = "ROCO_SYSTEMS" if system == both else "ROCO_SYSTEM"
        (folder / "environment").write_text(f"{variable}={system}\n")
    (world / "one.monitor" / "velma2").mkdir()
    (world / "one.monitor" / "velma2" / "verdicts.jsonl").write_text(judged)
    second = targets.find("one/velma2")
    assert [one.home for one in second.look().seen] == ["router", "monitor", "ex2", "hi2"]
    second.hold("ex", True)
    assert (world / "one.ex2" / "stop").read_bytes() == b"\x01"
    assert (world / "one.ex" / "stop").read_bytes() == b"\x00"
    second.hold("ex", False)
    whole = targets.find("one")
    whole.hold("ex", True)
    assert {(world / f"one.{ex}" / "stop").read_bytes() for ex in ("ex", "ex2")} == {b"\x01"}
    with pytest.raises(UsageError, match="release: --target one/velma1 or one/velma2"):
        whole.hold("ex", False)
    assert [one.conversation for one in second.verdicts()] == ["hi-1-1"]
    assert targets.find("compose/velma1").verdicts() == []
    assert printed("conversation", "--target", "one/velma2")[0]["id"] == "hi-1-1"
    roco("status", "--target", "one/velma3", code=3)


def test_a_fault_hits_the_process_in_its_container(world: Path) -> None:
    """By its pid there; the line stands where the monitor records, or in the folder of this
    robot.
    """
    fleet = targets.find("one")
    with subprocess.Popen(["sleep", "60"]) as victim:
        (world / "one.hi" / "hi.heartbeat.json").write_text(
            f'{{"pid":{victim.pid},"incarnation":2,"state":"listening"}}'
        )
        fleet.signal("hi", signal.SIGSTOP)
        wait_for(lambda: next(one for one in fleet.look().seen if one.name == "hi").used.frozen)
        fleet.signal("hi", signal.SIGKILL)
        assert victim.wait(10) == -signal.SIGKILL
    monitor = container(world, "one.monitor")
    assert targets.find("one").faults() == b""
    targets.find("one").add_fault(b"first\n")
    assert (monitor / FAULTS_FILE).read_bytes() == b"first\n"
    (monitor / "roco").mkdir()
    targets.find("one").add_fault(b"second\n")
    assert targets.find("one").faults() == b"second\n"
    assert (monitor / "roco" / FAULTS_FILE).read_bytes() == b"second\n"


def test_a_fault_of_the_monitor_is_noted_when_it_is_back(world: Path) -> None:
    """It was killed, and its file is in its own container."""
    monitor = container(world, "one.monitor", "restarting")
    noting = threading.Thread(target=lambda: targets.find("one").add_fault(b"killed\n"))
    noting.start()
    states = {one.name: one.status.state for one in targets.find("one").look().seen}
    assert states["monitor"] is ProcessState.BACKING_OFF
    assert noting.is_alive()
    (monitor / "state").write_text("running")
    noting.join(DEADLINE_S)
    assert (monitor / FAULTS_FILE).read_bytes() == b"killed\n"


def test_doctor_misses_compose(world: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without it no container of ours can be started, though docker answers; it is a plugin or a
    program.
    """
    bin = world.parent / "bin"
    monkeypatch.setenv("PATH", str(bin))
    (check,) = checkup.containers()
    assert (check.level, check.what) == (Level.NOTE, "engine 28.2.2, but no Compose")
    (bin / "docker-compose").touch(mode=0o755)
    (check,) = checkup.containers()
    assert (check.level, check.what) == (Level.FINE, "engine 28.2.2, docker-compose")
    (world / "compose").touch()
    (check,) = checkup.containers()
    assert (check.level, check.what) == (Level.FINE, "engine 28.2.2, Compose 2.26.1")


def test_doctor_says_what_guests_may_do_and_that_containers_are_not_served(world: Path) -> None:
    """No file of an unnamed service is read; `roco mcp` serves fleets of this machine alone."""
    told = dict(opened(targets.find("compose")))
    assert all(name.startswith("open: ") for name in told)
    assert told["open: MCP"].endswith("not served")
