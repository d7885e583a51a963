"""The recorder as a process: what agents log is recorded, though it is killed in between."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh
from synthetic import Run

from agent_runtime.io.sessions import client_config, free_endpoint
from agent_runtime.io.steplog import StepLogs
from fipa_codec.communicate import Communicate, decode
from operate.file_names import VIEW_FILE
from operate.pictures.viewer_address import SWITCH
from operate.recording import mcap_file
from operate.recording.recorder import NICENESS
from operate.recording.records import Garbage, House, Spoken

pytestmark = pytest.mark.zenoh
DEADLINE_S = 30.0
STATE = "roco/roco/_/state/co"


def wait_for(condition: Callable[[], object], what: str) -> None:
    """Look every 20 ms until the condition holds."""
    end = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < end, f"not in {DEADLINE_S} s: {what}"
        time.sleep(0.02)


class Processes:
    """Router and recorder of one run folder."""

    def __init__(self, run: Path) -> None:
        self.run, self.endpoint = run, free_endpoint()
        self.running: list[subprocess.Popen[bytes]] = []

    def start(self, module: str, name: str, *, ready: bool = True) -> subprocess.Popen[bytes]:
        """Start one, and wait until it is ready."""
        (self.run / f"{name}.ready").unlink(missing_ok=True)
        options = {
            "ROCO_LISTEN": self.endpoint,
            "ROCO_CONNECT": self.endpoint,
            "ROCO_RUN_DIR": str(self.run),
        }
        with (self.run / f"{name}.log").open("ab") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", module], env=os.environ | options, stdout=log, stderr=log
            )
        self.running.append(process)
        if ready:
            wait_for((self.run / f"{name}.ready").exists, f"{name} is ready")
        return process

    def end(self) -> None:
        """End them."""
        for process in self.running:
            process.kill()
            process.wait()


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    """A router."""
    fleet = Processes(tmp_path)
    fleet.start("services.router", "router")
    yield fleet
    fleet.end()


def recorded(run: Path, kind: type) -> int:
    """Return the number of records of a kind that are readable now."""
    return sum(isinstance(record, kind) for record in mcap_file.read(run / mcap_file.FILE).records)


def test_a_recorder_reads_everything_dies_and_comes_back(
    processes: Processes, pouring: Run
) -> None:
    """All that agents logged is in the recording once, also what they logged while none lived;
    SIGTERM leaves report, page and pictures.
    """
    said = [decode(sample.data) for sample in pouring.samples if "/_/" not in sample.key][:400]
    logs = StepLogs(processes.run)

    def say(some: list[Communicate]) -> None:
        for one in some:
            logs.passed(msgspec.structs.replace(one, sent=time.time()), time.time())

    first = processes.start("services.monitor", "monitor")
    say(said[:200])
    logs.garbled("roco/roco/C1/co/ta/coordinate/request", "no communicate", time.time())
    wait_for(lambda: recorded(processes.run, Spoken) == 200, "what was said is flushed")
    assert recorded(processes.run, Garbage) == 1
    first.kill()
    first.wait()
    say(said[200:300])
    second = processes.start("services.monitor", "monitor")
    say(said[300:])
    wait_for(lambda: recorded(processes.run, Spoken) == 400, "the rest is flushed")
    second.send_signal(signal.SIGTERM)
    assert second.wait(DEADLINE_S) == 0, (processes.run / "monitor.log").read_text()
    assert recorded(processes.run, Spoken) == 400
    told = msgspec.json.decode((processes.run / "report.json").read_bytes())
    assert told["communicates"]["total"] == 400
    assert told["communicates"]["garbage"] == 1
    assert told["holes"] == []
    assert all(
        (processes.run / name).stat().st_size for name in ("report.html", "run.rrd", "live.jsonl")
    )


def test_a_recorder_needs_no_router(tmp_path: Path, pouring: Run) -> None:
    """What agents logged is recorded before it is there; heartbeats once it is."""
    said = [decode(sample.data) for sample in pouring.samples if "/_/" not in sample.key][:2]
    fleet = Processes(tmp_path)
    try:
        logs = StepLogs(tmp_path)
        logs.passed(said[0], said[0].sent)
        fleet.start("services.monitor", "monitor", ready=False)
        wait_for(lambda: recorded(tmp_path, Spoken) == 1, "the first is recorded")
        fleet.start("services.router", "router")
        wait_for((tmp_path / "monitor.ready").exists, "the recorder reached the router")
        with zenoh.open(client_config(fleet.endpoint)) as session:
            wait_for(
                lambda: session.put(STATE, b"{}") or recorded(tmp_path, House) > 1,
                "a heartbeat is recorded",
            )
        logs.passed(said[1], said[1].sent)
        wait_for(lambda: recorded(tmp_path, Spoken) == 2, "the second is recorded")
    finally:
        fleet.end()


def test_a_recorder_records_before_it_shows(
    processes: Processes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is drawn before a viewer connects; who draws yields to the fleet as the recorder
    does.
    """
    monkeypatch.setenv(SWITCH, "on")
    processes.start("services.monitor", "monitor")
    log, address = processes.run / "logs/monitor.jsonl", processes.run / VIEW_FILE
    wait_for(address.exists, "the ports are open")
    assert [one["event"] for one in events(log)] == ["recording"]
    with socket.create_connection(("127.0.0.1", msgspec.json.decode(address.read_bytes())["grpc"])):
        wait_for(lambda: len(events(log)) == 2, "somebody draws")
    assert [one["event"] for one in events(log)] == ["recording", "showing"]
    pid = events(log)[1]["pid"]
    assert os.getpriority(os.PRIO_PROCESS, pid) == os.getpriority(os.PRIO_PROCESS, 0) + NICENESS


def events(log: Path) -> list[dict[str, Any]]:
    """The lines of the recorder's log that say that it records, and that it draws."""
    lines = [msgspec.json.decode(line) for line in log.read_bytes().splitlines()]
    return [line for line in lines if line["event"] in ("recording", "showing")]


def test_a_recorder_that_is_frozen_ends_when_it_goes_on(processes: Processes) -> None:
    """It is told to end meanwhile; the system may hand the signal to a thread that runs no
    handlers.
    """
    monitor = processes.start("services.monitor", "monitor")
    for number in (signal.SIGSTOP, signal.SIGTERM, signal.SIGCONT):
        monitor.send_signal(number)
    assert monitor.wait(DEADLINE_S) == 0, (processes.run / "monitor.log").read_text()
    assert (processes.run / "report.json").exists()
