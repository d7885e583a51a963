"""Output of a recorder in a flood is bounded: the first of each kind, then sums; files that end
with words.
"""

from pathlib import Path
from typing import Any

import msgspec
import pytest

from agent_runtime.io.logs import SINGLY
from agent_runtime.io.tap import Sample
from companion.tools.system import SYSTEM
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative
from operate.file_names import LIVE_FILE, VERDICTS_FILE
from operate.live_lines import Against, LiveLine
from operate.recording import mcap_file, recorder
from operate.recording.recorder import Recorder
from operate.recording.records import Garbage
from operate.verdict_lines import Judged

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
    records = mcap_file.read(tmp_path / mcap_file.FILE, SYSTEM).records
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
    records = mcap_file.read(tmp_path / mcap_file.FILE, SYSTEM)
    assert records.whole
    assert b"late" not in [one.data for one in records.records if isinstance(one, Garbage)]
    assert b"disk limit" in (tmp_path / LIVE_FILE).read_bytes()
