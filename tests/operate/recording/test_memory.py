"""Memory used for recorded traffic is bounded: a fleet is watched for weeks."""

import gc
import tracemalloc
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent_runtime.io.logs import SINGLY
from agent_runtime.io.tap import Sample
from companion.design import DESIGN
from companion.tools import live as tools_live
from companion.tools.system import SYSTEM
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative
from operate.file_names import LIVE_FILE, TRAFFIC_FILE, VERDICTS_FILE
from operate.judging import live
from operate.live_lines import Against, Happened, LiveLine
from operate.recording import mcap_file, recorder
from operate.recording.recorder import Recorder
from operate.recording.records import Garbage, Spoken, understood
from operate.recording.run import Run
from operate.verdict_lines import Judged
from topdown.judge import conversations
from topdown.judge.conversations import Remembered

RECORDED = Path(__file__).parents[2] / "histories" / "pour_seed_7"
PAUSE_S = 1.0
"""Between two conversations: 60 s after their ends as many are kept as in 60 s begin."""
BLOCK = 100
"""Conversations between two looks at the memory; more than are kept."""


class Again:
    """A conversation said again and again, under names and numbers of its own each time."""

    def __init__(self, said: list[Spoken]) -> None:
        self._said, self._numbers, self._times = said, Counter[str](), 0

    def block(self, of: int = BLOCK) -> Iterator[Sample]:
        """So many of them."""
        for _ in range(of):
            self._times += 1
            labels = {"": ""}
            for k, one in enumerate(self._said):
                at = 1e9 + self._times * PAUSE_S + 0.001 * k
                yield self._renamed(one.communicate, labels, at)

    def _renamed(self, old: Communicate, labels: dict[str, str], at: float) -> Sample:
        self._numbers[old.sender] += 1
        number = str(self._numbers[old.sender])
        name = number if old.id.isdigit() else f"{old.sender}-1-{number}"
        if old.reply_with:
            labels[old.reply_with] = name
        new = msgspec.structs.replace(
            old, conversation=str(self._times), id=name, reply_with=old.reply_with and name,
            in_reply_to=labels[old.in_reply_to], sent=at,
            reply_by=at + 5.0 if old.reply_by else None,
        )  # fmt: skip
        return Sample(DESIGN.key("roco", new), encode(new), at)


def grown(recorder: Recorder, again: Again) -> list[int]:
    """Bytes in use after each block but the first ones, in which what is bounded fills."""
    sizes = []
    tracemalloc.start()
    for _ in range(6):
        for sample in again.block():
            recorder.take(sample)
        recorder.flush()
        gc.collect()
        sizes.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    return sizes[2:]


# 24 s at a load of 13, and each gc.collect() looks through all that other tests left
@pytest.mark.timeout(300)
# large content: some ten s
@pytest.mark.parametrize("channel", ["C4", pytest.param("C3", marks=pytest.mark.long)])
def test_memory_does_not_grow_with_what_is_said(
    channel: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Judge, live lines and file, with what they remember filled soon."""
    filled = ((conversations, "REMEMBERED"), (conversations, "OVER"))
    for module, name in (*filled, (live, "KNOWN"), (tools_live, "STORY")):
        monkeypatch.setattr(module, name, 100)
    told = [one for one in Run(RECORDED, SYSTEM).history.said if one.channel == channel]
    said = [one for one in told if one.conversation == told[0].conversation]
    recorder = Recorder(tmp_path, SYSTEM)
    sizes = grown(recorder, Again(said))
    recorder.finish()
    verdicts = (tmp_path / VERDICTS_FILE).read_bytes().splitlines()
    assert {msgspec.json.decode(line)["verdict"] for line in verdicts} == {"legal"}
    assert max(sizes) < 1.03 * sizes[0], sizes


def test_events_are_told_after_older_ones_were_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each command is told once, whether or not the story was cut."""
    said = [one for one in Run(RECORDED, SYSTEM).history.said if one.channel == "C2"]

    def told() -> list[str]:
        seen = live.Live(SYSTEM)
        records = [understood(sample, SYSTEM) for sample in Again(said).block(20)]
        lines = [line for record in records for line in seen.lines(record)]
        return [line.name for line in lines if isinstance(line, Happened)]

    whole = told()
    assert len(whole) == 40
    monkeypatch.setattr(tools_live, "STORY", 3 * len(said))
    assert len(told()) == len(whole)


@given(st.lists(st.integers(0, 20)), st.integers(1, 10))
def test_the_last_are_remembered(keys: list[int], most: int) -> None:
    """The first value of each of the keys that came last; no more than there is room for."""
    remembered = Remembered[int](most)
    model: dict[int, int] = {}
    for value, key in enumerate(keys):
        assert remembered.note(key, value) == model.get(key)
        model.setdefault(key, value)
        if len(model) > most:
            del model[next(iter(model))]
    assert [key for key in range(21) if key in remembered] == sorted(model)


def test_a_recording_is_gone_on_with_in_little_memory(tmp_path: Path) -> None:
    """Memory of a second monitor at its start does not grow with the size of the first one's
    recording.
    """
    said = [one for one in Run(RECORDED, SYSTEM).history.said if one.channel == "C4"][:2]
    peaks = []
    for blocks in (1, 4):
        path = tmp_path / str(blocks) / TRAFFIC_FILE
        first = mcap_file.Recording(path)
        for sample in Again(said).block(blocks * BLOCK):
            first.add(understood(sample, SYSTEM))
        first.finish({})
        before = mcap_file.cursor(tmp_path / str(blocks))
        assert before is not None
        tracemalloc.start()
        second = mcap_file.Recording(path, before)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        second.finish()
    assert peaks[1] < 1.2 * peaks[0]


# --- A recorder in a flood: the first of each kind, then sums -------------------------------------


KEY = "roco/roco/C2/hi/co/request/request"
MANY = 500


def forged(number: int) -> Sample:
    """A communicate that names another sender than its key."""
    one = Communicate(
        performative=Performative.REQUEST, sender="ta", receiver="co", protocol="request",
        id=str(number),
    )  # fmt: skip
    return Sample(KEY, encode(one), 1e9 + number / 1000)


def flooded(run: Path, said: list[dict[str, Any]]) -> Recorder:
    """A recorder that has heard a flood."""
    one = Recorder(run, SYSTEM, lambda event, **fields: said.append({"event": event, **fields}))
    for number in range(MANY):
        one.take(forged(number))
    return one


def test_violations_of_a_kind_are_told_singly_then_as_a_sum(tmp_path: Path) -> None:
    """In the log, live.jsonl and verdicts.jsonl alike; none is missing in the sum."""
    said = list[dict[str, Any]]()
    flooded(tmp_path, said).finish()

    def lines(name: str, kind: Any) -> list[Any]:
        written = (tmp_path / name).read_bytes().splitlines()
        return [msgspec.json.decode(one, type=kind) for one in written]

    verdicts = lines(VERDICTS_FILE, Judged)
    against = [one for one in lines(LIVE_FILE, LiveLine) if isinstance(one, Against)]
    assert len(verdicts) == len(against) == len(said) == SINGLY + 1
    assert f"… {MANY - SINGLY} more of this kind from" in verdicts[-1].why
    assert verdicts[-1].violation
    assert {one.verdict for one in verdicts} == {verdicts[0].verdict}


def test_of_what_is_no_communicate_the_first_of_a_key_are_recorded(tmp_path: Path) -> None:
    """Enough to see what it was."""
    flooded(tmp_path, []).finish()
    records = mcap_file.read(tmp_path / TRAFFIC_FILE, SYSTEM).records
    assert sum(isinstance(one, Garbage) for one in records) == SINGLY


def test_a_recording_that_is_full_ends_with_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Later records are judged, and not recorded; the file can be read."""
    said = list[dict[str, Any]]()
    monkeypatch.setattr(recorder, "MOST_BYTES", 1)
    one = flooded(tmp_path, said)
    one.flush()
    one.take(Sample("roco/roco/C2/hi/co/request/cancel", b"late", 2e9))
    one.flush()
    one.finish()
    assert [line["event"] for line in said].count("disk limit") == 1
    records = mcap_file.read(tmp_path / TRAFFIC_FILE, SYSTEM)
    assert records.whole
    assert b"late" not in [one.data for one in records.records if isinstance(one, Garbage)]
    assert b"disk limit" in (tmp_path / LIVE_FILE).read_bytes()
