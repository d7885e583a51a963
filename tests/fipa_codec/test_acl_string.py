"""The string representation (SC00070I): liberal parser, strict printer, and one typed error with a position."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fipa_codec.acl_string import (
    MAX_ACL_BYTES,
    MAX_DEPTH,
    AclMessage,
    AclSyntaxError,
    After,
    Aid,
    At,
    parse,
    render,
)
from fipa_codec.acl_string.message import MAX_AFTER_MS, MAX_MS, MIN_MS
from fipa_codec.errors import LocalProtocolError
from fipa_codec.performatives import Performative

INFORM = Performative.INFORM
NOON = At(1_767_268_800_000)  # 2026-01-01 12:00 UTC
KM, PL = Aid(name="km"), Aid(name="pl")


def inform(**fields):
    """Return an inform with these fields."""
    return AclMessage(performative=INFORM, **fields)


# --- strategies -------------------------------------------------------------------------------------------------------

# Edge cases of words: names of JADE's agents, URLs, texts that look like a number, a time or a parameter.
EDGES = st.sampled_from(
    [
        *("km", "df@host:1099/JADE", "http://host:7778/acc?a=b&c", "a:sender", "r:content#1", "NaN", "9f-1", "12d"),
        *("x:reply-by20260101T120000000Z", ":language", "-1", "+1", "@a", "20260101T120000000Z", "#2", "(a)", "é"),
    ]
)
TEXTS = EDGES | st.text(st.sampled_from('"\\ab :()#@-1\n\0é本'), max_size=8) | st.text(max_size=8)
USER = st.dictionaries(st.sampled_from(["X-id", "X-JADE-Encoding", "X-é", "x-b"]), TEXTS, max_size=2)
LEAVES = st.builds(Aid, name=TEXTS.filter(bool), addresses=st.lists(TEXTS, max_size=2).map(tuple), user=USER)
AIDS = LEAVES | st.builds(Aid, name=EDGES, resolvers=st.lists(LEAVES, max_size=2).map(tuple))
SETS = st.lists(AIDS, max_size=2).map(tuple)
TIMES = (
    st.integers(MIN_MS, MAX_MS).map(At)
    | st.integers(-MAX_AFTER_MS, MAX_AFTER_MS).map(After)
    | st.sampled_from([At(MIN_MS), At(MAX_MS), After(MAX_AFTER_MS), After(-1), After(0), NOON])
)
EXPRESSIONS = ("language", "encoding", "ontology", "protocol", "conversation_id", "reply_with", "in_reply_to")
MESSAGES = st.fixed_dictionaries(
    {"performative": st.sampled_from(Performative)},
    optional={
        **{"sender": AIDS, "receiver": SETS, "reply_to": SETS, "reply_by": TIMES, "user": USER},
        **{"content": TEXTS | st.binary(max_size=8), **dict.fromkeys(EXPRESSIONS, TEXTS)},
    },
).map(lambda fields: AclMessage(**fields))


def assert_message_or_error(data):
    """Check that parse returns a message, which can be printed and parsed again, or only the documented error."""
    try:
        outcome = parse(data)
    except AclSyntaxError as error:
        outcome = error
    if isinstance(outcome, AclMessage):
        assert parse(render(outcome)) == outcome
        return
    assert 0 <= outcome.offset <= len(data.encode(errors="replace") if isinstance(data, str) else data)
    assert min(outcome.line, outcome.column) >= 1
    assert 0 <= outcome.caret <= len(outcome.excerpt)
    assert outcome.found
    assert outcome.expected


# --- round trip and strict printing -----------------------------------------------------------------------------------


@given(MESSAGES)
def test_round_trip(message):
    """A printed message parses to an equal one."""
    assert parse(render(message)) == message


def without_strings(data):
    """Return the text with every string replaced by S; an independent implementation of the grammar's String."""
    out, at = b"", 0
    while at < len(data):
        counted = re.compile(rb'#(\d+)"').match(data, at)
        quoted = re.compile(rb'"(?:\\"|[^"])*?(?<!\\)"', re.DOTALL).match(data, at)
        if counted and data[at - 1 : at] == b" ":
            out, at = out + b"S", counted.end() + int(counted[1])
        elif quoted and data[at - 1 : at] == b" ":
            out, at = out + b"S", quoted.end()
        else:
            out, at = out + data[at : at + 1], at + 1
    return out


@given(MESSAGES)
def test_printing_is_strict(message):
    """Plain words bare, other values as strings, times with Z or sign, blanks before : and ), ASCII outside strings."""
    text = without_strings(render(message)).decode("utf-8")
    words = text.replace("(", " ( ").split()
    assert not re.search(r"(?<! )\)", text)
    time = r"\d{8}T\d{9}Z|[+-]\d{8}T\d{9}"
    for word in words:
        if not word.startswith(":"):
            assert re.fullmatch(rf"[()S]|[A-Za-z][A-Za-z0-9_.@:/?&=%~+-]*|{time}", word, re.ASCII), word


BYTE_EXACT = [
    (AclMessage(performative=Performative.AGREE), b"(agree )"),
    (
        AclMessage(
            performative=Performative.REQUEST,
            content="grasp jar",
            protocol="fipa-request",
            conversation_id="r-1",
            reply_by=NOON,
        ),
        b'(request :content "grasp jar" :protocol fipa-request :conversation-id r-1 :reply-by 20260101T120000000Z )',
    ),
    (
        inform(sender=Aid(name="km@host:1099/JADE", addresses=("http://host:7778/acc",)), receiver=(PL,)),
        b"(inform :sender (agent-identifier :name km@host:1099/JADE :addresses (sequence http://host:7778/acc ) )"
        b" :receiver (set (agent-identifier :name pl ) ) )",
    ),
    (inform(sender=Aid(name="a b")), b'(inform :sender (agent-identifier :name "a b" ) )'),
    (inform(content=""), b'(inform :content "" )'),
    (inform(content='say "hi"'), rb'(inform :content "say \"hi\"" )'),
    (inform(content=r"a\"b"), rb'(inform :content "a\\"b" )'),
    (inform(content="C:\\"), rb'(inform :content #3"C:\ )'),
    (inform(content="é\\", language="raw"), '(inform :content #3"é\\ :language raw )'.encode()),
    (inform(content=b'\xff\x00"'), b'(inform :content #3"\xff\x00" )'),
    (inform(conversation_id="9f-1"), b'(inform :conversation-id "9f-1" )'),
    (inform(conversation_id="12345678d"), b'(inform :conversation-id "12345678d" )'),
    (inform(reply_with="@x", in_reply_to="-x"), b'(inform :reply-with "@x" :in-reply-to "-x" )'),
    (inform(user={"X-id": "km-1-1", "X-t": "1.5"}), b'(inform :X-id km-1-1 :X-t #3"1.5 )'),
    (inform(user={"X-e": "", "X-u": "é"}), '(inform :X-e "" :X-u "é" )'.encode()),
    (inform(reply_by=After(-90_061_001)), b"(inform :reply-by -00000001T010101001 )"),
    (inform(reply_by=After(400 * 86_400_000)), b"(inform :reply-by +00010105T000000000 )"),
]


@pytest.mark.parametrize(("message", "data"), BYTE_EXACT)
def test_byte_exact_examples(message, data):
    """The printed bytes, one difficulty of the grammar each."""
    assert render(message) == data
    assert parse(data) == message


@pytest.mark.parametrize(
    ("message", "field"),
    [
        (inform(user={"mood": "good"}), "mood"),
        (inform(user={"X-": "good"}), "X-"),
        (inform(user={"X-a": "1", "x-A": "2"}), "message"),
        (inform(sender=Aid(name="")), "name"),
        (inform(content="\ud800"), "message"),
        (inform(content="x" * MAX_ACL_BYTES), "message"),
        (inform(sender=Aid(name="a", user={"X y": "1"})), "X y"),
        (AclMessage(performative="inform-done"), "performative"),
        (inform(language=7), "message"),
    ],
)
def test_messages_that_would_not_parse_are_not_printed(message, field):
    """The error is raised at the sender, not at the peer."""
    with pytest.raises(LocalProtocolError) as caught:
        render(message)
    assert caught.value.field == field


def nested(levels):
    """Return an AID with nested resolvers of this depth."""
    aid = KM
    for _ in range(levels - 1):
        aid = Aid(name="r", resolvers=(aid,))
    return aid


def test_the_depth_limit_is_the_same_for_parser_and_printer():
    """The limit is printed and parsed; one more level is rejected by both."""
    assert parse(render(inform(sender=nested(MAX_DEPTH)))).sender == nested(MAX_DEPTH)
    with pytest.raises(LocalProtocolError):
        render(inform(sender=nested(MAX_DEPTH + 1)))
    one_more = b"(agent-identifier :name r :resolvers (sequence " + render(inform(sender=nested(MAX_DEPTH)))[16:-2]
    with pytest.raises(AclSyntaxError, match=f"level {MAX_DEPTH + 1}"):
        parse(b"(inform :sender " + one_more + b")))")
    deep = b"(agent-identifier :name r :resolvers (sequence " * 5000
    with pytest.raises(AclSyntaxError, match="levels"):
        parse(b"(inform :sender " + deep)
    with pytest.raises(AclSyntaxError, match="levels"):
        parse(b"(inform :language " + b"(" * 100_000)


def test_times_outside_the_calendar_cannot_be_made():
    """At and After have the range of the token."""
    for make, value in ((At, MIN_MS - 1), (At, MAX_MS + 1), (After, MAX_AFTER_MS + 1)):
        with pytest.raises(LocalProtocolError):
            make(value)


# --- any text ---------------------------------------------------------------------------------------------------------

TOKENS = st.lists(
    st.sampled_from(
        [
            *("(", ")", " ", '"', "\\", '\\"', '#3"', '#0"', "#", ":", "\0", "\n", "é"),
            *("(inform ", ":content ", ":sender ", ":receiver ", "(set ", "(agent-identifier ", ":name ", ":reply-by "),
            *(":language ", ":protocol", ":X-a", "20260101T120000000Z", "abc", "12", "-", "+", "@", "(sequence "),
            *(":addresses", ":resolvers "),
        ]
    ),
    max_size=40,
).map("".join)


@given(TOKENS | st.text(max_size=60))
def test_any_text_is_a_message_or_a_typed_error(text):
    """Arbitrary characters cause no other exception."""
    assert_message_or_error(text)


@given(TOKENS)
def test_any_tokens_after_the_act_are_a_message_or_a_typed_error(text):
    """Most of the grammar is after the act."""
    assert_message_or_error(f"(inform {text})")


@given(st.binary(max_size=100))
def test_any_bytes_are_a_message_or_a_typed_error(data):
    """Arbitrary bytes cause no other exception."""
    assert_message_or_error(data)
    assert_message_or_error(b"(inform :content " + data)


@given(MESSAGES, st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 255)), min_size=1, max_size=5))
def test_changed_bytes_are_a_message_or_a_typed_error(message, changes):
    """A printed message with some bytes changed."""
    data = bytearray(render(message))
    for position, value in changes:
        data[position % len(data)] = value
    assert_message_or_error(bytes(data))


@given(MESSAGES, st.data())
def test_a_truncated_message_is_an_error(message, data):
    """A message ends with the closing parenthesis of its first one."""
    whole = render(message)
    with pytest.raises(AclSyntaxError):
        parse(whole[: data.draw(st.integers(0, len(whole) - 1))])
