"""The hash of a step's output: the same for the same, another for whatever differs, however much was said."""

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from agent_runtime.effects import Effects
from agent_runtime.steplog import MUCH_BYTES, fingerprint
from fipa_codec.communicate import Communicate
from fipa_codec.performatives import Performative


def saying(*contents: str, record: bytes | None = None) -> Effects:
    """A step that says one text after the other."""
    acts = [
        Communicate(performative=Performative.INFORM, content=msgspec.Raw(msgspec.msgpack.encode(text)), id=str(number))
        for number, text in enumerate(contents)
    ]
    return Effects(record, sends=tuple(acts))


SIZES = st.sampled_from([10, MUCH_BYTES - 10, MUCH_BYTES, 3 * MUCH_BYTES])


@given(SIZES, st.data())
def test_one_character_elsewhere_in_what_was_said_gives_another_hash(size: int, data: st.DataObject) -> None:
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
    elsewhere = msgspec.structs.replace(both, sends=tuple(msgspec.structs.replace(s, receiver="b") for s in both.sends))
    found = {fingerprint(effects) for effects in (both, turned, elsewhere, saying("x" * one))}
    assert len(found) == 4
    assert len({fingerprint(saying("x" * one, record=record)) for record in (None, b"1", b"2")}) == 3
