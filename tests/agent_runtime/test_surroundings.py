"""Logs, inbox and command line: what stands around the core."""

import io
import json
import os
import threading
import time
from collections import Counter
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import msgspec
import pytest
from toy_agents import wirings
from typer.testing import CliRunner

from agent_runtime.core.wiring import Delivery
from agent_runtime.io import cli, logs, run_files
from agent_runtime.io.inbox import BOUNDS, MOST_BYTES, Class, Inbox
from agent_runtime.io.logs import MORE, SINGLY, Log
from agent_runtime.io.options import Options
from agent_runtime.io.run_files import PERIOD_S, ProcessHeartbeat, Turns
from agent_runtime.io.zenoh_wire import KNOWN_KEYS, ZenohWire


def read(file: Path) -> list[dict[str, Any]]:
    """The lines of a log."""
    return [json.loads(line) for line in file.read_text().splitlines()]


def test_a_log_line_is_json_in_the_file_and_short_on_the_console(tmp_path: Path) -> None:
    """The file has every line with its fields; the console what the level asks for, conversation
    last.
    """
    console, file = io.StringIO(), tmp_path / "logs" / "ta.jsonl"
    log = Log("ta", "info", file, console)
    log.write("sent", performative="inform", peer="co", bytes=None, conversation="co-1-4")
    log.write("detail", "debug", x=1)
    log.write("garbled", "warning", why="no communicate")
    log.close()
    lines = read(file)
    assert [line["event"] for line in lines] == ["sent", "detail", "garbled"]
    assert all(line["agent"] == "ta" and line["t"] > 0 for line in lines)
    assert lines[0]["conversation"] == "co-1-4"
    first, second = console.getvalue().splitlines()
    assert first.split(maxsplit=1)[1] == "ta     sent performative=inform peer=co co-1-4"
    assert "! garbled" in second


def test_the_inbox_is_bounded_for_each_sender_and_class() -> None:
    """Beyond its bound a sender's is dropped and counted, others' is not; the own side's never;
    taking makes room. With no entry, also for a time in the past: None at once.
    """
    inbox, most = Inbox(), BOUNDS[Class.STREAM].waiting
    assert inbox.get(-5.0) is None
    taken = [inbox.put(Class.STREAM, number, "a") for number in range(most + 2)]
    assert taken.count(False) == 2
    assert inbox.dropped == {"stream of a": 2}
    assert inbox.put(Class.STREAM, "b's", "b")
    assert all(inbox.put(Class.OWN, None) for _ in range(5000))
    assert inbox.get(0.0) == 0
    assert inbox.put(Class.STREAM, "again", "a")


def test_long_messages_take_bounded_memory() -> None:
    """So many bytes of a sender wait, and no more, however few messages they are."""
    inbox = Inbox()
    taken = [inbox.put(Class.VOLATILE, n, "a", MOST_BYTES // 4) for n in range(8)]
    assert taken == [True] * 4 + [False] * 4
    assert not inbox.put(Class.CONTROL, "receipt", "a", MOST_BYTES + 1)
    assert inbox.put(Class.VOLATILE, "b's", "b", MOST_BYTES)


def test_senders_are_served_in_turns() -> None:
    """A flood waits behind itself: another's first is taken second, each in the order in which it
    was said.
    """
    inbox = Inbox()
    for number in range(50):
        inbox.put(Class.STREAM, ("flood", number), "a")
    for number in range(3):
        inbox.put(Class.STREAM, ("few", number), "b")
    order = [inbox.get(0.0) for _ in range(53)]
    assert [order.index(("few", number)) for number in range(3)] == [1, 3, 5]
    assert [number for who, number in order if who == "flood"] == list(range(50))
    assert inbox.get(0.0) is None
    assert inbox.idle


def test_of_receipts_the_newest_are_kept() -> None:
    """A receipt is for all before it, so the oldest is dropped."""
    inbox = Inbox()
    for number in range(1000):
        assert inbox.put(Class.CONTROL, number, "a")
    kept = BOUNDS[Class.CONTROL].waiting
    assert [inbox.get(0.0) for _ in range(kept + 1)] == [*range(1000 - kept, 1000), None]
    assert inbox.idle


def test_a_sender_within_its_rate_is_admitted_and_beyond_it_not() -> None:
    """A burst, then what the rate gives; others and the own side are not touched by it."""
    inbox, bound = Inbox(), BOUNDS[Class.STREAM]
    began = time.monotonic()
    admitted = sum(inbox.admits(Class.STREAM, "a") for _ in range(100_000))
    took = time.monotonic() - began
    assert bound.burst <= admitted <= bound.burst + bound.rate * took + 1
    assert inbox.dropped["stream of a"] == 100_000 - admitted
    assert inbox.admits(Class.STREAM, "b")
    assert all(inbox.admits(Class.OWN, "") for _ in range(100_000))


def test_a_flood_of_reproaches_is_told_as_a_sum(tmp_path: Path) -> None:
    """The first of each kind singly, the rest as a number; what reproaches nobody, and other kinds,
    are all there.
    """
    log = Log("ta", "warning", tmp_path / "ta.jsonl", io.StringIO())
    for number in range(10_000):
        log.write("forged", "warning", key="roco/x", why=str(number))
    log.write("forged", "warning", key="roco/y")
    for number in range(100):
        log.write("sent", peer="co", id=str(number))
    log.close()
    lines = read(tmp_path / "ta.jsonl")
    told = Counter(line["event"] for line in lines)
    assert told == {"forged": SINGLY + 1, "sent": 100, MORE: 1}
    assert f"… {10_000 - SINGLY:,} more of this kind from roco/x in 10 s" in lines[-1]["why"]


def test_a_log_takes_bounded_space(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full file becomes FILE.1, and no line is lost before that is replaced; a later start goes
    on in the same.
    """
    monkeypatch.setattr(logs, "MOST_BYTES", 10_000)
    file = tmp_path / "ta.jsonl"
    for count in (60, 60, 1000):
        log = Log("ta", "error", file)
        for number in range(count):
            log.write("sent", id=str(number))
        log.close()
    assert sum(one.stat().st_size for one in tmp_path.iterdir()) < 21_000
    ids = [line["id"] for line in (*read(logs.before(file)), *read(file))]
    assert ids[-100:] == [str(number) for number in range(900, 1000)]


def test_what_comes_on_a_key_is_classed_by_its_link_and_strangers_fill_no_memory() -> None:
    """Durable links are streams, all else may be dropped sooner; the number of kept keys is
    bounded.
    """
    for delivery, kind in ((Delivery.DURABLE, Class.STREAM), (Delivery.VOLATILE, Class.VOLATILE)):
        _, to_asker = wirings(delivery)
        (link,) = to_asker.links
        inbox = Inbox()
        wire = ZenohWire(MagicMock(), to_asker, 1, inbox)

        def hear(peer: str, protocol: str, act: str, wire: Any = wire, link: Any = link) -> None:
            key = f"roco/toy/{link.channel}/{peer}/server/{protocol}/{act}"
            wire._on_communicate(MagicMock(key_expr=key, attachment=None))

        for act in ("request", "request", *map(str, range(KNOWN_KEYS + 5))):
            hear(link.peer, link.protocol, act)
        assert set(inbox._lanes) == {(kind, link.peer)}
        assert len(wire._known) == KNOWN_KEYS
        hear("stranger", "x", "request")
        assert inbox._lanes[Class.VOLATILE, "stranger"]


@pytest.fixture(autouse=True)
def _no_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("CONNECT", "LISTEN", "SYSTEM", "RUN_DIR", "LOG_LEVEL", "SPEED", "SEED", "SCENE"):
        monkeypatch.delenv(f"ROCO_{name}", raising=False)


def parsed(
    arguments: list[str], environment: dict[str, str] | None = None
) -> tuple[int, Options | None]:
    """Exit status, and what a service would get."""
    got: list[Options] = []
    result = CliRunner().invoke(cli.app("x", "A service.", got.append), arguments, env=environment)
    return result.exit_code, got[0] if got else None


def test_defaults_variables_and_options() -> None:
    """Nothing said: the defaults; a variable is heard; an option wins over it."""
    assert parsed([]) == (0, Options())
    variables = {"ROCO_SYSTEM": "robot1", "ROCO_SPEED": "max", "ROCO_SEED": "7", "ROCO_SCENE": ""}
    assert parsed([], variables) == (0, Options(system="robot1", speed="max", seed=7))
    words = ["--system", "robot2", "--run-dir", "r", "--scene", "s.toml"]
    given = {"run_dir": Path("r"), "scene": Path("s.toml")}
    assert parsed(words, variables) == (0, Options(system="robot2", speed="max", seed=7, **given))


def test_a_wrong_option_is_status_2() -> None:
    """Status 2 is one that no supervisor retries; else the status is what the service returns."""
    for words in (["--speed", "fast"], ["--seed", "x"], ["--nothing"], ["--log-level", "loud"]):
        assert parsed(words) == (2, None), words
    assert CliRunner().invoke(cli.app("x", "A service.", lambda options: 3), []).exit_code == 3


# --- The heartbeat of router, recorder and loop: it follows what gets on, and stops with it -------


@pytest.fixture
def clock(monkeypatch):
    """Time as the test says."""
    now = [100.0]
    monkeypatch.setattr(run_files.time, "monotonic", lambda: now[0])
    return now


def aged(file):
    """Make a heartbeat an old one; its time then."""
    os.utime(file, (1.0, 1.0))
    return 1.0


def test_whoever_supervises_finds_the_process(tmp_path):
    """By its id, in the form that an agent's heartbeat has it."""
    beat = ProcessHeartbeat(tmp_path, "router")
    assert beat.file == tmp_path / "router.heartbeat.json"
    assert msgspec.json.decode(beat.file.read_bytes()) == {"name": "router", "pid": os.getpid()}


def test_a_beat_renews_the_time_and_nothing_else(tmp_path, clock):
    """Its reader compares times; its text stays whole at any moment."""
    beat = ProcessHeartbeat(tmp_path, "router")
    text, old = beat.file.read_bytes(), aged(beat.file)
    beat.beat()
    assert beat.file.stat().st_mtime > old
    assert beat.file.read_bytes() == text


def test_it_beats_once_in_a_period_however_often_it_is_asked(tmp_path, clock):
    """A loop asks in each turn."""
    beat = ProcessHeartbeat(tmp_path, "router")
    beat.beat()
    old = aged(beat.file)
    clock[0] += PERIOD_S * 0.9
    beat.beat()
    assert beat.file.stat().st_mtime == old
    clock[0] += PERIOD_S * 0.2
    beat.beat()
    assert beat.file.stat().st_mtime > old


def test_a_heartbeat_that_was_removed_comes_back(tmp_path, clock):
    """Tidying a run folder ends nobody."""
    beat = ProcessHeartbeat(tmp_path, "router")
    beat.file.unlink()
    beat.beat()
    assert beat.file.exists()


class Counting:
    """Stands for the file: says when it was asked to beat."""

    def __init__(self):
        self.beats, self.asked = 0, threading.Event()

    def beat(self):
        self.beats += 1
        self.asked.set()


def test_turns_that_go_on_beat_and_a_loop_that_stands_still_does_not():
    """However long the thread looks on."""
    counting = Counting()
    turns = Turns(counting, period_s=0.01)
    end = time.monotonic() + 20.0
    while counting.beats < 3 and time.monotonic() < end:
        counting.asked.clear()
        turns.count += 1
        assert counting.asked.wait(10.0)
    assert counting.beats >= 3
    before, looks = counting.beats, threading.Event()
    assert not looks.wait(0.2)  # twenty looks of the thread without a turn
    assert counting.beats <= before + 1
    turns.end()


def test_it_ends_when_told(tmp_path):
    """No thread is left behind."""
    turns = Turns(ProcessHeartbeat(tmp_path, "loop"), period_s=0.01)
    turns.end()
    assert not any(thread.name == "pulse" for thread in threading.enumerate())
