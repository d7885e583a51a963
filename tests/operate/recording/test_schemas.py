"""A recording opens in viewers of MCAP: its schemas are of the form they read, and every message
fits its own.
"""

import base64
from pathlib import Path
from typing import Any

import msgspec
import pytest
from mcap.reader import make_reader
from synthetic import Run

from companion.tools.system import SYSTEM
from operate.filters import Filter
from operate.recording import mcap_file, side_recording
from operate.recording.mcap_file import schema
from operate.recording.records import Garbage, House, Spoken, Token, Unpaired

PLAIN = {"string": str, "number": (int, float), "integer": int, "boolean": bool}
"""Types of a field that Foxglove's reader of JSON schemas takes, beside arrays and objects."""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory, pouring: Run) -> Path:
    """A recording of a whole run, with a record of every kind."""
    path = tmp_path_factory.mktemp("kept") / "all.mcap"
    keeper = side_recording.Keeper(side_recording.Asked(path, Filter(), 0, 0.0), SYSTEM)
    for sample in pouring.samples:
        keeper.take(sample)
    key = "roco/roco/C1/x/y/z/w"
    keeper.take(msgspec.structs.replace(pouring.samples[0], key=key, data=b"\xc1"))
    words = ("co", "ta", "request", "request", "co-1-1", "1")
    keeper._recording.add(Unpaired(*words, True, "other words", 1.0))
    keeper.finish(0)
    return path


@pytest.mark.parametrize("kind", [Spoken, House, Token, Garbage, Unpaired])
def test_a_schema_is_an_object_of_plain_fields(kind: type) -> None:
    """`type: object` at the root, a plain type for each field, no references; bytes say that they
    are base64.
    """
    made = schema(kind)
    assert made["type"] == "object"
    assert set(made["properties"]) == set(kind.__struct_fields__)
    assert all(field["type"] in PLAIN for field in made["properties"].values())
    assert "$ref" not in str(made)


def test_every_message_fits_the_schema_of_its_channel(file: Path) -> None:
    """As mcap's own reader sees the file: indexed, each channel with an encoding and a schema,
    messages in order.
    """
    kinds = set()
    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        seen = 0
        for found, channel, message in reader.iter_messages(log_time_order=False):
            assert found is not None
            assert (channel.message_encoding, found.encoding) == ("json", "jsonschema")
            _fits(msgspec.json.decode(message.data), msgspec.json.decode(found.data))
            kinds.add(found.name)
            seen += 1
        assert seen == summary.statistics.message_count
        assert len(summary.channels) == summary.statistics.channel_count
    assert kinds == {"Spoken", "House", "Token", "Garbage", "Unpaired"}


def _fits(message: dict[str, Any], kind: dict[str, Any]) -> None:
    assert set(kind.get("required", ())) <= set(message) <= set(kind["properties"])
    for name, value in message.items():
        field = kind["properties"][name]
        assert isinstance(value, PLAIN[field["type"]])
        if field.get("contentEncoding") == "base64":
            base64.b64decode(value, validate=True)
        if "enum" in field:
            assert value in field["enum"]


def test_viewers_see_what_was_said(file: Path) -> None:
    """In a few words; the content itself is among the bytes."""
    said = [one for one in mcap_file.read(file).records if isinstance(one, Spoken)]
    asked = [one for one in said if (one.channel, one.performative) == ("C2", "request")]
    assert {one.text for one in asked} == {"pour into jar bowl"}


def test_a_filtered_recording_says_so(tmp_path: Path, pouring: Run) -> None:
    """Only what is meant, and tokens, by which it can be judged; the filter stands in the file's
    metadata.
    """
    path = tmp_path / "c4.mcap"
    asked = side_recording.Asked(path, Filter(channels=("C4",), agents=("pl",)), 5, 0.0)
    keeper = side_recording.Keeper(asked, SYSTEM)
    for sample in pouring.samples:
        if not keeper.over:
            keeper.take(sample)
    kept, unindexed = keeper.finish(0)
    assert unindexed == ""
    records = mcap_file.read(path).records
    assert [one.channel for one in records if isinstance(one, Spoken)] == ["C4"] * 5
    assert (kept.communicates, kept.records, kept.bytes) == (5, len(records), path.stat().st_size)
    assert not [one for one in records if isinstance(one, House) and one.kind != "setting"]
    with path.open("rb") as stream:
        notes = {one.name: one for one in make_reader(stream).iter_metadata()}
        note = notes[side_recording.FILTER]
    assert (note.name, note.metadata["channels"], note.metadata["agents"]) == ("filter", "C4", "pl")
