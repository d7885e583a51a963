"""Traffic of a fleet in containers: heard by a process in the monitor's container, here a pretended
one.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from test_traffic import ROCO, Router, told, wait_for

from agent_runtime.core.wiring import service_key
from agent_runtime.io.sessions import free_endpoint
from agent_runtime.io.steplog import StepLogs
from companion.tools.system import SYSTEM
from operate.file_names import TRAFFIC_FILE
from operate.recording import mcap_file
from operate.recording.records import SETTING, House, Setting, Spoken
from operate.recording.run import Run

pytestmark = pytest.mark.zenoh
DOCKER = Path(__file__).parents[1] / "operate" / "cli" / "fake_docker.py"


class Containers(Router):
    """A router, and a compose project with a monitor whose run folder says what the fleet was
    started with, and has copies of the agents' logs.
    """

    def __init__(self, root: Path) -> None:
        (root / "run").mkdir()
        super().__init__(root / "run")
        self.monitor, bin = root / "containers" / "one.monitor", root / "bin"
        for service in ("monitor", "hi"):
            (root / "containers" / f"one.{service}").mkdir(parents=True)
            (root / "containers" / f"one.{service}" / "state").write_text("running")
            (root / "containers" / f"one.{service}" / "environment").write_text(
                f"ROCO_SYSTEM=roco\nROCO_CONNECT={self.endpoint}\n"
                f"ROCO_AGENTS=hi={free_endpoint()},co={free_endpoint()}\n"
            )
        self._logs = StepLogs(self.monitor)
        with_setting = mcap_file.Recording(self.monitor / TRAFFIC_FILE)
        with_setting.add(
            House(
                SETTING,
                "monitor",
                "",
                time.time(),
                json.dumps({"seed": 5, "speed": "max"}).encode(),
            )
        )
        with_setting.finish()
        bin.mkdir()
        (bin / "docker").write_text(f'#!/bin/sh\nexec "{sys.executable}" -I -S "{DOCKER}" "$@"\n')
        (bin / "docker").chmod(0o755)
        (bin / "python").symlink_to(sys.executable)
        words = {"PATH": f"{bin}:{os.environ['PATH']}", "FAKE_DOCKER": str(root / "containers")}
        self.environment = (
            os.environ
            | words
            | {
                "ROCO_CONNECT": self.endpoint,
                "PYTHONPATH": os.pathsep.join(sys.path),
            }
        )

    def roco(self, *words: str) -> "subprocess.Popen[bytes]":
        """A verb about the containers, started; it hears what is said from when this comes back."""
        command = [*ROCO, *words, "--target", "compose"]
        pipe = subprocess.PIPE
        process = subprocess.Popen(
            command, stdout=pipe, stderr=pipe, cwd=self.run, env=self.environment
        )
        self.running.append(process)
        ear = self.session.declare_publisher(service_key("roco", "state", "co"))
        wait_for(
            lambda: ear.matching_status.matching or process.poll() is not None, "somebody listens"
        )
        ear.undeclare()
        return process

    def hearers(self) -> list[int]:
        """The processes in the pretended container."""
        mark, found = os.fsencode(f"FAKE_DOCKER={self.monitor.parent}"), []
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                words, environment = (
                    (folder / name).read_bytes().split(b"\0") for name in ("cmdline", "environ")
                )
            except OSError:
                continue
            if mark in environment and words[1:5] == [b"-P", b"-m", b"services.monitor", b"hear"]:
                found.append(int(folder.name))
        return found

    def listens(self) -> bool:
        """Whether anybody still hears what is said."""
        ear = self.session.declare_publisher(service_key("roco", "state", "co"))
        matching = ear.matching_status.matching
        ear.undeclare()
        return matching


@pytest.fixture
def containers(tmp_path: Path) -> Iterator[Containers]:
    """A monitor in a pretended container, and a router."""
    made = Containers(tmp_path)
    yield made
    made.close()


def test_traffic_is_heard_and_judged(containers: Containers) -> None:
    """As of a fleet on this machine; and who hears it ends with who asked, even by kill."""
    process = containers.roco(
        "traffic", "echo", "--channel", "C3", "--count", "2", "--format", "json"
    )
    containers.say(40)
    request, agree = told(process)
    assert (request["performative"], agree["performative"], agree["verdict"]) == (
        "request",
        "agree",
        "legal",
    )
    endless = containers.roco("traffic", "echo")
    endless.kill()
    wait_for(lambda: not containers.listens(), "the process in the container is gone")


def test_a_recording_is_made_here_with_the_fleets_setting(containers: Containers) -> None:
    """Ctrl-C ends it in order; everything that was said is in it."""
    file = containers.run / "mine.mcap"
    process = containers.roco("record", "--out", str(file), "--format", "json")
    containers.say(40)
    wait_for(
        lambda: sum(isinstance(one, Spoken) for one in mcap_file.read(file).records) == 40,
        "all is in the file",
    )
    process.send_signal(signal.SIGINT)
    (done,) = told(process)
    assert done["communicates"] == 40
    file.rename(containers.run / TRAFFIC_FILE)
    assert Run(containers.run, SYSTEM).history.setting == Setting(5, "max")


def test_a_monitor_that_stops_is_told(containers: Containers) -> None:
    """An endless verb does not hang when its source is gone; what was recorded is kept."""
    file = containers.run / "mine.mcap"
    keeping, listening = (
        containers.roco("record", "--out", str(file)),
        containers.roco("traffic", "stats", "hz"),
    )
    containers.say(40)
    wait_for(
        lambda: sum(isinstance(one, Spoken) for one in mcap_file.read(file).records) == 40,
        "all is in the file",
    )
    wait_for(lambda: len(containers.hearers()) == 2, "both are heard for")
    for pid in containers.hearers():
        os.kill(pid, signal.SIGKILL)
    for process in (listening, keeping):
        _, error = process.communicate(timeout=30.0)
        assert process.returncode == 1
        assert b"nothing more is heard of the fleet" in error
    assert mcap_file.read(file).whole


def test_no_monitor_no_traffic(containers: Containers) -> None:
    """The message says which service is missing."""
    (containers.monitor / "state").write_text("exited")
    process = containers.roco("traffic", "stats")
    _, error = process.communicate(timeout=30.0)
    assert process.returncode == 1
    assert b"service monitor of compose project one does not run" in error


def test_no_router_is_told(containers: Containers) -> None:
    """In the words of the process that looked for it."""
    containers.environment["ROCO_CONNECT"] = "tcp/127.0.0.1:1"
    _, error = containers.roco("traffic", "stats").communicate(timeout=30.0)
    assert b"no router answers at tcp/127.0.0.1:1" in error


def test_a_person_is_an_agent_beside_its_container(containers: Containers) -> None:
    """In its volume and with its environment: its journal is there."""
    saying = containers.roco("send", "--as", "hi", "--to", "co", "--protocol", "request",
                             "--performative", "request",
                             "--content", '{"type":"LookAround"}', "--wait", "0", "--format",
                             "json")  # fmt: skip
    (said,) = told(saying)
    assert (said["sent"]["sender"], said["receipted"]) == ("hi", False)
    assert (containers.monitor.parent / "one.hi" / "journal" / "hi.journal").exists()
