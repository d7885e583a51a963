"""Traffic of a fleet in containers: heard by a process in the monitor's container, here a pretended
one.
"""

import json
import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from test_traffic import Router, interrupted, kept, refused, told
from toy_fleet import wait_for

from agent_runtime.io.sessions import free_endpoint
from agent_runtime.io.steplog import StepLogs
from companion.tools.system import SYSTEM
from operate.file_names import TRAFFIC_FILE
from operate.recording import mcap_file
from operate.recording.records import SETTING, House, Setting
from operate.recording.run import Run

pytestmark = pytest.mark.zenoh
DOCKER = Path(__file__).parents[1] / "console" / "fake_docker.py"


class Containers(Router):
    """A router, and a compose project with a monitor whose run folder says what the fleet was
    started with, and has copies of the agents' logs.
    """

    def __init__(self, root: Path) -> None:
        (root / "run").mkdir()
        super().__init__(root / "run")
        self.monitor, bin = root / "containers" / "one.monitor", root / "bin"
        told = {
            "state": "running",
            "environment": f"ROCO_SYSTEM=roco\nROCO_CONNECT={self.endpoint}\n"
            f"ROCO_AGENTS=hi={free_endpoint()},co={free_endpoint()}\n",
        }
        for service in ("monitor", "hi"):
            (root / "containers" / f"one.{service}").mkdir(parents=True)
            for name, text in told.items():
                (root / "containers" / f"one.{service}" / name).write_text(text)
        self._logs = StepLogs(self.monitor)
        recording = mcap_file.Recording(self.monitor / TRAFFIC_FILE)
        setting = json.dumps({"seed": 5, "speed": "max"}).encode()
        recording.add(House(SETTING, "monitor", "", time.time(), setting))
        recording.finish()
        bin.mkdir()
        (bin / "docker").write_text(f'#!/bin/sh\nexec "{sys.executable}" -I -S "{DOCKER}" "$@"\n')
        (bin / "docker").chmod(0o755)
        (bin / "python").symlink_to(sys.executable)
        self.about = ["--target", "compose"]
        self.environment |= {
            "PATH": f"{bin}:{os.environ['PATH']}",
            "FAKE_DOCKER": str(root / "containers"),
            "ROCO_CONNECT": self.endpoint,
            "PYTHONPATH": os.pathsep.join(sys.path),
        }

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


@pytest.fixture
def containers(tmp_path: Path) -> Iterator[Containers]:
    """A monitor in a pretended container, and a router."""
    made = Containers(tmp_path)
    yield made
    made.close()


def test_traffic_is_heard_and_judged(containers: Containers) -> None:
    """As of a fleet on this machine; and who hears it ends with who asked, even by kill."""
    process = containers.roco("traffic echo --channel C3 --count 2 --format json")
    containers.say(40)
    heard = [(one["performative"], one["verdict"]) for one in told(process)]
    assert heard == [("request", "legal"), ("agree", "legal")]
    endless = containers.roco("traffic echo")
    endless.kill()
    wait_for(lambda: not containers.heard(), "the process in the container is gone")


def test_a_recording_is_made_here_with_the_fleets_setting(containers: Containers) -> None:
    """Ctrl-C ends it in order; everything that was said is in it."""
    file = containers.run / "mine.mcap"
    process = containers.roco("record --format json --out", str(file))
    containers.say(40)
    wait_for(lambda: len(kept(file)) == 40, "all is in the file")
    (done,) = interrupted(process)
    assert done["communicates"] == 40
    file.rename(containers.run / TRAFFIC_FILE)
    assert Run(containers.run, SYSTEM).history.setting == Setting(5, "max")


def test_a_monitor_that_stops_is_told(containers: Containers) -> None:
    """An endless verb does not hang when its source is gone; what was recorded is kept."""
    file = containers.run / "mine.mcap"
    endless = (
        containers.roco(f"record --out {file}"),
        containers.roco("traffic stats hz"),
    )
    containers.say(40)
    wait_for(lambda: len(kept(file)) == 40, "all is in the file")
    wait_for(lambda: len(containers.hearers()) == 2, "both are heard for")
    for pid in containers.hearers():
        os.kill(pid, signal.SIGKILL)
    for process in endless:
        refused(process, 1, "nothing more is heard of the fleet")
    assert mcap_file.read(file).whole


def test_what_is_missing_is_told(containers: Containers) -> None:
    """The router, in the words of the process that looked for it; the service that would hear."""
    containers.environment["ROCO_CONNECT"] = "tcp/127.0.0.1:1"
    refused(containers.roco("traffic stats"), 3, "no router answers at tcp/127.0.0.1:1")
    (containers.monitor / "state").write_text("exited")
    said = "service monitor of compose project one does not run"
    refused(containers.roco("traffic stats"), 1, said)


def test_a_person_is_an_agent_beside_its_container(containers: Containers) -> None:
    """In its volume and with its environment: its journal is there."""
    say = "send --as hi --to co --protocol request --performative request --wait 0 --format json"
    (said,) = told(containers.roco(say, "--content", '{"type":"LookAround"}'))
    assert (said["sent"]["sender"], said["receipted"]) == ("hi", False)
    assert (containers.monitor.parent / "one.hi" / "journal" / "hi.journal").exists()
