"""Any ACL message is mapped to a communicate, or to a typed error that names the field without equivalent."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fipa_codec.acl_string import AclMessage, After, Aid, At, from_acl, parse, render
from fipa_codec.acl_string.message import MAX_MS, MIN_MS
from fipa_codec.communicate import MAX_BYTES, decode, encode
from fipa_codec.errors import MalformedError
from fipa_codec.performatives import Performative

P = Performative
RECEIVED = 1.76e9


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
@pytest.mark.parametrize("protocol", ["a b", "fipa-query", None])
def test_a_user_defined_parameter_that_means_something_else_there_is_ignored(name, values, protocol):
    """SC00061G leaves the names after X- to everybody: no value of one is an error, and none changes the rest."""
    plain = AclMessage(performative=P.INFORM, content="é", protocol=protocol, reply_by=At(1_767_268_800_250))
    for value in values:
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
    reply_by=st.none() | st.builds(At, st.integers(MIN_MS, MAX_MS)) | st.builds(After, st.integers(-9, 9)),
    user=st.dictionaries(
        st.sampled_from(["X-id", "X-sent", "X-reply-by", "X-act", "X-protocol", "X-JADE-Encoding", "X-mood"]),
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
