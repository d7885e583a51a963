"""Brokering and recruiting: what an embedded message must be. Whole conversations with a broker are
played in tests/agent_runtime/test_stories.py.
"""

import pytest
from msgspec.structs import replace

from fipa_codec import proxying
from fipa_codec.acts import (
    EXPRESSIONS,
    Descriptor,
    Embedded,
    Proposition,
    Quantifier,
    Variable,
    content_of,
)
from fipa_codec.conversation import Conversation
from fipa_codec.errors import ContentError, LocalProtocolError, RemoteProtocolError
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import Role

TRUE = Proposition("true")
WEIGHERS = Descriptor(Quantifier.ALL, "x", Proposition("weighs-things", (Variable("x"),)))
WEIGHT = Descriptor(Quantifier.IOTA, "w", Proposition("weight", ("jar", Variable("w"))))
QUESTION = proxying.embedded_message(
    "query",
    P.QUERY_REF,
    receiver="i",
    conversation="i-1-77",
    id="i-1-78",
    now=1.0,
    content=EXPRESSIONS.encode(content_of(P.QUERY_REF, WEIGHT)),
    language=EXPRESSIONS.name,
    reply_by=30.0,
)


def test_what_is_embedded_comes_out_as_it_was():
    """Targets, message and condition of a proxy; the target's conversation has the message's own
    id, its sender and its time, and so has that of who gets the answer.
    """
    sent = proxying.proxy_content(P.PROXY, WEIGHERS, QUESTION, TRUE)
    found = proxying.proxy_request(EXPRESSIONS.decode(EXPRESSIONS.encode(sent)))
    assert (found.targets, found.condition) == (WEIGHERS, TRUE)
    assert replace(found.message, content=QUESTION.content) == QUESTION
    inner = proxying.target_conversation(proxying.addressed(found.message, "t1"), "t1")
    outer = proxying.receiver_conversation(found.message, "t1")
    for talk, peer, role in ((inner, "i", Role.PARTICIPANT), (outer, "t1", Role.INITIATOR)):
        assert (talk.peer, talk.role, talk.id, talk.deadline) == (peer, role, "i-1-77", 30.0)
    relayed = proxying.relay_content(QUESTION, last=True)
    assert relayed.last
    assert proxying.relayed_answer(relayed) == QUESTION


def test_a_cancelled_brokering_waits_for_its_targets():
    """The broker stops the embedded conversation first; until then its own is stopping."""
    act = {"content": EXPRESSIONS.encode(content_of(P.PROXY, WEIGHERS, Embedded(QUESTION), TRUE))}
    act["language"] = EXPRESSIONS.name
    ask = Conversation.open("brokering", Role.INITIATOR, id="i-1-1", me="i", peer="b")
    ask, opening = ask.send(P.PROXY, id="1", now=1.0, **act)
    broker = Conversation.answering(opening, "b").receive(opening)
    for number, said in enumerate((P.AGREE, P.INFORM)):
        broker, answer = broker.send(said, id=str(number), now=1.0)
        ask = ask.receive(answer)
    assert broker.receive(ask.send(P.CANCEL, id="2", now=2.0)[1]).state == "stopping-relaying"


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"performative": P.INFORM}, "inform does not open query; query-if, query-ref does"),
        ({"protocol": "small-talk"}, "'small-talk' is unknown"),
        ({"protocol": ""}, "is unknown"),
    ],
)
def test_embedded_message_must_open_a_protocol(change, word):
    """Otherwise the sender gets a local error, and the broker a content error."""
    message = replace(QUESTION, **change)
    with pytest.raises(LocalProtocolError, match=word):
        proxying.proxy_content(P.PROXY, WEIGHERS, message, TRUE)
    with pytest.raises(ContentError, match=word):
        proxying.proxy_request(content_of(P.PROXY, WEIGHERS, Embedded(message), TRUE))


def test_contents_of_other_acts():
    """Typed errors, and None for an inform without a relayed answer."""
    with pytest.raises(ContentError, match="not the descriptor, message and proposition"):
        proxying.proxy_request(content_of(P.INFORM, TRUE))
    assert proxying.relayed_answer(content_of(P.INFORM, TRUE)) is None
    with pytest.raises(RemoteProtocolError, match="is 't1', not 't2'"):
        proxying.target_conversation(proxying.addressed(QUESTION, "t1"), "t2")
