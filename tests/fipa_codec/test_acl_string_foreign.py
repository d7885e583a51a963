"""Any ACL message is mapped to a communicate, or to a typed error that names the field without equivalent."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fipa_codec.acl_string import AclMessage, After, Aid, At, from_acl
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
        ({"user": {"X-id": "a b"}}, "id (id)"),
        ({"user": {"X-sent": "soon"}}, "X-sent"),
        ({"user": {"X-sent": "nan"}}, "sent (t)"),
        ({"content": "{", "encoding": "json"}, "content"),
        ({"content": "1" * 5000, "encoding": "json"}, "content"),
        ({"content": "[" * 100_000, "encoding": "json"}, "content"),
        ({"content": "a", "encoding": "msgpack-base64"}, "content"),
        ({"content": "wQ==", "encoding": "msgpack-base64"}, "communicate"),
        ({"content": "é", "user": {"X-JADE-Encoding": "Base64"}}, "content"),
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
