"""The feed never holds who feeds it: a bounded queue, and children that read nothing, die, or never
start. None is started before somebody looks.
"""

import os
import shutil
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import Run

from agent_runtime.io.tap import Sample
from companion.tools.system import SYSTEM
from operate.file_names import TRAFFIC_FILE, VERDICTS_FILE, VIEW_FILE
from operate.pictures import feed as feeding
from operate.pictures.__main__ import Past
from operate.pictures.feed import OVERHEAD, Feed, Queue
from operate.pictures.viewer_address import Place, ViewSettingError, wanted
from operate.recording.happenings import Reader
from operate.recording.recorder import Recorder
from operate.recording.records import Spoken, understood
from operate.verdict_lines import Judged

PYTHON = (sys.executable, "-c")
IGNORES = "import signal, socket, sys, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); "
READS_NOTHING = (*PYTHON, "import time; time.sleep(600)")
DEAF = (*PYTHON, IGNORES + "print('deaf', flush=True); time.sleep(600)")
LEAVES = (*PYTHON, "import socket, sys; socket.socket(fileno=int(sys.argv[1])).accept()")
"""Takes the viewer, and ends in order."""
DIES = (*PYTHON, "raise SystemExit(3)")
COPIES = (
    *PYTHON,
    IGNORES + "socket.socket(fileno=int(sys.argv[2])).accept(); "
    "open(sys.argv[1], 'wb').write(sys.stdin.buffer.read())",
)
"""Takes the viewer, and writes what it is fed to a file."""


def eventually(look: object, within_s: float = 20.0) -> bool:
    """Whether `look()` is true before long."""
    end = time.monotonic() + within_s
    waiting = threading.Event()
    while time.monotonic() < end:
        if look():
            return True
        waiting.wait(0.02)
    return False


@pytest.fixture
def place() -> Place:
    """Free ports."""
    found = wanted({})
    assert found is not None
    return found


@pytest.fixture
def look(place: Place) -> Iterator[None]:
    """A viewer, which connects as soon as the ports are open."""

    def connect() -> None:
        assert eventually(lambda: viewer.connect_ex((place.bind, place.grpc)) == 0)

    with ExitStack() as stack:
        viewer = stack.enter_context(socket.socket())
        thread = threading.Thread(target=connect)
        thread.start()
        yield
        thread.join()


Begin = Callable[[tuple[str, ...]], tuple[Feed, list[str]]]


@pytest.fixture
def begin(tmp_path: Path, place: Place, monkeypatch: pytest.MonkeyPatch) -> Iterator[Begin]:
    """Begins a feed of a child with this command, and keeps what it says of it. Pauses are
    short.
    """
    monkeypatch.setattr(feeding, "FIRST_PAUSE_S", 0.02)
    monkeypatch.setattr(feeding, "LONGEST_PAUSE_S", 0.05)
    with ExitStack() as stack:

        def feed(command: tuple[str, ...]) -> tuple[Feed, list[str]]:
            said: list[str] = []
            say = lambda event, **_: said.append(event)  # noqa: E731
            begun = Feed(tmp_path, place, SYSTEM, say, command=command)
            return stack.enter_context(closing(begun)), said

        yield feed


def heard(data: bytes) -> feeding.Heard:
    """A sample with these bytes."""
    return feeding.Heard(Sample("", data, 1.0))


@given(
    st.lists(st.one_of(st.binary(max_size=300), st.integers(1, 900)), max_size=80),
    st.integers(600, 6000),
)
def test_the_queue_is_bounded_and_keeps_the_newest_in_order(
    steps: list[bytes | int], most: int
) -> None:
    """Bytes put and taken at will: never more than `most` wait; what is dropped is older than all
    that is left.
    """
    queue, put, got = Queue(most), 0, list[int]()
    for step in steps:
        if isinstance(step, bytes):
            data = put.to_bytes(4, "big") + step
            queue.put(heard(data), len(data))
            put += 1
        else:
            got += numbers(queue.take(step))
        assert 0 <= queue.bytes <= most
    left = numbers(queue.take(10**9))
    assert got + left == sorted(got + left)
    assert len(got) + len(left) + queue.dropped == put
    assert left == list(range(put - len(left), put))
    assert queue.bytes == 0
    queue.put(heard(b""), most + 1 - OVERHEAD)  # larger than all room
    assert (queue.take(), queue.bytes) == ([], 0)


def numbers(items: list[feeding.Item]) -> list[int]:
    """What the samples begin with."""
    samples = [item.sample for item in items if isinstance(item, feeding.Heard)]
    return [int.from_bytes(sample.data[:4], "big") for sample in samples]


@given(st.lists(st.integers(1, 60), max_size=40))
def test_frames_come_whole_however_they_are_cut(cuts: list[int]) -> None:
    """Items out are the items in."""
    items: list[feeding.Item] = [feeding.Heard(Sample("k", b"d" * n, float(n))) for n in cuts] + [
        feeding.Missed(1.0, 2)
    ]
    data = b"".join(feeding.framed(feeding.encode(item)) for item in items)
    frames, found = feeding.Frames(), list[feeding.Item]()
    while data:
        cut = cuts[len(found) % len(cuts)] if cuts else 1
        found += frames.feed(data[:cut])
        data = data[cut:]
    assert found == items
    # something else than frames is not waited for
    with pytest.raises(ValueError, match="not a pipe of the monitor"):
        feeding.Frames().feed(b"\xff\xff\xff\xff")


@pytest.mark.usefixtures("look")
def test_a_child_that_reads_nothing_holds_nobody(begin: Begin) -> None:
    """300 MB are fed to it: no call waits, memory stays within queue and batch, the rest is counted
    as dropped.
    """
    sample = Sample("roco/x", os.urandom(100_000), 1.0)
    feed, _ = begin(READS_NOTHING)
    assert eventually(lambda: feed.pid)
    before, longest = _rss(), 0.0
    for _ in range(3000):
        start = time.thread_time()
        feed.heard(sample)
        longest = max(longest, time.thread_time() - start)
    assert feed.dropped > 2500
    assert _rss() - before < feeding.QUEUE_BYTES + 4 * feeding.BATCH_BYTES + 8e6
    assert longest < 0.02
    feed.close()
    assert not feed.pid


@pytest.mark.usefixtures("look")
def test_a_child_that_does_not_follow_is_killed(
    tmp_path: Path, begin: Begin, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It ignores SIGTERM and is frozen besides; the end comes in time."""
    monkeypatch.setattr(feeding, "END_S", 0.5)
    feed, _ = begin(DEAF)
    log = tmp_path / "rerun.log"
    assert eventually(lambda: log.exists() and "deaf" in log.read_text())
    pid = feed.pid
    os.kill(pid, signal.SIGSTOP)
    feed.close()
    assert not Path(f"/proc/{pid}").exists()


@pytest.mark.usefixtures("look")
def test_a_child_that_dies_is_started_anew_and_said(begin: Begin) -> None:
    """After a pause, again and again, as long as a viewer waits."""
    _, said = begin(DIES)
    assert eventually(lambda: said.count("showing") > 2)
    assert "no pictures for now" in said


@pytest.mark.usefixtures("look")
def test_where_nobody_looks_any_more_it_waits_for_the_next_viewer(
    begin: Begin, place: Place
) -> None:
    """A child that ends in order is no failure, though more was fed to it meanwhile."""
    feed, said = begin(LEAVES)
    for times in (1, 2):
        fed = lambda: feed.heard(Sample("k", b"d", 1.0)) or said.count("nobody looks")  # noqa: E731
        assert eventually(lambda: fed() == times)  # noqa: B023
        assert said == ["showing", "nobody looks"] * times
        with socket.create_connection((place.bind, place.grpc)):
            pass


@pytest.mark.usefixtures("look")
def test_a_program_that_is_not_there_holds_nobody(begin: Begin) -> None:
    """It is said, and feeding goes on."""
    feed, said = begin(("/nowhere/at/all",))
    assert eventually(lambda: "no pictures for now" in said)
    feed.heard(Sample("k", b"d", 1.0))


def test_nothing_is_drawn_before_somebody_looks(tmp_path: Path, begin: Begin, place: Place) -> None:
    """The ports are open and told, no child runs, and of what is fed only the last seconds are
    kept.
    """
    feed, said = begin(READS_NOTHING)
    assert eventually((tmp_path / VIEW_FILE).exists)
    for _ in range(100):
        feed.heard(Sample("roco/x", b"", 1.0))
    feed._queue.forget(0.0)
    assert (feed.pid, feed.dropped, feed._queue.bytes, said) == (0, 0, 0, [])
    with socket.create_connection((place.bind, place.web)):
        assert eventually(lambda: feed.pid)
    feed.close()
    with socket.socket() as probe:
        assert probe.connect_ex((place.bind, place.grpc)) != 0


def test_each_sample_is_in_the_recording_or_fed(
    tmp_path: Path, begin: Begin, place: Place, pouring: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whenever somebody looks: each is drawn once, from the one or the other; also one that was
    logged late.
    """
    monkeypatch.setattr(feeding, "RECENT_S", 0.0)
    (feed, _), recorder = begin((*COPIES, str(tmp_path / "fed"))), Recorder(tmp_path, SYSTEM)
    recorder.show(feed)
    samples, half = list(pouring.samples), len(pouring.samples) // 2
    late = samples.pop(next(k for k in range(half - 1, 0, -1) if spoken([samples[k]])))
    assert eventually((tmp_path / VIEW_FILE).exists)
    for sample in samples[:half]:
        recorder.take(sample)
    recorder.flush()
    monkeypatch.setattr(feeding, "RECENT_S", 60.0)
    recorder.take(samples[half])
    with socket.create_connection((place.bind, place.grpc)):
        assert eventually(lambda: feed.pid)
        for sample in samples[half + 1 :]:
            recorder.take(sample)
        recorder.flush()
        then = tmp_path / "then"  # when the child reads it
        then.mkdir()
        for name in (TRAFFIC_FILE, VERDICTS_FILE):
            shutil.copy(tmp_path / name, then)
        recorder.take(late)
        assert eventually(lambda: not feed._queue.bytes)
        recorder.finish()
    since, *fed = feeding.Frames().feed((tmp_path / "fed").read_bytes())
    assert isinstance(since, feeding.Since)
    past = Past(since.at)
    recorded = [one.what for one in past.read(then, SYSTEM, Reader(SYSTEM))]
    before = [one for one in recorded if isinstance(one, Spoken)]
    samples = [item.sample for item in fed if isinstance(item, feeding.Heard)]
    after = spoken([one for one in samples if not past.has(one.at)])
    assert before
    assert after
    found = sorted((one.received, one.identity) for one in (*before, *after))
    assert found == sorted((one.received, one.identity) for one in spoken(pouring.samples))
    told = [item.judged for item in fed if isinstance(item, feeding.ShownVerdict)]
    judged = [one for one in told if not past.judged(one)]
    judged += [one for one in recorded if isinstance(one, Judged)]
    lines = (tmp_path / VERDICTS_FILE).read_bytes().splitlines()
    written = [msgspec.json.decode(line, type=Judged) for line in lines]
    assert sorted(judged, key=repr) == sorted(written, key=repr)


def spoken(samples: list[Sample]) -> list[Spoken]:
    """The communicates among them."""
    return [record for one in samples if isinstance(record := understood(one, SYSTEM), Spoken)]


def test_where_pictures_are_served_is_the_environments_word() -> None:
    """On by default, on loopback, at free ports; several systems side by side; wrong words are
    named.
    """
    assert wanted({"ROCO_VIEW": "off"}) is None
    place = wanted({})
    assert place is not None
    assert place.bind == "127.0.0.1"
    assert 0 < place.grpc != place.web > 0
    fixed = {"ROCO_VIEW_BIND": "0.0.0.0", "ROCO_VIEW_GRPC": "9876", "ROCO_VIEW_WEB": "9090"}
    for k in (0, 1):
        assert wanted(fixed, k) == Place("0.0.0.0", 9876 + k, 9090 + k)
    for wrong in ({"ROCO_VIEW": "perhaps"}, {"ROCO_VIEW_WEB": "web"}, {"ROCO_VIEW_GRPC": "70000"}):
        with pytest.raises(ViewSettingError, match=next(iter(wrong))):
            wanted(wrong)


def _rss() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
