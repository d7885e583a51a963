"""The recorder as a process: what agents log is recorded, though it is killed in between; it works
with what the fleet leaves of the processor, and makes its report as everybody else works.
"""

import os
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh
from test_traffic import POUR
from toy_fleet import DEADLINE_S, Fleet, service, wait_for

from agent_runtime.io.sessions import client_config
from agent_runtime.io.steplog import StepLogs
from fipa_codec.communicate import Communicate
from operate.file_names import TRAFFIC_FILE, VIEW_FILE
from operate.pictures.viewer_address import SWITCH
from operate.recording import mcap_file
from operate.recording.recorder import NICENESS
from operate.recording.records import Garbage, House, Spoken

pytestmark = pytest.mark.zenoh
STATE = "roco/roco/_/state/co"
RECORDS = mcap_file.read(POUR / TRAFFIC_FILE).records
SAID = [*{one.identity: one.communicate for one in RECORDS if isinstance(one, Spoken)}.values()]
Monitor = Callable[[Fleet], "subprocess.Popen[bytes]"]


@pytest.fixture
def monitor() -> Iterator[Monitor]:
    """Starts recorders."""
    made: list[subprocess.Popen[bytes]] = []

    def start(fleet: Fleet) -> "subprocess.Popen[bytes]":
        (fleet.run / "monitor.ready").unlink(missing_ok=True)
        log = fleet.run / "monitor.log"
        made.append(service("monitor", log, CONNECT=fleet.endpoint, RUN_DIR=fleet.run))
        return made[-1]

    yield start
    for process in made:
        process.kill()
        process.wait()


def ends(process: "subprocess.Popen[bytes]", *numbers: signal.Signals) -> None:
    """It ends in order after these signals."""
    for number in numbers:
        process.send_signal(number)
    assert process.wait(DEADLINE_S) == 0


def recorded(run: Path, kind: type) -> int:
    """Return the number of records of a kind that are readable now."""
    return sum(isinstance(record, kind) for record in mcap_file.read(run / TRAFFIC_FILE).records)


def test_a_recorder_reads_everything_dies_and_comes_back(router: Fleet, monitor: Monitor) -> None:
    """All that agents logged is in the recording once, also what they logged while none lived;
    SIGTERM leaves report, page and pictures.
    """
    run, logs = router.run, StepLogs(router.run)

    def say(some: list[Communicate]) -> None:
        for one in some:
            logs.passed(msgspec.structs.replace(one, sent=time.time()), time.time())

    first = monitor(router)
    say(SAID[:200])
    logs.garbled("roco/roco/C1/co/ta/coordinate/request", "no communicate", time.time())
    wait_for(lambda: recorded(run, Spoken) == 200, "what was said is flushed")
    assert recorded(run, Garbage) == 1
    first.kill()
    first.wait()
    say(SAID[200:300])
    second = monitor(router)
    say(SAID[300:400])
    wait_for(lambda: recorded(run, Spoken) == 400, "the rest is flushed")
    ends(second, signal.SIGTERM)
    assert recorded(run, Spoken) == 400
    told = msgspec.json.decode((run / "report.json").read_bytes())
    assert (told["communicates"]["total"], told["communicates"]["garbage"]) == (400, 1)
    assert told["holes"] == []
    for name in ("report.html", "run.rrd", "live.jsonl"):
        assert (run / name).stat().st_size


def test_a_recorder_needs_no_router(tmp_path: Path, monitor: Monitor) -> None:
    """What agents logged is recorded before it is there; heartbeats once it is."""
    fleet, logs = Fleet(tmp_path), StepLogs(tmp_path)
    try:
        logs.passed(SAID[0], SAID[0].sent)
        monitor(fleet)
        wait_for(lambda: recorded(tmp_path, Spoken) == 1, "the first is recorded")
        fleet.start("router")
        wait_for((tmp_path / "monitor.ready").exists, "the recorder reached the router")
        with zenoh.open(client_config(fleet.endpoint)) as session:
            told = lambda: session.put(STATE, b"{}") or recorded(tmp_path, House) > 1  # noqa: E731
            wait_for(told, "a heartbeat is recorded")
        logs.passed(SAID[1], SAID[1].sent)
        wait_for(lambda: recorded(tmp_path, Spoken) == 2, "the second is recorded")
    finally:
        fleet.end()


def test_a_recorder_records_before_it_shows(
    router: Fleet, monitor: Monitor, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is drawn before a viewer connects; who draws yields to the fleet as the recorder
    does.
    """
    monkeypatch.setenv(SWITCH, "on")
    monitor(router)
    log, address = router.run / "logs/monitor.jsonl", router.run / VIEW_FILE

    def events() -> list[dict[str, Any]]:
        lines = [msgspec.json.decode(line) for line in log.read_bytes().splitlines()]
        return [line for line in lines if line["event"] in ("recording", "showing")]

    wait_for(address.exists, "the ports are open")
    assert [one["event"] for one in events()] == ["recording"]
    with socket.create_connection(("127.0.0.1", msgspec.json.decode(address.read_bytes())["grpc"])):
        wait_for(lambda: len(events()) == 2, "somebody draws")
    recording, showing = events()
    assert (recording["event"], showing["event"]) == ("recording", "showing")
    usual = os.getpriority(os.PRIO_PROCESS, 0)
    assert os.getpriority(os.PRIO_PROCESS, showing["pid"]) == usual + NICENESS


def test_a_recorder_that_is_frozen_ends_when_it_goes_on(router: Fleet, monitor: Monitor) -> None:
    """It is told to end meanwhile; the system may hand the signal to a thread that runs no
    handlers.
    """
    process = monitor(router)
    wait_for((router.run / "monitor.ready").exists, "it records")
    ends(process, signal.SIGSTOP, signal.SIGTERM, signal.SIGCONT)
    assert (router.run / "report.json").exists()


def threads(pid: int) -> dict[str, int]:
    """Niceness of each thread; the first is the one that began."""
    files = sorted(Path(f"/proc/{pid}/task").glob("*/stat"), key=lambda file: int(file.parent.name))
    fields = {file.parent.name: file.read_text().rpartition(")")[2].split() for file in files}
    return {thread: int(values[16]) for thread, values in fields.items()}


def test_who_records_gives_way_and_who_reports_does_not(router: Fleet, monitor: Monitor) -> None:
    """The threads that hear and write are nicer than the fleet's, the first one, which makes the
    report, is not. A signal reaches the thread that writes all the same, and the file is closed.
    """
    process, file = monitor(router), router.run / TRAFFIC_FILE
    wait_for((router.run / "monitor.ready").exists, "it records")
    found, fleet = threads(process.pid), threads(router.processes["router"].pid)
    usual = next(iter(fleet.values()))
    assert found.pop(str(process.pid)) == usual
    assert found
    assert set(found.values()) == {usual + NICENESS}
    with zenoh.open(client_config(router.endpoint)) as session:
        told = lambda: session.put(STATE, b"{}") or b"house/state" in file.read_bytes()  # noqa: E731
        wait_for(told, "it is written")
    ends(process, signal.SIGTERM)
    assert file.read_bytes().endswith(b"\x89MCAP0\r\n")
