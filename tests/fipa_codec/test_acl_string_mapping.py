"""Communicate <-> ACL message: no loss, FIPA's names on the outside, typed errors for values without equivalent."""

import math
import re
from pathlib import Path

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fipa_codec.acl_string import AclMessage, After, Aid, At, Form, from_acl, parse, render, to_acl
from fipa_codec.acl_string.message import MAX_MS, MIN_MS
from fipa_codec.communicate import MAX_BYTES, Communicate
from fipa_codec.errors import LocalProtocolError, MalformedError
from fipa_codec.performatives import Performative

P = Performative
RECEIVED = 1.76e9


def packed(value):
    """Return content with this value."""
    return msgspec.Raw(msgspec.msgpack.encode(value))


# FIPA SC00026H, 27H, 28H, 29H, 30H, 33H, 34H, 35H, 36H.
PROTOCOLS = {
    "request": "fipa-request",
    "query": "fipa-query",
    "request-when": "fipa-request-when",
    "cfp": "fipa-contract-net",
    "icfp": "fipa-iterated-contract-net",
    "brokering": "fipa-brokering",
    "recruiting": "fipa-recruiting",
    "subscribe": "fipa-subscribe",
    "propose": "fipa-propose",
}

WORDS = st.from_regex(r"\A[A-Za-z][A-Za-z0-9_.@-]{0,20}\Z")
LABELS = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=40)
FLOATS = st.floats(allow_nan=False, allow_infinity=False)
TIMES = FLOATS | st.floats(1.7e9, 1.8e9) | st.integers(17 * 10**11, 18 * 10**11).map(lambda ms: ms / 1000)
TEXTS = st.text(max_size=12) | st.text(st.sampled_from('"\\\0\n\r\t é本\x7f\x85('), max_size=8)
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | TEXTS | st.binary(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS | st.integers(), inner, max_size=4),
    max_leaves=8,
)
# MessagePack with non-minimal lengths, duplicate keys or extensions: the bytes are preserved, not only the value.
ODD = st.sampled_from(
    [b"\xd9\x01a", b"\xcd\x00\x01", b"\xca\x00\x00\x00\x00", b"\x82\xa1a\x01\xa1a\x02", b"\xd4\x05\x00", b"\xc0"]
)


@st.composite
def contents(draw):
    """Draw well-formed MessagePack (an integer key of a map may be too large to encode)."""
    try:
        return packed(draw(VALUES))
    except OverflowError:
        return packed(None)


def maybe(strategy, absent=""):
    """Return a strategy for an optional field."""
    return st.just(absent) | strategy


COMMUNICATES = st.builds(
    Communicate,
    performative=st.sampled_from(Performative),
    content=maybe(contents() | ODD.map(msgspec.Raw), msgspec.UNSET),
    language=maybe(WORDS),
    ontology=maybe(WORDS),
    protocol=maybe(WORDS | st.sampled_from([*PROTOCOLS, *PROTOCOLS.values(), "FIPA-Query", "coordinate"])),
    reply_by=maybe(TIMES, None),
    reply_with=maybe(LABELS),
    in_reply_to=maybe(LABELS),
    conversation=maybe(LABELS),
    sender=maybe(WORDS),
    receiver=maybe(WORDS),
    id=maybe(LABELS),
    sent=TIMES | st.sampled_from([0.0, -0.0]),
)


def request(**fields):
    """Return a request with these fields."""
    return Communicate(performative=P.REQUEST, **fields)


@given(COMMUNICATES, st.sampled_from(Form))
@example(request(conversation='a"\\', id="\\", reply_with='"'), Form.READABLE)
@example(request(content=packed('say "hi"\\')), Form.READABLE)
@example(request(reply_by=-0.0, sent=1e300), Form.READABLE)
@example(request(reply_by=MAX_MS / 1000), Form.READABLE)
def test_every_communicate_survives_the_round_trip(communicate, form):
    """Text and back: content equal in every byte, times in every bit, including the sign of zero."""
    back = from_acl(parse(render(to_acl(communicate, form=form))), RECEIVED)
    assert back == communicate
    for name in ("reply_by", "sent"):
        assert repr(getattr(back, name)) == repr(getattr(communicate, name))


@pytest.mark.parametrize("value", [bytes(MAX_BYTES - 100), '"' * (MAX_BYTES - 100), [False] * (MAX_BYTES - 100)])
def test_the_largest_content_survives(value):
    """In every form; if the JSON is too long, base64 is used."""
    communicate = request(content=packed(value))
    assert from_acl(parse(render(to_acl(communicate))), RECEIVED) == communicate


@given(COMMUNICATES)
def test_outgoing_messages_conform_to_the_standards(communicate):
    """No macro act, FIPA's tokens for its protocols, every user-defined parameter begins with X-."""
    message = to_acl(communicate)
    assert message.performative not in (P.INFORM_REF, P.INFORM_IF)
    assert message.protocol not in PROTOCOLS
    assert all(name.startswith("X-") for name in message.user)
    if communicate.reply_by is not None and MIN_MS < communicate.reply_by * 1000 < MAX_MS:
        assert isinstance(message.reply_by, At)
        late = message.reply_by.unix_ms / 1000 - communicate.reply_by
        assert -0.0011 - 1e-15 * abs(communicate.reply_by) <= late <= 1e-15 * abs(communicate.reply_by)


@pytest.mark.parametrize(("ours", "standard"), PROTOCOLS.items())
def test_protocol_names_map_one_to_one(ours, standard):
    """Name to FIPA's token and back, in any case, without a user-defined parameter."""
    message = to_acl(request(protocol=ours))
    assert (message.protocol, message.user) == (standard, {})
    for written in (standard, standard.upper()):
        assert from_acl(AclMessage(performative=P.REQUEST, protocol=written), RECEIVED).protocol == ours


def test_a_systems_own_protocol_keeps_its_name():
    """FIPA has no token for it."""
    assert to_acl(request(protocol="coordinate")).protocol == "coordinate"
    assert from_acl(AclMessage(performative=P.REQUEST, protocol="Own"), RECEIVED).protocol == "Own"


@pytest.mark.parametrize(
    ("act", "protocol", "out", "user"),
    [
        (P.INFORM_REF, "query", P.INFORM, {}),
        (P.INFORM, "query", P.INFORM, {"X-act": "inform"}),
        (P.INFORM_IF, "query", P.INFORM, {"X-act": "inform-if"}),
        (P.INFORM_REF, "request", P.INFORM, {"X-act": "inform-ref"}),
        (P.INFORM, "request", P.INFORM, {}),
        (P.REFUSE, "query", P.REFUSE, {}),
    ],
)
def test_answers_of_a_query(act, protocol, out, user):
    """inform-ref of a query is mapped to inform and back; acts that would be mapped to another one have X-act."""
    message = to_acl(Communicate(performative=act, protocol=protocol))
    assert (message.performative, message.user) == (out, user)
    assert from_acl(message, RECEIVED).performative is act


BYTE_EXACT = [
    (
        Communicate(
            performative=P.INFORM_REF,
            protocol="query",
            content=packed({"type": "Pose", "of": "jar", "x": [1, 2.5]}),
            language="WM",
            sender="km",
            receiver="pl",
            id="km-1-7",
            conversation="pl-1-1",
            in_reply_to="pl-1-3",
            reply_by=1760000001.25,
            sent=1760000000.125,
        ),
        rb"(inform :sender (agent-identifier :name km ) :receiver (set (agent-identifier :name pl ) )"
        rb' :content "{\"type\":\"Pose\",\"of\":\"jar\",\"x\":[1,2.5]}" :language WM :encoding json'
        rb" :protocol fipa-query :conversation-id pl-1-1 :in-reply-to pl-1-3 :reply-by 20251009T085321250Z"
        rb' :X-id km-1-7 :X-sent #14"1760000000.125 )',
    ),
    (request(content=packed("((action ex (grasp jar)))")), b'(request :content "((action ex (grasp jar)))" )'),
    (request(content=packed("")), rb'(request :content "\"\"" :encoding json )'),
    (
        request(content=packed("C:\\")),
        rb'(request :content "\"C:\\\"" :encoding json )',
    ),
    (request(content=packed(None)), b'(request :content "null" :encoding json )'),
    (
        request(content=packed({"raw": b"\x00\xff"})),
        b'(request :content "gaNyYXfEAgD/" :encoding msgpack-base64 :X-JADE-Encoding Base64 )',
    ),
    (
        request(reply_by=1e300),
        b'(request :reply-by 99991231T235959999Z :X-reply-by #6"1e+300 )',
    ),
]


@pytest.mark.parametrize(("communicate", "data"), BYTE_EXACT)
def test_byte_exact_examples(communicate, data):
    """The text that another platform receives."""
    assert render(to_acl(communicate)) == data
    assert from_acl(parse(data), RECEIVED) == communicate


def test_binary_form_is_base64_whatever_the_content():
    """For peers that only forward the bytes."""
    assert to_acl(request(content=packed("hi")), form=Form.BINARY).content == "omhp"


def test_json_of_another_platform_is_decoded():
    """White space, order of keys and case of the encoding do not matter."""
    message = AclMessage(performative=P.REQUEST, content='{ "a" : [1, null] }', encoding="JSON")
    assert from_acl(message, RECEIVED).content == packed({"a": [1, None]})


def test_content_of_another_language_is_a_string():
    """fipa-sl0 needs no encoding; names of character sets are ignored; base64 of JADE is decoded to bytes."""
    for encoding in (None, "US-ASCII"):
        message = AclMessage(performative=P.REQUEST, content="(go)", encoding=encoding, language="fipa-sl0")
        assert from_acl(message, RECEIVED).content == packed("(go)")
    wrapped = AclMessage(performative=P.REQUEST, content="AP8=", user={"x-jade-encoding": "base64"})
    assert from_acl(wrapped, RECEIVED).content == packed(b"\x00\xff")
    assert from_acl(AclMessage(performative=P.REQUEST, content=b"\xff"), RECEIVED).content == packed(b"\xff")


def test_a_relative_time_counts_from_the_receipt():
    """The caller passes that time."""
    message = AclMessage(performative=P.REQUEST, reply_by=After(1500))
    assert from_acl(message, RECEIVED).reply_by == RECEIVED + 1.5


@pytest.mark.parametrize("x", ["1.75e9", "nan", "inf", "soon", ""])
def test_user_defined_parameters_that_contradict_are_ignored(x):
    """The standard parameters have priority."""
    message = AclMessage(
        performative=P.AGREE,
        protocol="fipa-request",
        reply_by=At(1_760_000_000_250),
        user={"X-reply-by": x, "X-act": "refuse", "X-protocol": "query"},
    )
    communicate = from_acl(message, RECEIVED)
    assert (communicate.performative, communicate.protocol) == (P.AGREE, "request")
    assert communicate.reply_by == 1760000000.25


def test_names_of_agents_are_mapped():
    """To identifiers with addresses, and back by the name alone."""
    names = {"ta": Aid(name="ta@here", addresses=("http://here:7778/acc",)), "ams": Aid(name="ams@10.0.0.5:1099/JADE")}
    communicate = request(sender="ta", receiver="ams")
    message = to_acl(communicate, names=names)
    assert message.sender == names["ta"]
    assert from_acl(parse(render(message)), RECEIVED, names=names) == communicate
    with pytest.raises(MalformedError) as caught:
        from_acl(message, RECEIVED)
    assert caught.value.field == "receiver (r)"


def test_several_receivers_need_the_receiver_of_this_copy():
    """The caller passes the receiver."""
    message = AclMessage(performative=P.CFP, receiver=(Aid(name="a"), Aid(name="b")))
    assert from_acl(message, RECEIVED, receiver="b").receiver == "b"
    for receiver, words in (("", "pass receiver="), ("c", "not one of a, b")):
        with pytest.raises(MalformedError, match=words):
            from_acl(message, RECEIVED, receiver=receiver)


def test_reply_to_must_be_the_sender():
    """A communicate has no field for another receiver of answers."""
    one, other = Aid(name="a"), Aid(name="b")
    assert from_acl(AclMessage(performative=P.CFP, sender=one, reply_to=(one,)), RECEIVED).sender == "a"
    with pytest.raises(MalformedError, match="reply-to"):
        from_acl(AclMessage(performative=P.CFP, sender=one, reply_to=(one, other)), RECEIVED)


@pytest.mark.parametrize(
    "bad", [request(sender="a b"), request(reply_by=math.nan), request(content=msgspec.Raw(b"\xc1"))]
)
def test_invalid_communicates_are_not_mapped(bad):
    """The error is raised at the sender, not at the peer."""
    with pytest.raises(LocalProtocolError):
        to_acl(bad)


def test_the_examples_of_the_page():
    """docs/acl.md: the first text is printed so, the second one is parsed."""
    page = (Path(__file__).parents[2] / "docs" / "acl.md").read_text()
    written, sent = re.findall(r"```acl\n(.*?)\n```", page, re.DOTALL)
    assert render(to_acl(from_acl(parse(written), RECEIVED))) == written.encode()
    asked = from_acl(parse(sent), RECEIVED)
    assert (asked.performative, asked.sender, asked.protocol) == (P.QUERY_REF, "me", "query")
    assert asked.content == packed({"type": "WhereIs", "object": "jar"})
