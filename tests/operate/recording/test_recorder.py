"""The recorder as a process over a real router: what goes by is recorded, though it is killed in between."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import pytest
import zenoh
from synthetic import Run

from agent_runtime.io.sessions import client_config, free_endpoint
from agent_runtime.io.tap import Sample
from operate.pictures.viewer_address import SWITCH
from operate.recording import mcap_file
from operate.recording.recorder import NICENESS
from operate.recording.records import Garbage, Resumed, Spoken
from operate.run_folder import VIEW_FILE

pytestmark = pytest.mark.zenoh
DEADLINE_S = 30.0


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

    def start(self, module: str, name: str) -> subprocess.Popen[bytes]:
        """Start one and wait until it is ready."""
        (self.run / f"{name}.ready").unlink(missing_ok=True)
        options = {"ROCO_LISTEN": self.endpoint, "ROCO_CONNECT": self.endpoint, "ROCO_RUN_DIR": str(self.run)}
        with (self.run / f"{name}.log").open("ab") as log:
            process = subprocess.Popen([sys.executable, "-m", module], env=os.environ | options, stdout=log, stderr=log)
        self.running.append(process)
        wait_for((self.run / f"{name}.ready").exists, f"{name} is ready")
        return process


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    """A router."""
    fleet = Processes(tmp_path)
    fleet.start("services.router", "router")
    yield fleet
    for process in fleet.running:
        process.kill()
        process.wait()


def recorded(run: Path, kind: type) -> int:
    """Return the number of records of a kind that are readable now."""
    return sum(isinstance(record, kind) for record in mcap_file.read(run / mcap_file.FILE).records)


def test_a_recorder_hears_everything_dies_and_comes_back(processes: Processes, pouring: Run) -> None:
    """All that was said while it lived is in the recording; SIGTERM leaves report, page and pictures."""
    said = [sample for sample in pouring.samples if "/_/" not in sample.key][:400]
    session = zenoh.open(client_config(processes.endpoint))

    def say(samples: list[Sample]) -> None:
        for sample in samples:
            session.put(sample.key, sample.data)

    first = processes.start("services.monitor", "monitor")
    say(said[:200])
    session.put("roco/roco/C1/co/ta/coordinate/request", b"\xc1 no communicate")
    wait_for(lambda: recorded(processes.run, Garbage) == 1, "what was said is flushed")
    assert recorded(processes.run, Spoken) == 200
    first.kill()
    first.wait()
    second = processes.start("services.monitor", "monitor")
    say(said[200:])
    wait_for(lambda: recorded(processes.run, Spoken) == 400, "the second part is flushed")
    session.close()
    second.send_signal(signal.SIGTERM)
    assert second.wait(DEADLINE_S) == 0, (processes.run / "monitor.log").read_text()
    told = msgspec.json.decode((processes.run / "report.json").read_bytes())
    assert told["communicates"]["total"] == 400
    assert told["communicates"]["garbage"] == 1
    assert any("away" in hole["text"] for hole in told["holes"])
    assert all((processes.run / name).stat().st_size for name in ("report.html", "run.rrd", "live.jsonl"))


def test_a_recorder_tells_when_it_heard_nothing(processes: Processes, pouring: Run) -> None:
    """While no router is there nothing is heard: the recording says since when, and what was open is not judged."""
    said = [sample for sample in pouring.samples if "/_/" not in sample.key][:2]
    processes.start("services.monitor", "monitor")
    for name in ("router", "monitor"):
        beat = processes.run / f"{name}.heartbeat.json"
        os.utime(beat, (1.0, 1.0))
        wait_for(lambda beat=beat: beat.stat().st_mtime > 1.0, f"{name} beats")  # type: ignore[misc]
    processes.running[0].kill()
    processes.running[0].wait()
    processes.start("services.router", "router")
    wait_for(lambda: recorded(processes.run, Resumed) == 1, "the recorder is back")
    session = zenoh.open(client_config(processes.endpoint))
    session.put(said[0].key, said[0].data)
    wait_for(lambda: recorded(processes.run, Spoken) == 1, "it hears again")
    session.close()


def test_a_recorder_records_before_it_shows(processes: Processes, monkeypatch: pytest.MonkeyPatch) -> None:
    """The drawing process takes seconds of a busy processor to start; it yields to the fleet as the recorder does."""
    monkeypatch.setenv(SWITCH, "on")
    processes.start("services.monitor", "monitor")
    log, address = processes.run / "logs/monitor.jsonl", processes.run / VIEW_FILE
    wait_for(address.exists, "somebody draws")
    lines = [msgspec.json.decode(line) for line in log.read_bytes().splitlines()]
    assert [line["event"] for line in lines if line["event"] in ("recording", "showing")] == ["recording", "showing"]
    pid = next(line["pid"] for line in lines if line["event"] == "showing")
    assert os.getpriority(os.PRIO_PROCESS, pid) == os.getpriority(os.PRIO_PROCESS, 0) + NICENESS


@pytest.mark.parametrize("attempt", range(3))
def test_a_recorder_that_is_frozen_ends_when_it_goes_on(processes: Processes, attempt: int) -> None:
    """It is told to end meanwhile; the system may hand the signal to a thread that runs no handlers."""
    monitor = processes.start("services.monitor", "monitor")
    for number in (signal.SIGSTOP, signal.SIGTERM, signal.SIGCONT):
        monitor.send_signal(number)
    assert monitor.wait(DEADLINE_S) == 0, (processes.run / "monitor.log").read_text()
    assert (processes.run / "report.json").exists()
