"""Content fits its language or is a typed error with field and reason."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fipa_codec.communicate import (
    LONGEST_LABEL,
    MAX_BYTES,
    MAX_CONTENT_BYTES,
    Communicate,
    encode_strictly,
)
from fipa_codec.errors import ContentError, LocalProtocolError
from fipa_codec.languages import REASON, Kind, Language, Languages, Reason
from fipa_codec.performatives import Performative as P


class Leaf(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """A sentence with a number."""

    value: float
    names: tuple[str, ...] = ()


class Tree(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """A sentence with nested ones."""

    branches: tuple["Tree | Leaf", ...]


class Stranger(msgspec.Struct, frozen=True, tag=True):
    """A class of no language."""


TREES = Language(
    "TREES", Tree | Leaf, kind=lambda c: Kind.PROGRESS if isinstance(c, Leaf) else Kind.FINAL
)
LEAVES = st.builds(
    Leaf, st.floats(allow_nan=False), st.lists(st.text(max_size=5), max_size=3).map(tuple)
)
SENTENCES = st.recursive(
    LEAVES, lambda inner: st.builds(Tree, st.lists(inner, max_size=3).map(tuple)), max_leaves=6
)


def assert_sentence_or_error(data):
    """Check that decode returns a sentence or raises the documented error only."""
    try:
        outcome = TREES.decode(data)
    except ContentError as error:
        outcome = error
    assert type(outcome) in TREES.classes or (outcome.field and "TREES" in outcome.reason)


@given(SENTENCES)
def test_round_trip(sentence):
    """An encoded sentence decodes to an equal one."""
    assert TREES.decode(TREES.encode(sentence)) == sentence


@given(st.binary(max_size=100))
def test_random_bytes_are_a_typed_error(data):
    """Arbitrary bytes cause no exception other than ContentError."""
    assert_sentence_or_error(data)


@given(
    SENTENCES,
    st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 255)), max_size=5),
    st.integers(0, 40),
)
def test_mutated_and_truncated_content_is_a_typed_error(sentence, changes, cut):
    """Content with some bytes changed or removed is another sentence or a typed error."""
    data = bytearray(bytes(TREES.encode(sentence)))
    for position, value in changes:
        data[position % len(data)] = value
    assert_sentence_or_error(bytes(data[: len(data) - cut]))


@pytest.mark.parametrize(
    ("value", "field", "reason"),
    [
        ({"type": "Leaf", "value": "high"}, "value", "float"),
        ({"type": "Leaf"}, "value", "missing"),
        ({"type": "Leaf", "value": 1.0, "names": ["a", 2]}, "names[1]", "str"),
        ({"type": "Leaf", "value": 1.0, "colour": 1}, "colour", "unknown"),
        (
            {"type": "Tree", "branches": [{"type": "Leaf", "value": None}]},
            "branches[0].value",
            "float",
        ),
        ({"type": "Bush"}, "type", "Bush"),
        (17, "content", "int"),
    ],
)
def test_error_names_field_and_reason(value, field, reason):
    """The path of the wrong part, and what is wrong."""
    with pytest.raises(ContentError) as caught:
        TREES.decode(msgspec.msgpack.encode(value))
    assert caught.value.field == field
    assert reason in caught.value.reason


@pytest.mark.parametrize(
    "data",
    [
        (b"\x82\xa4type\xa4Tree\xa8branches\x91") * 5_000,
        b"\x82\xa4type\xa4Leaf\xa5names\xdd\xff\xff\xff\xff",
        b"\x82\xa4type\xa4Tree\xa8branches\xdd\x7f\xff\xff\xff",
        bytes(MAX_BYTES + 1),
        b"",
    ],
)
def test_extreme_content_is_a_typed_error(data):
    """Deep nesting, wrong lengths, too many bytes, none."""
    with pytest.raises(ContentError):
        TREES.decode(data)


@pytest.mark.parametrize("content", [Stranger(), 17, None, Leaf(1.0, ("\ud800",))])
def test_own_content_outside_the_language_is_a_local_error(content):
    """Content that the peer could not decode is not encoded."""
    with pytest.raises(LocalProtocolError):
        TREES.encode(content)


def test_too_long_content_is_a_local_error():
    """The longest content fits with the longest words and labels; one byte more is an error with
    both sizes.
    """
    frame = len(TREES.encode(Leaf(1.0, ("x" * 100_000,)))) - 100_000
    most = TREES.encode(Leaf(1.0, ("x" * (MAX_CONTENT_BYTES - frame),)))
    word, label = "w" * 64, "l" * LONGEST_LABEL
    fields = dict.fromkeys(("language", "ontology", "protocol", "sender", "receiver"), word)
    labels = dict.fromkeys(("reply_with", "in_reply_to", "conversation", "id"), label)
    act = max(P, key=len)
    one = Communicate(
        performative=act, content=most, reply_by=1.5e9, sent=1.5e9, **fields, **labels
    )
    assert len(most) == MAX_CONTENT_BYTES
    assert len(encode_strictly(one)) <= MAX_BYTES
    words = f"{MAX_CONTENT_BYTES + 1} bytes in TREES, at most {MAX_CONTENT_BYTES}"
    with pytest.raises(LocalProtocolError, match=words):
        TREES.encode(Leaf(1.0, ("x" * (MAX_CONTENT_BYTES - frame + 1),)))


def test_read_decodes_by_the_named_language():
    """`Languages.read` returns content and kind; without content None and PLAIN, even without a
    language.
    """
    for act, fields, read in (
        (P.INFORM, {"language": "TREES", "content": TREES.encode(Leaf(1.0))}, LEAF),
        (P.CONFIRM, {"language": "TREES"}, (None, Kind.PLAIN)),
        (P.CANCEL, {}, (None, Kind.PLAIN)),
    ):
        assert Languages([TREES]).read(Communicate(performative=act, **fields)) == read


LEAF = Leaf(1.0), Kind.PROGRESS


@pytest.mark.parametrize("language", ["", "LATIN"])
def test_content_in_an_unknown_language_is_a_typed_error(language):
    """The error has the known languages."""
    message = Communicate(performative=P.INFORM, language=language, content=msgspec.Raw(b"\xc0"))
    with pytest.raises(ContentError) as caught:
        Languages([TREES]).read(message)
    assert caught.value.field == "language"
    assert not language or "TREES" in caught.value.reason


def test_reason_is_always_known():
    """Every agent understands the reason of a not-understood."""
    assert Languages().named("reason") is REASON
    assert REASON.decode(REASON.encode(Reason("no such act", "V"))) == Reason("no such act", "V")
    with pytest.raises(LocalProtocolError, match="TREES, reason"):
        Languages([TREES]).named("LATIN")
