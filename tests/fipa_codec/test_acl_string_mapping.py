"""Communicate <-> ACL message: no loss, FIPA's names on the outside, typed errors for values
without equivalent.
"""

import itertools
import math
import re
from pathlib import Path

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from strategies import LABELS, TIMES, WORDS, communicates, maybe, values

from fipa_codec.acl_string import (
    AclMessage,
    After,
    Aid,
    At,
    Form,
    from_acl,
    parse,
    render,
    reply_names,
    to_acl,
)
from fipa_codec.acl_string.mapping import LABEL, WORD
from fipa_codec.acl_string.message import MAX_MS, MIN_MS
from fipa_codec.communicate import MAX_BYTES, Communicate, decode, encode, is_word
from fipa_codec.errors import LocalProtocolError, MalformedError
from fipa_codec.performatives import Performative
from fipa_codec.protocols import Profile

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

ESCAPED = st.text(st.sampled_from("acl:%20_4-"), max_size=16)
"""Words and labels that look like those which stand for a text of another platform."""
SECONDS = (
    TIMES
    | st.floats(1.7e9, 1.8e9)
    | st.integers(17 * 10**11, 18 * 10**11).map(lambda ms: ms / 1000)
)
TEXTS = st.text(max_size=12) | st.text(st.sampled_from('"\\\0\n\r\t é本\x7f\x85('), max_size=8)
VALUES = values(TEXTS, TEXTS | st.integers(), st.floats())
# MessagePack with non-minimal lengths, duplicate keys or extensions: the bytes are preserved, not
# only the value.
ODD = st.sampled_from(
    [
        *(b"\xd9\x01a", b"\xcd\x00\x01", b"\xca\x00\x00\x00\x00", b"\xd4\x05\x00", b"\xc0"),
        b"\x82\xa1a\x01\xa1a\x02",
    ]
)


@st.composite
def contents(draw):
    """Draw well-formed MessagePack (an integer key of a map may be too large to encode)."""
    try:
        return packed(draw(VALUES))
    except OverflowError:
        return packed(None)


ESCAPED_WORDS = WORDS | ESCAPED.map("acl-{}".format).filter(is_word)
NAMES = st.sampled_from([*PROTOCOLS, *PROTOCOLS.values(), "FIPA-Query", "coordinate"])
COMMUNICATES = communicates(
    contents() | ODD.map(msgspec.Raw),
    language=maybe(ESCAPED_WORDS),
    protocol=maybe(WORDS | NAMES),
    reply_by=maybe(SECONDS, None),
    conversation=maybe(LABELS | ESCAPED.map("acl:{}".format)),
    sender=maybe(ESCAPED_WORDS),
    sent=SECONDS | st.sampled_from([0.0, -0.0]),
)


def request(**fields):
    """Return a request with these fields."""
    return Communicate(performative=P.REQUEST, **fields)


def asked(**fields):
    """Return the request that an ACL message with these fields is."""
    return from_acl(AclMessage(performative=P.REQUEST, **fields), RECEIVED)


@given(COMMUNICATES, st.sampled_from(Form), st.sampled_from(Profile))
@example(request(conversation='a"\\', id="\\", reply_with='"'), Form.READABLE, Profile.FIPA)
@example(request(content=packed('say "hi"\\')), Form.READABLE, Profile.FIPA)
@example(request(reply_by=-0.0, sent=1e300), Form.READABLE, Profile.FIPA)
@example(request(reply_by=MAX_MS / 1000), Form.READABLE, Profile.FIPA)
def test_every_communicate_survives_the_round_trip(communicate, form, profile):
    """Text and back: content equal in every byte, times in every bit, including the sign of
    zero.
    """
    text = render(to_acl(communicate, form=form, profile=profile))
    back = from_acl(parse(text), RECEIVED, profile=profile)
    assert back == communicate
    for name in ("reply_by", "sent"):
        assert repr(getattr(back, name)) == repr(getattr(communicate, name))


@pytest.mark.parametrize(
    "value", [bytes(MAX_BYTES - 100), '"' * (MAX_BYTES - 100), [False] * (MAX_BYTES - 100)]
)
def test_the_largest_content_survives(value):
    """In every form; if the JSON is too long, base64 is used."""
    communicate = request(content=packed(value))
    assert from_acl(parse(render(to_acl(communicate))), RECEIVED) == communicate


@given(COMMUNICATES)
def test_outgoing_messages_conform_to_the_standards(communicate):
    """No macro act, FIPA's tokens for its protocols, every user-defined parameter begins with
    X-.
    """
    message, by = to_acl(communicate), communicate.reply_by
    assert message.performative not in (P.INFORM_REF, P.INFORM_IF)
    assert message.protocol not in PROTOCOLS
    assert all(name.startswith("X-") for name in message.user)
    if by is not None and MIN_MS < by * 1000 < MAX_MS:
        assert isinstance(message.reply_by, At)
        late, rounded = message.reply_by.unix_ms / 1000 - by, 1e-15 * abs(by)
        assert -0.0011 - rounded <= late <= rounded


def test_protocol_names_map_one_to_one():
    """Name to FIPA's token and back, in any case, without a user-defined parameter."""
    for (papers, standard), profile in itertools.product(PROTOCOLS.items(), Profile):
        differs = papers in ("request", "query", "subscribe")
        ours = standard if differs and profile is Profile.FIPA else papers
        message = to_acl(request(protocol=ours), profile=profile)
        assert (message.protocol, message.user) == (standard, {})
        for written in (standard, standard.upper()):
            message = AclMessage(performative=P.REQUEST, protocol=written)
            read = from_acl(message, RECEIVED, profile=profile)
            assert read.protocol == ours


@pytest.mark.parametrize("papers", ["request", "query", "subscribe"])
def test_a_protocol_of_the_other_profile_is_named(papers):
    """Each has the same token; X-protocol says which one is meant."""
    for profile, ours in ((Profile.FIPA, papers), (Profile.PAPER, f"fipa-{papers}")):
        message = to_acl(request(protocol=ours), profile=profile)
        assert (message.protocol, message.user) == (f"fipa-{papers}", {"X-protocol": ours})


def test_a_systems_own_protocol_keeps_its_name():
    """FIPA has no token for it."""
    assert to_acl(request(protocol="coordinate")).protocol == "coordinate"
    assert asked(protocol="Own").protocol == "Own"


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
def test_answers_of_the_papers_query(act, protocol, out, user):
    """inform-ref of a query is mapped to inform and back; acts that would be mapped to another one
    have X-act.
    """
    message = to_acl(Communicate(performative=act, protocol=protocol), profile=Profile.PAPER)
    assert (message.performative, message.user) == (out, user)
    assert from_acl(message, RECEIVED, profile=Profile.PAPER).performative is act


def test_an_inform_of_the_books_query_is_an_inform():
    """inform-ref is a macro act, which is not sent (SC00037J)."""
    answer = AclMessage(performative=P.INFORM, protocol="fipa-query")
    assert from_acl(answer, RECEIVED).performative is P.INFORM
    assert from_acl(answer, RECEIVED, profile=Profile.PAPER).performative is P.INFORM_REF
    assert to_acl(Communicate(performative=P.INFORM, protocol="fipa-query")).user == {}


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
        rb"(inform :sender (agent-identifier :name km ) :receiver (set (agent-identifier :name"
        rb" pl ) )"
        rb' :content "{\"type\":\"Pose\",\"of\":\"jar\",\"x\":[1,2.5]}" :language WM :encoding json'
        rb" :protocol fipa-query :conversation-id pl-1-1 :in-reply-to pl-1-3 :reply-by"
        rb" 20251009T085321250Z"
        rb' :X-id km-1-7 :X-sent #14"1760000000.125 )',
    ),
    (
        request(content=packed("((action ex (grasp jar)))")),
        b'(request :content "((action ex (grasp jar)))" )',
    ),
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
    assert render(to_acl(communicate, profile=Profile.PAPER)) == data
    assert from_acl(parse(data), RECEIVED, profile=Profile.PAPER) == communicate


def test_binary_form_is_base64_whatever_the_content():
    """For peers that only forward the bytes."""
    assert to_acl(request(content=packed("hi")), form=Form.BINARY).content == "omhp"


def test_json_of_another_platform_is_decoded():
    """White space, order of keys and case of the encoding do not matter."""
    read = asked(content='{ "a" : [1, null] }', encoding="JSON")
    assert read.content == packed({"a": [1, None]})


def test_content_of_another_language_is_a_string():
    """fipa-sl0 needs no encoding; names of character sets are ignored; base64 of JADE is decoded to
    bytes.
    """
    for encoding in (None, "US-ASCII"):
        read = asked(content="(go)", encoding=encoding, language="fipa-sl0")
        assert read.content == packed("(go)")
    wrapped = asked(content="AP8=", user={"x-jade-encoding": "base64"})
    assert wrapped.content == packed(b"\x00\xff")
    assert asked(content=b"\xff").content == packed(b"\xff")


def test_a_relative_time_counts_from_the_receipt():
    """The caller passes that time."""
    assert asked(reply_by=After(1500)).reply_by == RECEIVED + 1.5


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
    assert (communicate.performative, communicate.protocol) == (P.AGREE, "fipa-request")
    assert communicate.reply_by == 1760000000.25


def test_names_of_agents_are_mapped():
    """To identifiers with addresses, and back by the name alone."""
    names = {
        "ta": Aid(name="ta@here", addresses=("http://here:7778/acc",)),
        "ams": Aid(name="ams@10.0.0.5:1099/JADE"),
    }
    communicate = request(sender="ta", receiver="ams")
    message = to_acl(communicate, names=names)
    assert message.sender == names["ta"]
    assert from_acl(parse(render(message)), RECEIVED, names=names) == communicate
    assert from_acl(message, RECEIVED).receiver == "acl-ams@10.0.0.5_3A1099_2FJADE"


def test_several_receivers_need_the_receiver_of_this_copy():
    """The caller passes the receiver."""
    message = AclMessage(performative=P.CFP, receiver=(Aid(name="a"), Aid(name="b")))
    assert from_acl(message, RECEIVED, receiver="b").receiver == "b"
    for receiver, words in (("", "pass receiver="), ("c", "not one of a, b")):
        with pytest.raises(MalformedError, match=words):
            from_acl(message, RECEIVED, receiver=receiver)


def test_answers_go_to_the_reply_to():
    """The peer of the conversation is the sender; `reply_names` addresses what is said to it
    (SC00061G).
    """
    one, other, me = Aid(name="a"), Aid(name="b/c", addresses=("http://b",)), Aid(name="me@here")
    call = AclMessage(performative=P.CFP, sender=one, receiver=(me,), reply_to=(other,))
    heard = from_acl(call, RECEIVED, names={"me": me})
    assert (heard.sender, heard.receiver) == ("a", "me")
    answer = Communicate(performative=P.PROPOSE, sender="me", receiver=heard.sender)
    for reply_to, receiver in (((other,), other), ((), one)):
        names = reply_names(msgspec.structs.replace(call, reply_to=reply_to), {"me": me})
        assert to_acl(answer, names=names).receiver == (receiver,)
    with pytest.raises(MalformedError, match="must name one"):
        reply_names(msgspec.structs.replace(call, reply_to=(one, other)))


def test_answers_go_to_the_addresses_of_the_sender():
    """As JADE's go; a known peer has those that we were told. Nobody: nothing is added."""
    there, known = (Aid(name="b@there", addresses=(url,)) for url in ("http://there", "http://x"))
    call = AclMessage(performative=P.CFP, sender=there)
    peer = from_acl(call, RECEIVED).sender
    answer = Communicate(performative=P.PROPOSE, sender="me", receiver=peer)
    assert to_acl(answer, names=reply_names(call)).receiver == (there,)
    for one in (call, AclMessage(performative=P.CFP)):
        assert reply_names(one, {"b": known}) == {"b": known}


FOREIGN_TEXTS = st.text(
    st.characters(exclude_categories=["Cs"]), min_size=1, max_size=20
) | ESCAPED.filter(bool)


@given(
    (FOREIGN_TEXTS | FOREIGN_TEXTS.map("acl:{}".format)).filter(
        lambda text: len(text.encode()) <= 40
    )
)
@example("order 17 of Ada")
@example("(set (a b))")
def test_any_conversation_id_comes_and_goes(text):
    """Text that is not a label of ours is escaped; the peer gets its own text back, character for
    character.
    """
    message = AclMessage(
        performative=P.CFP, conversation_id=text, reply_with=text, in_reply_to=text
    )
    back = to_acl(from_acl(message, RECEIVED))
    assert (back.conversation_id, back.reply_with, back.in_reply_to) == (text, text, text)


@given(FOREIGN_TEXTS.filter(lambda text: len(text.encode()) <= 20) | ESCAPED.map("acl-{}".format))
@example("(agents x)")
@example("host:1099/JADE")
def test_any_short_name_comes_and_goes(text):
    """Names of agents, language, ontology and protocol."""
    aid = Aid(name=text)
    message = AclMessage(
        performative=P.CFP, sender=aid, receiver=(aid,), language=text, ontology=text, protocol=text
    )
    back = to_acl(from_acl(message, RECEIVED))
    assert (back.sender, back.receiver) == (aid, (aid,))
    assert back.language == back.ontology == back.protocol == text


@given(st.lists(FOREIGN_TEXTS | ESCAPED.map("acl:{}".format), unique=True, max_size=8))
def test_two_texts_are_never_one_label(texts):
    """Or two conversations would be taken for one."""
    assert len({LABEL.enter(text) for text in texts}) == len(texts)


@pytest.mark.parametrize(
    ("escape", "text", "ours"),
    [
        (LABEL, "a b", "acl:a%20b"),
        (LABEL, "acl:a%20b", "acl:acl:a%2520b"),
        (LABEL, "acl:x", "acl:x"),
        (LABEL, "100%", "100%"),
        (WORD, "two words", "acl-two_20words"),
        (WORD, "9", "acl-9"),
        (WORD, "~_", "acl-_7E_5F"),
    ],
)
def test_escapes(escape, text, ours):
    """One to one; what is a word or label stays what it is."""
    assert (escape.enter(text), escape.leave(ours)) == (ours, text)


@pytest.mark.parametrize(
    "bad",
    [request(sender="a b"), request(reply_by=math.nan), request(content=msgspec.Raw(b"\xc1"))],
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
    assert (asked.performative, asked.sender, asked.protocol) == (P.QUERY_REF, "me", "fipa-query")
    assert asked.content == packed({"type": "WhereIs", "object": "jar"})


# --- any message of another platform --------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({"conversation_id": "a " * 64}, "conversation (m_c)"),
        ({"conversation_id": "x" * 129}, "conversation (m_c)"),
        ({"language": "(set a b)" * 4}, "language (L)"),
        ({"content": "{", "encoding": "json"}, "content"),
        ({"content": "1" * 5000, "encoding": "json"}, "content"),
        ({"content": "[" * 100_000, "encoding": "json"}, "content"),
        ({"content": "a", "encoding": "msgpack-base64"}, "content"),
        ({"content": "wQ==", "encoding": "msgpack-base64"}, "communicate"),
        ({"content": "\ud800"}, "content"),
        ({"reply_with": "\ud800"}, "message"),
        ({"content": "x" * (MAX_BYTES + 1)}, "communicate"),
    ],
)
def test_values_without_equivalent_are_named(fields, field):
    """The error has the field."""
    with pytest.raises(MalformedError) as caught:
        from_acl(AclMessage(performative=P.INFORM, **fields), RECEIVED)
    assert caught.value.field == field


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("X-id", ["", "a b", "x" * 129, "é", "(a b)"]),
        ("X-sent", ["", "soon", "nan", "inf", "-1e999", "20260101T120000000Z", "(a b)"]),
        ("X-reply-by", ["", "soon", "nan", "inf", "0"]),
        ("X-act", ["", "inform-done", "refuse", "(a b)"]),
        ("X-protocol", ["", "a b", "fipa-request", "x" * 65]),
        ("X-JADE-Encoding", ["", "Base64", "None", "rot13"]),
        ("X-JADE-trace", ["", "on", "(a b)"]),
        ("X-:#", ["", "on"]),
    ],
)
def test_a_user_defined_parameter_that_means_something_else_there_is_ignored(name, values):
    """SC00061G leaves the names after X- to everybody: no value of one is an error, and none
    changes the rest.
    """
    for value, protocol in itertools.product(values, ("a b", "fipa-query", None)):
        reply_by = At(1_767_268_800_250)
        plain = AclMessage(performative=P.INFORM, content="é", protocol=protocol, reply_by=reply_by)
        message = msgspec.structs.replace(plain, user={name: value})
        read = parse(render(message))
        assert read.user == {name: value}
        assert from_acl(read, RECEIVED) == from_acl(plain, RECEIVED)


ANY = st.none() | st.text(max_size=12)
FOREIGN = st.builds(
    AclMessage,
    performative=st.sampled_from(Performative),
    sender=st.none() | st.builds(Aid, name=st.text(min_size=1, max_size=8)),
    content=ANY | st.binary(max_size=8),
    encoding=ANY | st.sampled_from(["json", "msgpack-base64"]),
    language=ANY,
    protocol=ANY | st.sampled_from(["fipa-query", "fipa-request", "FIPA-Contract-Net"]),
    conversation_id=ANY,
    reply_by=st.none()
    | st.builds(At, st.integers(MIN_MS, MAX_MS))
    | st.builds(After, st.integers(-9, 9)),
    user=st.dictionaries(
        st.sampled_from(
            ["X-id", "X-sent", "X-reply-by", "X-act", "X-protocol", "X-JADE-Encoding", "X-mood"]
        ),
        st.text(max_size=8) | st.sampled_from(["base64", "inform", "query", "1e3"]),
    ),
)


@given(FOREIGN)
def test_any_message_is_a_communicate_or_a_typed_error(message):
    """No message causes another exception, and the result can be encoded and decoded."""
    try:
        communicate = from_acl(message, RECEIVED)
    except MalformedError:
        communicate = None
    if communicate is not None:
        assert decode(encode(communicate)) == communicate
