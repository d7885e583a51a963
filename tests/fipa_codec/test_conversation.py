"""What a conversation checks beside its tables: words, labels, sides, deadlines; its errors say
what was allowed.
"""

import msgspec
import pytest
from dialogue import Dialogue
from hypothesis import given
from hypothesis import strategies as st

from fipa_codec.communicate import is_label
from fipa_codec.conversation import MOST_HEARD, Conversation
from fipa_codec.errors import LocalProtocolError, MalformedError, RemoteProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import RECEIVE, Role

INITIATOR, PARTICIPANT = Role.INITIATOR, Role.PARTICIPANT


def opened(protocol, act, **options):
    """Both sides after the opening."""
    both = Dialogue(protocol)
    both.say(INITIATOR, act, **options)
    both.take(PARTICIPANT)
    return both


def heard(both, role, act, **options):
    """Let one side say something, and the other take it."""
    both.say(role, act, **options)
    return both.take(role.other)


@pytest.fixture
def asked():
    """A request that was received and is not answered yet."""
    return opened("request", P.REQUEST, reply_by=10.0)


@pytest.mark.parametrize("bad", ["a b", "a\n", "x" * 129, "\u00e4", "\ud800"])
def test_invalid_words_and_labels_are_rejected(bad):
    """Own names and ids in open and send, those of the peer in its opening, and each m_w that is
    stored.
    """
    named = {"id": "co-1-1", "me": "co", "peer": "ta"}
    for field in named:
        with pytest.raises(LocalProtocolError, match="must match"):
            Conversation.open("request", INITIATOR, **named | {field: bad})
    pair = Dialogue("request")
    with pytest.raises(LocalProtocolError, match="id that matches"):
        pair.sides[INITIATOR].send(P.REQUEST, id=bad, now=1.0)
    opening = heard(pair, INITIATOR, P.REQUEST)
    for field in ("conversation", "reply_with", "id", "sender", "language"):
        with pytest.raises(MalformedError, match="must match"):
            Conversation.answering(msgspec.structs.replace(opening, **{field: bad}), "ta")
    cancel = pair.say(INITIATOR, P.CANCEL)
    assert pair.sides[PARTICIPANT].receive(cancel).cancel == cancel.reply_with
    with pytest.raises(RemoteProtocolError, match="one that matches"):
        pair.sides[PARTICIPANT].receive(msgspec.structs.replace(cancel, reply_with=bad))


def test_the_kind_of_other_acts_than_inform_is_ignored(asked):
    """A language may classify the content of an agree or a failure too; only that of an inform
    matters.
    """
    heard(asked, PARTICIPANT, P.AGREE, kind=Kind.PROGRESS)
    heard(asked, PARTICIPANT, P.FAILURE, kind=Kind.FINAL)
    assert asked.states == ("failed", "failed")


def test_a_side_that_must_send_receives_nothing(asked):
    """The failure in reply to a late cancel is sent in the step that received the cancel."""
    message = asked.sides[INITIATOR].send(P.CANCEL, id="x", now=1.0)[1]
    heard(asked, PARTICIPANT, P.INFORM)
    owing = msgspec.structs.replace(asked.sides[PARTICIPANT], state="too-late")
    with pytest.raises(LocalProtocolError, match=r"must send failure\[cancel\] before"):
        owing.receive(msgspec.structs.replace(message, performative=P.CANCEL, reply_with="k"))


def test_deadline_of_a_cancel_stands_until_its_answer(asked):
    """Messages that cross the cancel do not answer it."""
    asked.say(PARTICIPANT, P.AGREE)
    asked.say(PARTICIPANT, P.INFORM, kind=Kind.PROGRESS)
    asked.say(PARTICIPANT, P.INFORM)
    asked.say(INITIATOR, P.CANCEL, reply_by=20.0)
    for _ in range(3):
        asked.take(INITIATOR)
        assert asked.sides[INITIATOR].deadline == 20.0
    asked.take(PARTICIPANT)
    heard(asked, PARTICIPANT, P.FAILURE)
    assert [side.deadline for side in asked.sides.values()] == [None, None]


def test_the_last_message_sets_no_deadline(asked):
    """Although it has a reply-by: it is not answered. An answer after the deadline is taken."""
    heard(asked, PARTICIPANT, P.INFORM, reply_by=30.0)
    assert asked.states == ("done", "done")
    assert [side.deadline for side in asked.sides.values()] == [None, None]


def test_another_query_in_the_same_conversation_is_an_error():
    """A repetition has the same m_w; it keeps the deadline."""
    pair = opened("query", P.QUERY_REF, reply_by=5.0)
    message = heard(pair, INITIATOR, P.QUERY_REF)
    assert pair.sides[INITIATOR].deadline == 5.0
    with pytest.raises(RemoteProtocolError) as caught:
        pair.sides[PARTICIPANT].receive(msgspec.structs.replace(message, reply_with="co-1-9"))
    assert caught.value.field == "reply_with"


def test_messages_of_other_conversations_are_an_error_with_the_field(asked):
    """Id, sides and protocol are constant; an answer refers to a message of the conversation."""
    message, mine = asked.say(PARTICIPANT, P.AGREE), asked.sides[INITIATOR]
    assert mine.takes(message) is True
    for field, value in (
        ("conversation", "co-1-2"),
        ("sender", "pl"),
        ("receiver", "km"),
        ("protocol", "query"),
        ("in_reply_to", "x-9-9"),
    ):
        other = msgspec.structs.replace(message, **{field: value})
        assert mine.takes(other) is False
        with pytest.raises(RemoteProtocolError) as caught:
            mine.receive(other)
        assert caught.value.field == field
        assert value in caught.value.reason
        assert caught.value.performative is P.NOT_UNDERSTOOD


def test_alias_of_the_protocol_is_the_protocol():
    """A peer may write fipa-contract-net; fipa-request is another protocol than request."""
    call, asked = Dialogue("cfp"), Dialogue("request")
    call.word("i:cfp")
    asked.word("i:request")
    offer = msgspec.structs.replace(call.say(PARTICIPANT, P.PROPOSE), protocol="fipa-contract-net")
    assert call.sides[INITIATOR].receive(offer).state == "offered"
    agreed = msgspec.structs.replace(heard(asked, PARTICIPANT, P.AGREE), protocol="fipa-request")
    with pytest.raises(RemoteProtocolError, match="expected 'request'"):
        asked.sides[INITIATOR].receive(agreed)


def test_error_has_the_allowed_messages(asked):
    """And agent, conversation, protocol and state."""
    message = msgspec.structs.replace(asked.say(PARTICIPANT, P.AGREE), performative=P.PROPOSE)
    with pytest.raises(RemoteProtocolError) as caught:
        asked.sides[INITIATOR].receive(message)
    for word in ("co-1-1", "request", "'co'", "asked", "propose", "agree, refuse, failure, inform"):
        assert word in caught.value.reason
    assert not asked.sides[INITIATOR].takes(message)


def test_openings_need_conversation_sender_and_protocol():
    """Without them the message cannot be answered, or its answer not be recognised."""
    message = Dialogue("request").say(INITIATOR, P.REQUEST)
    for missing in ("conversation", "sender", "protocol"):
        with pytest.raises(RemoteProtocolError) as caught:
            Conversation.answering(msgspec.structs.replace(message, **{missing: ""}), "ta")
        assert caught.value.field == missing
    with pytest.raises(RemoteProtocolError, match="known are"):
        Conversation.answering(msgspec.structs.replace(message, protocol="small-talk"), "ta")


def test_illegal_sends_are_local_errors(asked):
    """The error has the field, and the conversation is unchanged."""
    before = asked.sides[INITIATOR]
    for act, options, field in (
        (P.REQUEST, {}, "performative"),
        (P.CANCEL, {"id": ""}, "id"),
        (P.CANCEL, {"in_reply_to": "z"}, "in_reply_to"),
        (P.CANCEL, {"kind": Kind.CANCEL, "in_reply_to": "z"}, "in_reply_to"),
    ):
        with pytest.raises(LocalProtocolError) as caught:
            before.send(act, **{"id": "co-1-7", "now": 1.0} | options)
        assert caught.value.field == field
        assert asked.sides[INITIATOR] == before


@given(
    st.sampled_from(P),
    st.sampled_from([k for k in Kind if k is not Kind.CANCEL]),
    st.text(max_size=3),
)
def test_any_message_is_accepted_or_a_remote_error(performative, kind, label):
    """No message causes an exception other than RemoteProtocolError."""
    pair = opened("request", P.REQUEST)
    message = msgspec.structs.replace(pair.heard[0][1], performative=performative, reply_with=label)
    side = pair.sides[PARTICIPANT]
    try:
        after = side.receive(message, kind)
    except RemoteProtocolError:
        assert performative not in (P.NOT_UNDERSTOOD, P.CANCEL) or not is_label(label)
    else:
        assert performative in (P.NOT_UNDERSTOOD, P.CANCEL)
        assert after.allowed(RECEIVE) == ()


def test_what_is_said_arrives_as_it_was_said():
    """Content, language, ontology, time and the time to answer by."""
    said = {"content": msgspec.Raw(b"\x01"), "language": "CMD", "ontology": "kitchen"}
    ((_, came, _),) = opened("request", P.REQUEST, **said, reply_by=7.0, now=3.0).heard
    assert {name: getattr(came, name) for name in said} == said
    assert (came.reply_by, came.sent) == (7.0, 3.0)


def test_the_newest_labels_of_the_peer_can_be_answered():
    """Own labels are not among them; an answer without in-reply-to is one to the newest."""
    both = opened("subscribe", P.SUBSCRIBE)
    heard(both, PARTICIPANT, P.AGREE)
    labels = [f"ta-{at}" for at in range(MOST_HEARD + 4)]
    for label in labels:
        inform = both.say(PARTICIPANT, P.INFORM)
        side = both.sides[INITIATOR].receive(msgspec.structs.replace(inform, reply_with=label))
        both.sides[INITIATOR] = side
    assert side.heard == tuple(labels[-MOST_HEARD:])
    after, cancel = side.send(P.CANCEL, id="co-9", now=1.0)
    assert (after.heard, cancel.in_reply_to) == (side.heard, labels[-1])
    named = side.send(P.NOT_UNDERSTOOD, id="co-9", now=1.0, in_reply_to=labels[-2])[1]
    assert named.in_reply_to == labels[-2]
    assert not both.sides[PARTICIPANT].heard


@pytest.mark.parametrize(
    ("protocol", "act", "early", "after"),
    [
        ("subscribe", P.SUBSCRIBE, "stopping", "cancelled"),
        ("request", P.REQUEST, "too-late", "settled"),
    ],
)
def test_a_cancel_may_have_the_label_of_its_opening(protocol, act, early, after):
    """An answer to that label answers the opening where the state allows it, else the cancel.
    JADE's SubscriptionInitiator cancels so.
    """
    both = opened(protocol, act)
    heard(both, PARTICIPANT, P.AGREE)
    label = both.sides[INITIATOR].asked
    both.say(INITIATOR, P.CANCEL, id=label)
    assert heard(both, PARTICIPANT, P.INFORM).in_reply_to == label
    assert not both.sides[INITIATOR].ended
    both.take(PARTICIPANT)
    assert both.sides[PARTICIPANT].state == early
    last = P.INFORM if early == "stopping" else P.FAILURE
    heard(both, PARTICIPANT, last, kind=Kind.CANCEL, in_reply_to=label)
    assert both.states == (after, after)


def test_an_act_may_be_said_by_its_name(asked):
    """A message has the Performative all the same; one that was received without it is refused."""
    agree = asked.say(PARTICIPANT, "agree")
    assert type(agree.performative) is P
    with pytest.raises(LocalProtocolError, match="decode"):
        asked.sides[INITIATOR].receive(msgspec.structs.replace(agree, performative="agree"))
