"""The feed never holds who feeds it: a bounded queue, and children that read nothing, die, or never start."""

import os
import signal
import sys
import threading
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent_runtime.io.tap import Sample
from companion.tools.system import SYSTEM
from operate.pictures import feed as feeding
from operate.pictures import wire
from operate.pictures.feed import OVERHEAD, Feed, Queue
from operate.pictures.viewer_address import Place, ViewSettingError, wanted

PLACE = Place("127.0.0.1", 1, 2)
READS_NOTHING = (sys.executable, "-c", "import time; time.sleep(600)")
DEAF = (
    sys.executable,
    "-c",
    "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('deaf', flush=True); time.sleep(600)",
)
DIES = (sys.executable, "-c", "raise SystemExit(3)")


def quiet(event: str, **fields: object) -> None:
    """Nobody listens."""


def eventually(look: object, within_s: float = 20.0) -> bool:
    """Whether `look()` is true before long."""
    end = time.monotonic() + within_s
    waiting = threading.Event()
    while time.monotonic() < end:
        if look():
            return True
        waiting.wait(0.02)
    return False


@given(st.lists(st.one_of(st.binary(max_size=300), st.integers(1, 900)), max_size=80), st.integers(200, 2000))
def test_the_queue_is_bounded_and_keeps_the_newest_in_order(steps: list[bytes | int], most: int) -> None:
    """Bytes put and taken at will: never more than `most` wait; what is dropped is older than all that is left."""
    queue, put, got = Queue(most), 0, list[int]()
    for step in steps:
        if isinstance(step, bytes):
            queue.put(put.to_bytes(4, "big") + step)
            put += 1
        else:
            got += [int.from_bytes(item[:4], "big") for item in queue.take(step)]
        assert 0 <= queue.bytes <= most
    left = [int.from_bytes(item[:4], "big") for item in queue.take(10**9)]
    assert got + left == sorted(got + left)
    assert len(got) + len(left) + queue.dropped == put
    assert left == list(range(put - len(left), put))
    assert queue.bytes == 0


def test_an_item_larger_than_all_room_is_dropped() -> None:
    """And counted."""
    queue = Queue(1000)
    queue.put(b"x" * (1001 - OVERHEAD))
    assert (queue.take(), queue.dropped, queue.bytes) == ([], 1, 0)


@given(st.lists(st.integers(1, 60), max_size=40))
def test_frames_come_whole_however_they_are_cut(cuts: list[int]) -> None:
    """Items out are the items in."""
    items: list[wire.Item] = [wire.Heard(Sample("k", b"d" * n, float(n))) for n in cuts] + [wire.Missed(1.0, 2)]
    data = b"".join(wire.framed(wire.encode(item)) for item in items)
    frames, found = wire.Frames(), list[wire.Item]()
    while data:
        cut = cuts[len(found) % len(cuts)] if cuts else 1
        found += frames.feed(data[:cut])
        data = data[cut:]
    assert found == items


def test_something_else_than_frames_is_said() -> None:
    """Not waited for."""
    with pytest.raises(ValueError, match="not a pipe of the monitor"):
        wire.Frames().feed(b"\xff\xff\xff\xff")


def test_a_child_that_reads_nothing_holds_nobody(tmp_path: Path) -> None:
    """300 MB are fed to it: no call waits, memory stays within queue and batch, the rest is counted as dropped."""
    sample = Sample("roco/x", os.urandom(100_000), 1.0)
    feed = Feed(tmp_path, PLACE, SYSTEM, quiet, command=READS_NOTHING)
    try:
        assert eventually(lambda: feed.pid)
        before, longest = _rss(), 0.0
        for _ in range(3000):
            begin = time.thread_time()
            feed.heard(sample)
            longest = max(longest, time.thread_time() - begin)
        assert feed.dropped > 2500
        assert _rss() - before < feeding.QUEUE_BYTES + 4 * feeding.BATCH_BYTES + 8e6
        assert longest < 0.02
    finally:
        feed.close()
    assert not feed.pid


def test_a_child_that_does_not_follow_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It ignores SIGTERM and is frozen besides; the end comes in time."""
    monkeypatch.setattr(feeding, "END_S", 0.5)
    feed = Feed(tmp_path, PLACE, SYSTEM, quiet, command=DEAF)
    assert eventually(lambda: (tmp_path / "rerun.log").exists() and "deaf" in (tmp_path / "rerun.log").read_text())
    pid = feed.pid
    os.kill(pid, signal.SIGSTOP)
    feed.close()
    assert not Path(f"/proc/{pid}").exists()


def test_a_child_that_dies_is_started_anew_and_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a pause, again and again."""
    monkeypatch.setattr(feeding, "FIRST_PAUSE_S", 0.02)
    monkeypatch.setattr(feeding, "LONGEST_PAUSE_S", 0.05)
    said: list[str] = []
    feed = Feed(tmp_path, PLACE, SYSTEM, lambda event, **_: said.append(event), command=DIES)
    try:
        assert eventually(lambda: said.count("showing") > 2)
        assert "no pictures for now" in said
    finally:
        feed.close()


def test_a_program_that_is_not_there_holds_nobody(tmp_path: Path) -> None:
    """It is said, and feeding goes on."""
    said: list[str] = []
    feed = Feed(tmp_path, PLACE, SYSTEM, lambda event, **_: said.append(event), command=("/nowhere/at/all",))
    assert eventually(lambda: "no pictures for now" in said)
    feed.heard(Sample("k", b"d", 1.0))
    feed.close()


def test_where_pictures_are_served_is_the_environments_word() -> None:
    """On by default, on loopback, at free ports; several systems side by side; wrong words are named."""
    assert wanted({"ROCO_VIEW": "off"}) is None
    place = wanted({})
    assert place is not None
    assert place.bind == "127.0.0.1"
    assert 0 < place.grpc != place.web > 0
    fixed = {"ROCO_VIEW_BIND": "0.0.0.0", "ROCO_VIEW_GRPC": "9876", "ROCO_VIEW_WEB": "9090"}
    assert [wanted(fixed, k) for k in (0, 1)] == [Place("0.0.0.0", 9876, 9090), Place("0.0.0.0", 9877, 9091)]
    for wrong in ({"ROCO_VIEW": "perhaps"}, {"ROCO_VIEW_WEB": "web"}, {"ROCO_VIEW_GRPC": "70000"}):
        with pytest.raises(ViewSettingError, match=next(iter(wrong))):
            wanted(wrong)


def _rss() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
