"""Encoding of communicates: no loss, small, and any bytes are a communicate or one typed error."""

import math
import re

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import LABELS, communicates, values

from fipa_codec import communicate as communicate_module
from fipa_codec.communicate import (
    MAX_BYTES,
    MAX_CHECKED,
    Communicate,
    check_text,
    decode,
    decode_strictly,
    encode,
    encode_strictly,
    is_label,
    is_word,
)
from fipa_codec.errors import FipaError, LocalProtocolError, MalformedError, RemoteProtocolError
from fipa_codec.performatives import Performative as P

VALUES = values(st.text(max_size=8), st.text(max_size=4))
CONTENTS = VALUES.map(lambda value: msgspec.Raw(msgspec.msgpack.encode(value)))


COMMUNICATES = communicates(CONTENTS)


def assert_communicate_or_error(data):
    """Check that decode returns a communicate or raises the documented error only."""
    try:
        outcome = decode(data)
    except MalformedError as error:
        outcome = error
    assert isinstance(outcome, Communicate) or (outcome.field and outcome.reason)


@given(COMMUNICATES)
def test_round_trip(communicate):
    """An encoded communicate decodes to an equal one."""
    assert decode(encode(communicate)) == communicate


def test_all_22_performatives():
    """There are exactly the 22 acts of SC00037J, with names in lower case."""
    assert len(P) == 22
    assert all(p == p.lower() for p in P)


def test_letters_of_the_paper_on_the_wire():
    """The keys of the map are the letters of the paper's tuple; absent fields take no bytes."""
    labels = {"reply_by": 1.0, "reply_with": "a-1-1", "in_reply_to": "b-1-1"}
    message = Communicate(performative=P.AGREE, **labels)
    assert set(msgspec.msgpack.decode(encode(message))) == {"V", "t_b", "m_w", "m_t"}
    assert encode(Communicate(performative=P.AGREE)) == b"\x81\xa1V\xa5agree"


def test_envelope_of_a_typical_sw_message_is_at_most_120_bytes():
    """Paper, section 5.7: messages in SW have 100 to 200 bytes in total, so the envelope must be
    small.
    """
    asks, answers, by = {"reply_with": "ta-3-45"}, {"in_reply_to": "co-3-12"}, {"reply_by": 1.76e9}
    names = {"protocol": "coordinate", "conversation": "co-3-12", "sender": "ta", "receiver": "co"}
    for act, labels in (
        (P.INFORM, asks),
        (P.CONFIRM, answers),
        (P.CANCEL, asks | by),
        (P.INFORM, asks | answers | by),
    ):
        fields = names | labels | {"content": msgspec.Raw(b"\xc0"), "language": "SW"}
        message = Communicate(performative=act, id="ta-3-45", sent=1.76e9, **fields)
        assert len(encode(message)) <= 120 + len(b"\xa1Z\xc0")


@given(COMMUNICATES, st.data())
def test_truncated_bytes_are_a_typed_error(communicate, data):
    """Every proper prefix of a communicate is an error."""
    whole = encode(communicate)
    with pytest.raises(MalformedError):
        decode(whole[: data.draw(st.integers(0, len(whole) - 1))])


@given(
    COMMUNICATES,
    st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 255)), min_size=1, max_size=5),
)
def test_mutated_bytes_are_a_typed_error(communicate, changes):
    """A communicate with some bytes changed is another communicate or a typed error."""
    data = bytearray(encode(communicate))
    for position, value in changes:
        data[position % len(data)] = value
    assert_communicate_or_error(bytes(data))


KEYS = st.sampled_from(["V", "Z", "L", "t_b", "m_w", "s", "t", "id", "X"])


@given(
    st.binary(max_size=200)
    | (VALUES | st.dictionaries(KEYS, VALUES, min_size=1)).map(msgspec.msgpack.encode)
)
def test_any_bytes_are_a_communicate_or_a_typed_error(data):
    """Arbitrary bytes, well-formed MessagePack of other types, and the keys of a communicate with
    any values.
    """
    assert_communicate_or_error(data)


@pytest.mark.parametrize(
    ("fields", "field", "reason"),
    [
        ({}, "performative (V)", "missing"),
        ({"V": "inform-done"}, "performative (V)", "inform-done"),
        ({"V": "inform", "t_b": "soon"}, "reply_by (t_b)", "float"),
        ({"V": "inform", "t_b": float("nan")}, "reply_by (t_b)", "finite"),
        ({"V": "inform", "t": float("inf")}, "sent (t)", "finite"),
        ({"V": "inform", "s": "a/b"}, "sender (s)", "match"),
        ({"V": "inform", "m_c": "x" * 129}, "conversation (m_c)", "128"),
        ({"V": "inform", "m_w": "a\n"}, "reply_with (m_w)", "match"),
        ({"V": "inform", "X-mood": "good"}, "X-mood", "unknown"),
    ],
)
def test_error_names_field_and_reason(fields, field, reason):
    """The error has the attribute name, the paper's letter and the reason."""
    with pytest.raises(MalformedError) as caught:
        decode_strictly(msgspec.msgpack.encode(fields))
    assert caught.value.field == field
    assert reason in caught.value.reason
    assert caught.value.performative is P.NOT_UNDERSTOOD


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"\x82\xa1V\xa6inform\xa1Z" + b"\x91" * 200_000, "nested too deeply"),
        (b"\x82\xa1V\xa6inform\xa1Z" + b"\xdd\xff\xff\xff\xff", "truncated"),
        (b"\xdf\xff\xff\xff\xff", "truncated"),
        (b"\x81\xa1V\xdb\xff\xff\xff\xff", "truncated"),
        (b"\x81\xa1V\xa1\xff", "UTF-8"),
        (bytes(MAX_BYTES + 1), "at most"),
        (b"", "truncated"),
        (b"\x81\xa1V\xa6inform\x00", "trailing"),
        *((data, "") for data in (None, 5, "text", [1])),  # no TypeError
    ],
)
def test_extreme_bytes_are_a_typed_error(data, reason):
    """Deep nesting, wrong lengths, text that is not UTF-8, too many bytes, none at all."""
    with pytest.raises(MalformedError) as caught:
        decode(data)
    assert reason in caught.value.reason


@pytest.mark.parametrize(
    "fields",
    [
        {"reply_by": math.nan},
        {"sent": -math.inf},
        {"reply_by": math.inf, "sent": -math.inf},
        {"content": msgspec.Raw(b"\xc1")},
        {"content": msgspec.Raw(b"")},
        {"content": msgspec.Raw(b"\xc6\x00\x40\x00\x00" + bytes(2**22))},
        {"id": "\ud800"},
    ],
)
def test_communicates_that_would_not_decode_are_not_encoded(fields):
    """The error is raised at the sender, not at the peer."""
    with pytest.raises(LocalProtocolError):
        encode(Communicate(performative=P.INFORM, **fields))


ANY_LABEL = (
    LABELS
    | st.text(max_size=6)
    | st.sampled_from(["", "a b", "a\n", "\x7f", "ä", "x" * 128, "x" * 129])
)
ANY_WORD = st.sampled_from(["", "WM", "pl", "a/b", "9", "ä", "w" * 64, "w" * 65])
ANY_TIME = st.floats() | st.sampled_from([0.0, float("nan"), float("inf")])
ANY_CONTENT = CONTENTS | st.binary(max_size=6).map(msgspec.Raw)
ONE_FIELD = st.one_of(
    st.tuples(st.sampled_from(["language", "sender"]), ANY_WORD),
    st.tuples(st.sampled_from(["reply_with", "conversation", "id"]), ANY_LABEL),
    st.tuples(st.sampled_from(["reply_by", "sent"]), ANY_TIME),
    st.tuples(st.just("content"), ANY_CONTENT),
)


def has_valid_form(communicate):
    """Whether times and content are valid, by an independent check."""
    try:
        whole = communicate.content is msgspec.UNSET or msgspec.msgpack.decode(
            communicate.content, type=msgspec.Raw
        )
        communicate.id.encode()
    except (msgspec.MsgspecError, ValueError):
        return False
    return bool(whole) and all(map(math.isfinite, (communicate.reply_by or 0.0, communicate.sent)))


def is_valid(communicate):
    """Whether words and labels are valid too."""
    words = (communicate.language, communicate.sender)
    labels = (communicate.reply_with, communicate.conversation, communicate.id)
    return has_valid_form(communicate) and all(
        text == "" or re.fullmatch(pattern, text)
        for pattern, texts in ((r"[A-Za-z][A-Za-z0-9_.@-]{0,63}", words), (r"[!-~]{1,128}", labels))
        for text in texts
    )


USUAL = Communicate(
    performative=P.INFORM, language="WM", sender="pl", conversation="c-1", sent=1.76e9
)


@settings(max_examples=500)
@given(ONE_FIELD)
def test_both_pairs_accept_exactly_the_valid_communicates(changed):
    """With one field of a usual communicate changed, both pairs agree with the independent
    checks.
    """
    communicate = msgspec.structs.replace(USUAL, **dict([changed]))
    for pack, read, right in (
        (encode, decode, has_valid_form(communicate)),
        (encode_strictly, decode_strictly, is_valid(communicate)),
        # again, now with the words in the cache
        (encode_strictly, decode_strictly, is_valid(communicate)),
    ):
        try:
            assert read(pack(communicate)) == communicate
            assert right
        except LocalProtocolError:
            assert not right
        if changed[0] != "content":
            try:
                read(msgspec.msgpack.encode(communicate))
                assert right
            except MalformedError:
                assert not right


@given(ANY_LABEL | ANY_WORD)
def test_is_word_and_is_label_agree_with_check_text(text):
    """For any text in a field of that kind."""
    for fits, field in ((is_word, "language"), (is_label, "conversation")):
        one = Communicate(performative=P.INFORM, **{field: text})
        if fits(text) or text == "":
            check_text(one)
        else:
            with pytest.raises(MalformedError, match=field):
                check_text(one)


def test_the_cache_of_words_is_bounded():
    """It is cleared at its limit, and words are checked again."""
    for number in range(MAX_CHECKED + 10):
        check_text(msgspec.structs.replace(USUAL, sender=f"s{number}"))
    assert len(communicate_module._checked) <= MAX_CHECKED
    check_text(USUAL)


def test_the_type_of_an_error_says_whose_fault_it_is():
    """The base class cannot be raised; the two subclasses are disjoint."""
    with pytest.raises(TypeError):
        FipaError("x", "y")
    assert issubclass(MalformedError, RemoteProtocolError)
    assert not issubclass(LocalProtocolError, RemoteProtocolError)
