"""The step log where much is said: hashes tell apart whatever differs, and what came is read as it
came.
"""

import tempfile
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent_runtime.core.events import Arrived, Effects
from agent_runtime.io import steplog
from agent_runtime.io.steplog import MUCH_BYTES, StepLog, fingerprint, noted, read
from fipa_codec.communicate import Communicate
from fipa_codec.performatives import Performative


def saying(*contents: str, record: bytes | None = None) -> Effects:
    """A step that says one text after the other."""
    acts = [
        Communicate(
            performative=Performative.INFORM,
            content=msgspec.Raw(msgspec.msgpack.encode(text)),
            id=str(number),
        )
        for number, text in enumerate(contents)
    ]
    return Effects(record, sends=tuple(acts))


SIZES = st.sampled_from([10, MUCH_BYTES - 10, MUCH_BYTES, 3 * MUCH_BYTES])


@given(SIZES, st.data())
def test_one_character_elsewhere_in_what_was_said_gives_another_hash(
    size: int, data: st.DataObject
) -> None:
    """At any place of a text of any size; the same text gives the same."""
    text, at = "x" * size, data.draw(st.integers(0, size - 1))
    other = f"{text[:at]}y{text[at + 1 :]}"
    assert fingerprint(saying(text)) == fingerprint(saying("x" * size))
    assert fingerprint(saying(text)) != fingerprint(saying(other))


@given(SIZES, SIZES)
def test_what_was_said_to_whom_and_in_which_order_counts(one: int, other: int) -> None:
    """Also where the contents are so much that only their checksums go in."""
    both = saying("x" * one, "y" * other)
    turned = msgspec.structs.replace(both, sends=both.sends[::-1])
    sends = tuple(msgspec.structs.replace(s, receiver="b") for s in both.sends)
    elsewhere = msgspec.structs.replace(both, sends=sends)
    found = {fingerprint(effects) for effects in (both, turned, elsewhere, saying("x" * one))}
    assert len(found) == 4
    assert (
        len({fingerprint(saying("x" * one, record=record)) for record in (None, b"1", b"2")}) == 3
    )


@given(st.lists(SIZES, min_size=1, max_size=3), st.floats(0.0, 1.0))
def test_what_came_is_read_as_it_came_up_to_where_the_log_is_torn(
    sizes: list[int], share: float
) -> None:
    """Its content stands in the line or behind it; a line whose content is not whole is none."""
    came = [Arrived(saying("x" * size).sends[0]) for size in sizes]
    with tempfile.TemporaryDirectory() as folder:
        path, ends = Path(folder) / "km.steps", [0]
        log = StepLog(path)
        for number, event in enumerate(came):
            log.write([noted(1, number, 0.0, event, Effects())])
            log.flush()
            ends.append(path.stat().st_size)
        log.close()
        whole = path.read_bytes()
        assert [msgspec.msgpack.decode(step.input, type=Arrived) for step in read(path)] == came
        assert not any(step.apart for step in read(path))
        cut = int(share * len(whole))
        path.write_bytes(whole[:cut])
        assert len(list(read(path))) == sum(end <= cut for end in ends[1:])


@given(st.lists(st.integers(1, 40), min_size=1, max_size=20))
def test_whatever_waits_the_file_ends_with_a_whole_line(sizes: list[int]) -> None:
    """So a kill -9 takes steps, and what the next life writes is readable."""
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr(steplog, "BUFFER_BYTES", 200)
        path = Path(folder) / "km.steps"
        log = StepLog(path)
        for number, size in enumerate(sizes):
            log.write([noted(1, number, 0.0, Arrived(saying("x" * size).sends[0]), Effects())])
            there, lines = path.stat().st_size, list(read(path))
            assert log.waiting <= 200
            assert [step.step for step in lines] == list(range(len(lines)))
            assert sum(4 + len(msgspec.msgpack.encode(step)) for step in lines) == there, (
                "nothing after the last one"
            )
        log.close()
        assert len(list(read(path))) == len(sizes)
