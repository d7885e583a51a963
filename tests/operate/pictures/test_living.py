"""The real processes of the pictures: killed, frozen, bereaved; recording goes on, and pictures
come back.
"""

import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import msgspec
import pytest
from synthetic import Run
from test_feed import eventually, spoken

from companion.tools.system import SYSTEM
from operate.file_names import TRAFFIC_FILE, VIEW_FILE
from operate.fleet_file import ViewAddress
from operate.pictures import __main__ as child
from operate.pictures import feed as feeding
from operate.pictures import server
from operate.pictures.__main__ import OverLimit
from operate.pictures.feed import Feed
from operate.pictures.server import ServerError
from operate.pictures.viewer_address import BIND, EVERY_INTERFACE, Place, opened, wanted
from operate.recording import mcap_file
from operate.recording.recorder import Recorder
from operate.recording.records import Spoken

pytestmark = [pytest.mark.long, pytest.mark.process, pytest.mark.timeout(240)]
PATIENCE_S = 60.0


def place(bind: str = "") -> Place:
    """Free ports at this interface."""
    found = wanted({BIND: bind})
    assert found is not None
    return found


def children(pid: int) -> list[int]:
    """The processes that any of its threads started."""
    files = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(word) for file in files for word in file.read_text().split()]


def lives(pid: int) -> bool:
    """Whether any of its threads runs: the first may be a zombie while another still holds the port
    open.
    """
    try:
        threads = list(Path(f"/proc/{pid}/task").iterdir())
    except OSError:
        return False
    return any(map(runs, threads))


def runs(thread: Path) -> bool:
    """Whether this thread is there, and not a zombie."""
    try:
        return (thread / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def serves(run: Path) -> bool:
    """Whether somebody listens where view.json says."""
    try:
        address = msgspec.json.decode((run / VIEW_FILE).read_bytes(), type=ViewAddress)
    except OSError:
        return False
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", address.grpc)) == 0


@pytest.mark.parametrize("bind", ["", EVERY_INTERFACE])
def test_pictures_come_back_and_nothing_is_missing_in_the_recording(
    bind: str, tmp_path: Path, pouring: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The drawing process is killed, its server is killed, the drawing process is frozen: every
    sample is recorded.
    """
    monkeypatch.setattr(feeding, "FIRST_PAUSE_S", 0.1)
    samples = iter(pouring.samples)
    feed = Feed(tmp_path, place(bind), SYSTEM, lambda event, **_: None)
    recorder = Recorder(tmp_path, SYSTEM)
    recorder.show(feed)

    def some(count: int) -> None:
        for _, sample in zip(range(count), samples, strict=False):
            recorder.take(sample)

    try:
        for whom in (0, 1):
            assert eventually(lambda: serves(tmp_path) and len(children(feed.pid)) == 1, PATIENCE_S)
            some(500)
            both = (feed.pid, *children(feed.pid))
            os.kill(both[whom], signal.SIGKILL)
            assert eventually(lambda gone=both: not any(map(lives, gone)), PATIENCE_S)
        assert eventually(lambda: serves(tmp_path) and feed.pid, PATIENCE_S)
        os.kill(feed.pid, signal.SIGSTOP)
        some(len(pouring.samples))
    finally:
        recorder.finish()
    records = mcap_file.read(tmp_path / TRAFFIC_FILE).records
    assert sum(isinstance(one, Spoken) for one in records) == len(pouring.said)
    assert not serves(tmp_path)


@pytest.fixture
def ports() -> Iterator[child.Ports]:
    """Ports that listen."""
    at = place()
    with opened(at.bind, at.grpc) as grpc, opened(at.bind, at.web) as web:
        yield grpc, web


@pytest.mark.parametrize("which", ["grpc", "web"])
def test_the_port_of_another_program_is_not_told_as_that_of_the_pictures(
    which: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The monitor says why, there is no view.json; when the port is free it is had."""
    monkeypatch.setattr(feeding, "FIRST_PAUSE_S", 0.1)
    said: list[str] = []
    with socket.create_server(("127.0.0.1", 0)) as other:
        wished = msgspec.structs.replace(place(), **{which: other.getsockname()[1]})
        say = lambda event, **fields: said.append(str(fields.get("why")))  # noqa: E731
        feed = Feed(tmp_path, wished, SYSTEM, say)
        assert eventually(lambda: said, PATIENCE_S)
        assert "Address already in use; ROCO_VIEW_GRPC and ROCO_VIEW_WEB name others" in said[0]
        assert not (tmp_path / VIEW_FILE).exists()
    try:
        assert eventually((tmp_path / VIEW_FILE).exists, PATIENCE_S)
    finally:
        feed.close()


def test_who_looks_late_sees_the_run_from_its_beginning(tmp_path: Path, pouring: Run) -> None:
    """What a viewer gets that comes in the middle of a run has all communicates so far."""
    recorder, at = Recorder(tmp_path, SYSTEM), place()
    recorder.show(Feed(tmp_path, at, SYSTEM, lambda event, **_: None))
    for sample in pouring.samples:
        recorder.take(sample)
    recorder.flush()
    saved, program = tmp_path / "live.rrd", Path(sys.executable).with_name("rerun")

    def sizes() -> int:
        """Communicates that were drawn."""
        words = [program, "rrd", "print", "-v", saved]
        done = subprocess.run(words, capture_output=True, text=True, timeout=60)
        return sum(int(rows) for rows in re.findall(r"with (\d+) rows .* - /sizes/C", done.stdout))

    try:
        assert eventually(lambda: serves(tmp_path), PATIENCE_S)
        url = f"rerun+http://127.0.0.1:{at.grpc}/proxy"
        words = [program, url, "--save", saved, "--port", str(place().grpc)]
        with subprocess.Popen(words) as viewer:
            # each has a row that stands
            every = len(spoken(pouring.samples)) + len(SYSTEM.design.channels)
            assert eventually(lambda: saved.exists() and sizes() >= every, PATIENCE_S)
            viewer.terminate()
        assert sizes() == every
    finally:
        recorder.finish()


def test_it_ends_when_nobody_looks(
    tmp_path: Path, ports: child.Ports, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not while a viewer is connected."""
    monkeypatch.setattr(child, "QUIET_S", 0.5)
    drawing = child.Child(tmp_path, ports, SYSTEM)
    out, into = os.pipe()
    found: list[int] = []
    thread = threading.Thread(target=lambda: found.append(drawing.serve(out)))
    try:
        with socket.create_connection(ports[0].getsockname()):
            assert eventually(lambda: not drawing._viewers[0].quiet_s)
            thread.start()
            thread.join(timeout=3 * child.QUIET_S)
            assert thread.is_alive()
        thread.join(timeout=PATIENCE_S)
        assert found == [0]
    finally:
        drawing.close()
        os.close(out)
        os.close(into)


@pytest.mark.parametrize(
    ("module", "limit", "error"), [(child, "OWN_MB", OverLimit), (server, "MOST_MB", ServerError)]
)
def test_a_process_above_its_limit_of_memory_ends(
    module: ModuleType,
    limit: str,
    error: type[Exception],
    tmp_path: Path,
    ports: child.Ports,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The drawing process watches its own memory and its server's and names the one too large; the
    monitor restarts both.
    """
    drawing = child.Child(tmp_path, ports, SYSTEM)
    out, into = os.pipe()
    monkeypatch.setattr(module, limit, 1.0)
    try:
        with pytest.raises(error, match="at most 1 MB"):
            drawing.serve(out)
    finally:
        drawing.close()
        os.close(out)
        os.close(into)


def test_a_monitor_that_is_killed_leaves_nobody_behind(tmp_path: Path) -> None:
    """The drawing process ends with its pipe, its server with it."""
    code = (
        "import sys, time; from pathlib import Path\n"
        "from operate.pictures.feed import Feed\n"
        "from operate.pictures.viewer_address import wanted\n"
        "from companion.tools.system import SYSTEM\n"
        "Feed(Path(sys.argv[1]), wanted({}), SYSTEM, lambda event, **_: None); time.sleep(600)"
    )
    monitor = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)])
    try:
        assert eventually(lambda: serves(tmp_path), PATIENCE_S)
        assert eventually(
            lambda: [children(one) for one in children(monitor.pid)] not in ([], [[]]), PATIENCE_S
        )
        (drawing,) = children(monitor.pid)
        (serving,) = children(drawing)
    finally:
        monitor.kill()
        monitor.wait()
    assert eventually(lambda: not lives(drawing) and not lives(serving), PATIENCE_S)
