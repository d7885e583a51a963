"""Both sides of a conversation, connected by queues: exactly the messages of the tables are accepted."""

import msgspec
import pytest
from dialogue import Dialogue
from hypothesis import given
from hypothesis import strategies as st

from fipa_codec.communicate import decode, encode, is_label
from fipa_codec.conversation import Conversation
from fipa_codec.errors import LocalProtocolError, MalformedError, RemoteProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import NOT_UNDERSTOOD, RECEIVE, SEND, Role

INITIATOR, PARTICIPANT = Role.INITIATOR, Role.PARTICIPANT


class Pair:
    """Both sides of one conversation and two FIFO channels; messages and states are encoded and decoded."""

    def __init__(self, protocol):
        self.sides = {INITIATOR: Conversation.open(protocol, INITIATOR, id="co-1-1", me="co", peer="ta")}
        self.wires = {INITIATOR: [], PARTICIPANT: []}
        self.count = 0

    def send(self, role, performative, **options):
        """Send a message of `role`; it stays in transit."""
        self.count += 1
        options = {"id": f"{role}-1-{self.count}", "now": float(self.count)} | options
        side, message = self.sides[role].send(performative, **options)
        self.sides[role] = recorded(side)
        self.wires[role.other].append((encode(message), options.get("kind", Kind.PLAIN)))
        return message

    def take(self, role):
        """Receive the first message in transit to `role`; the participant opens its side with it."""
        data, kind = self.wires[role].pop(0)
        message = decode(data)
        if role not in self.sides:
            self.sides[role] = Conversation.answering(message, "ta")
        self.sides[role] = recorded(self.sides[role].receive(message, kind))
        return message

    def say(self, role, performative, **options):
        """Send a message and receive it at once."""
        self.send(role, performative, **options)
        return self.take(role.other)

    @property
    def states(self):
        """States of initiator and participant."""
        return self.sides[INITIATOR].state, self.sides[PARTICIPANT].state


def recorded(side):
    """Return the conversation encoded and decoded, as by a journal; it must be equal."""
    again = msgspec.msgpack.decode(msgspec.msgpack.encode(side), type=Conversation)
    assert again == side
    return again


@pytest.fixture
def asked():
    """A request that was received and is not answered yet."""
    pair = Pair("request")
    pair.say(INITIATOR, P.REQUEST, reply_by=10.0)
    return pair


def test_request_agree_progress_result(asked):
    """The usual sequence; m_t is the request's m_w, and progress does not end the conversation."""
    assert asked.say(PARTICIPANT, P.AGREE).in_reply_to == "initiator-1-1"
    asked.say(PARTICIPANT, P.INFORM, kind=Kind.PROGRESS)
    assert asked.states == ("agreed", "agreed")
    asked.say(PARTICIPANT, P.INFORM)
    assert asked.states == ("done", "done")
    assert all(side.ended for side in asked.sides.values())


@pytest.mark.parametrize("bad", ["a b", "a\n", "x" * 129, "\u00e4", "\ud800"])
def test_invalid_words_and_labels_are_rejected(bad):
    """Own names and ids in open and send, those of the peer in its opening, and each m_w that is stored."""
    named = {"id": "co-1-1", "me": "co", "peer": "ta"}
    for field in named:
        with pytest.raises(LocalProtocolError, match="must match"):
            Conversation.open("request", INITIATOR, **named | {field: bad})
    pair = Pair("request")
    with pytest.raises(LocalProtocolError, match="id that matches"):
        pair.sides[INITIATOR].send(P.REQUEST, id=bad, now=1.0)
    opening = pair.say(INITIATOR, P.REQUEST)
    for field in ("conversation", "reply_with", "id", "sender", "language"):
        with pytest.raises(MalformedError, match="must match"):
            Conversation.answering(msgspec.structs.replace(opening, **{field: bad}), "ta")
    cancel = pair.send(INITIATOR, P.CANCEL)
    assert pair.sides[PARTICIPANT].receive(cancel).cancel == cancel.reply_with
    with pytest.raises(RemoteProtocolError, match="one that matches"):
        pair.sides[PARTICIPANT].receive(msgspec.structs.replace(cancel, reply_with=bad))


def test_the_kind_of_other_acts_than_inform_is_ignored(asked):
    """A language may classify the content of an agree or a failure too; only that of an inform matters."""
    asked.say(PARTICIPANT, P.AGREE, kind=Kind.PROGRESS)
    asked.say(PARTICIPANT, P.FAILURE, kind=Kind.FINAL)
    assert asked.states == ("failed", "failed")


def test_cancel_in_time_is_answered_by_inform(asked):
    """inform in reply to the cancel ends the cancel and the request."""
    asked.say(PARTICIPANT, P.AGREE)
    cancel = asked.say(INITIATOR, P.CANCEL)
    assert asked.say(PARTICIPANT, P.INFORM, kind=Kind.CANCEL).in_reply_to == cancel.reply_with
    assert asked.states == ("cancelled", "cancelled")


def test_cancel_that_crosses_the_result_is_answered_by_failure(asked):
    """The result is received; the failure, by default in reply to the cancel, is still expected."""
    asked.send(PARTICIPANT, P.INFORM)
    cancel = asked.send(INITIATOR, P.CANCEL)
    asked.take(INITIATOR)
    asked.take(PARTICIPANT)
    assert asked.states == ("overtaken", "too-late")
    assert asked.sides[PARTICIPANT].owes
    assert asked.say(PARTICIPANT, P.FAILURE).in_reply_to == cancel.reply_with
    assert asked.states == ("settled", "settled")


def test_result_while_stopping_comes_before_the_failure(asked):
    """An act that ends while it is being stopped: first its result, then the failure of the cancel."""
    asked.say(PARTICIPANT, P.AGREE)
    asked.say(INITIATOR, P.CANCEL)
    assert asked.say(PARTICIPANT, P.FAILURE).in_reply_to == "initiator-1-1"
    assert asked.states == ("overtaken", "too-late")
    asked.say(PARTICIPANT, P.FAILURE)
    assert asked.states == ("settled", "settled")


def test_cancel_of_a_forgotten_conversation_is_answered(asked):
    """The participant needs no memory of ended conversations to answer a late cancel."""
    asked.say(PARTICIPANT, P.REFUSE)
    del asked.sides[PARTICIPANT]
    asked.sides[INITIATOR] = msgspec.structs.replace(asked.sides[INITIATOR], state="asked")
    cancel = asked.say(INITIATOR, P.CANCEL)
    assert asked.say(PARTICIPANT, P.FAILURE).in_reply_to == cancel.reply_with
    assert asked.states == ("cancelled", "settled")


def test_a_side_that_must_send_receives_nothing(asked):
    """The failure in reply to a late cancel is sent in the step that received the cancel."""
    message = asked.sides[INITIATOR].send(P.CANCEL, id="x", now=1.0)[1]
    asked.say(PARTICIPANT, P.INFORM)
    owing = msgspec.structs.replace(asked.sides[PARTICIPANT], state="too-late")
    with pytest.raises(LocalProtocolError, match=r"must send failure\[cancel\] before"):
        owing.receive(msgspec.structs.replace(message, performative=P.CANCEL, reply_with="k"))


def test_deadline_bounds_the_first_answer_only(asked):
    """Both sides have the deadline until the answer; equal is in time; after an agree there is none."""
    for side in asked.sides.values():
        assert side.deadline == 10.0
        assert not side.late(10.0)
        assert side.late(10.001)
    asked.say(PARTICIPANT, P.AGREE)
    assert [side.deadline for side in asked.sides.values()] == [None, None]
    assert not asked.sides[INITIATOR].late(1e12)


def test_deadline_of_a_cancel_stands_until_its_answer(asked):
    """Messages that cross the cancel do not answer it."""
    asked.send(PARTICIPANT, P.AGREE)
    asked.send(PARTICIPANT, P.INFORM, kind=Kind.PROGRESS)
    asked.send(PARTICIPANT, P.INFORM)
    asked.send(INITIATOR, P.CANCEL, reply_by=20.0)
    for _ in range(3):
        asked.take(INITIATOR)
        assert asked.sides[INITIATOR].deadline == 20.0
    asked.take(PARTICIPANT)
    asked.say(PARTICIPANT, P.FAILURE)
    assert [side.deadline for side in asked.sides.values()] == [None, None]


def test_the_last_message_sets_no_deadline(asked):
    """Although it has a reply-by: it is not answered."""
    asked.say(PARTICIPANT, P.INFORM, reply_by=30.0)
    assert asked.states == ("done", "done")
    assert [side.deadline for side in asked.sides.values()] == [None, None]


def test_late_answer_is_still_accepted(asked):
    """A passed deadline does not end the conversation; it stays open until the last message of the peer."""
    assert asked.sides[INITIATOR].late(11.0)
    asked.say(PARTICIPANT, P.INFORM, now=11.0)
    assert asked.states == ("done", "done")


@pytest.mark.parametrize("answer", [P.INFORM, P.INFORM_REF, P.FAILURE, P.REFUSE])
@pytest.mark.parametrize("query", [P.QUERY_REF, P.QUERY_IF])
def test_repeated_query(query, answer):
    """A repetition keeps m_w and the deadline; the answer to the other copy is ignored."""
    pair = Pair("query")
    first = pair.send(INITIATOR, query, reply_by=5.0)
    again = pair.send(INITIATOR, query)
    assert again.reply_with == first.reply_with
    assert pair.sides[INITIATOR].deadline == 5.0
    for _ in range(2):
        pair.take(PARTICIPANT)
        pair.say(PARTICIPANT, answer)
    assert pair.sides[INITIATOR].ended
    assert pair.sides[PARTICIPANT].ended


def test_another_query_in_the_same_conversation_is_an_error():
    """A repetition has the same m_w."""
    pair = Pair("query")
    message = pair.say(INITIATOR, P.QUERY_REF)
    with pytest.raises(RemoteProtocolError) as caught:
        pair.sides[PARTICIPANT].receive(msgspec.structs.replace(message, reply_with="co-1-9"))
    assert caught.value.field == "reply_with"


def test_subscription_lives_until_cancelled():
    """Repeated until agreed, any number of informs, ended by a cancel that an inform crosses."""
    pair = Pair("subscribe")
    pair.send(INITIATOR, P.SUBSCRIBE)
    pair.send(INITIATOR, P.SUBSCRIBE)
    for _ in range(2):
        pair.take(PARTICIPANT)
        pair.say(PARTICIPANT, P.AGREE)
    for _ in range(3):
        pair.say(PARTICIPANT, P.INFORM)
    assert pair.states == ("live", "live")
    assert not pair.sides[INITIATOR].ended
    pair.send(PARTICIPANT, P.INFORM)
    pair.say(INITIATOR, P.CANCEL)
    pair.take(INITIATOR)
    pair.say(PARTICIPANT, P.INFORM)
    assert pair.states == ("cancelled", "cancelled")


@pytest.mark.parametrize("who", Role)
def test_not_understood_ends_the_interaction(asked, who):
    """Either side may send it at any point; its sender ignores messages that are still in transit."""
    asked.send(who.other, P.AGREE if who is INITIATOR else P.CANCEL)
    asked.say(who, P.NOT_UNDERSTOOD, in_reply_to="")
    asked.take(who)
    assert asked.states == (NOT_UNDERSTOOD, NOT_UNDERSTOOD)
    assert all(side.ended and side.deadline is None for side in asked.sides.values())


def test_not_understood_as_answer_to_a_cancel_is_a_failed_cancel(asked):
    """The conversation ends as by a failure in reply to the cancel."""
    asked.say(PARTICIPANT, P.AGREE)
    cancel = asked.say(INITIATOR, P.CANCEL)
    asked.say(PARTICIPANT, P.NOT_UNDERSTOOD, in_reply_to=cancel.reply_with)
    assert asked.states == ("cancelled", "cancelled")


def test_not_understood_changes_no_final_state(asked):
    """A conversation that has ended keeps its state; nobody says it there, or two agents answer each other for ever."""
    message = asked.sides[PARTICIPANT].send(P.NOT_UNDERSTOOD, id="x", now=1.0)[1]
    asked.say(PARTICIPANT, P.REFUSE)
    assert asked.sides[INITIATOR].receive(message).state == "refused"
    for side in asked.sides.values():
        with pytest.raises(LocalProtocolError, match="has ended; drop what came"):
            side.send(P.NOT_UNDERSTOOD, id="y", now=1.0)


@pytest.mark.parametrize(
    ("field", "value"),
    [("conversation", "co-1-2"), ("sender", "pl"), ("receiver", "km"), ("protocol", "query"), ("in_reply_to", "x-9-9")],
)
def test_messages_of_other_conversations_are_an_error_with_the_field(asked, field, value):
    """Id, sides and protocol are constant; an answer refers to a message of the conversation."""
    message = asked.send(PARTICIPANT, P.AGREE)
    with pytest.raises(RemoteProtocolError) as caught:
        asked.sides[INITIATOR].receive(msgspec.structs.replace(message, **{field: value}))
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
    agreed = msgspec.structs.replace(asked.say(PARTICIPANT, P.AGREE), protocol="fipa-request")
    with pytest.raises(RemoteProtocolError, match="expected 'request'"):
        asked.sides[INITIATOR].receive(agreed)


def test_error_has_the_allowed_messages(asked):
    """And agent, conversation, protocol and state."""
    message = msgspec.structs.replace(asked.send(PARTICIPANT, P.AGREE), performative=P.PROPOSE)
    with pytest.raises(RemoteProtocolError) as caught:
        asked.sides[INITIATOR].receive(message)
    for word in ("co-1-1", "request", "'co'", "asked", "propose", "agree, refuse, failure, inform"):
        assert word in caught.value.reason
    assert not asked.sides[INITIATOR].takes(message)


@pytest.mark.parametrize(
    ("missing", "performative"), [("conversation", P.REQUEST), ("sender", P.REQUEST), ("protocol", P.REQUEST)]
)
def test_openings_need_conversation_sender_and_protocol(missing, performative):
    """Without them the message cannot be answered, or its answer not be recognised."""
    message = Pair("request").send(INITIATOR, performative)
    with pytest.raises(RemoteProtocolError) as caught:
        Conversation.answering(msgspec.structs.replace(message, **{missing: ""}), "ta")
    assert caught.value.field == missing
    with pytest.raises(RemoteProtocolError, match="known are"):
        Conversation.answering(msgspec.structs.replace(message, protocol="small-talk"), "ta")


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"performative": P.REQUEST}, "performative"),
        ({"performative": P.CANCEL, "id": ""}, "id"),
        ({"performative": P.CANCEL, "in_reply_to": "z"}, "in_reply_to"),
        ({"performative": P.CANCEL, "kind": Kind.CANCEL, "in_reply_to": "z"}, "in_reply_to"),
    ],
)
def test_illegal_sends_are_local_errors(asked, options, field):
    """The error has the field, and the conversation is unchanged."""
    before = asked.sides[INITIATOR]
    with pytest.raises(LocalProtocolError) as caught:
        before.send(**({"id": "co-1-7", "now": 1.0} | options))
    assert caught.value.field == field
    assert asked.sides[INITIATOR] == before


@given(st.sampled_from(["request", "query", "subscribe"]), st.data())
def test_every_allowed_message_is_accepted(protocol, data):
    """In any run of both sides over FIFO channels every message has a row in the state of its receiver."""
    walk(Pair(protocol), data)


def walk(pair, data, steps=25):
    """Perform random steps: a side sends an allowed message or receives the next one."""
    for _ in range(steps):
        choices = [("take", role) for role in Role if pair.wires[role] and not owes(pair, role)]
        choices += [("send", role, row) for role, side in pair.sides.items() for row in sends(side)]
        if not choices:
            break
        action, role, *rows = data.draw(st.sampled_from(choices))
        if action == "take":
            pair.take(role)
        else:
            pair.send(role, rows[0].performative, kind=rows[0].kind)


def owes(pair, role):
    """Whether this side must send first."""
    return role in pair.sides and pair.sides[role].owes


def sends(side):
    """Return the rows by which a side may send now."""
    return side.table.allowed(side.state, SEND)


@given(st.sampled_from(P), st.sampled_from([k for k in Kind if k is not Kind.CANCEL]), st.text(max_size=3))
def test_any_message_is_accepted_or_a_remote_error(performative, kind, label):
    """No message causes an exception other than RemoteProtocolError."""
    pair = Pair("request")
    message = msgspec.structs.replace(pair.say(INITIATOR, P.REQUEST), performative=performative, reply_with=label)
    side = pair.sides[PARTICIPANT]
    try:
        after = side.receive(message, kind)
    except RemoteProtocolError:
        assert performative not in (P.NOT_UNDERSTOOD, P.CANCEL) or not is_label(label)
    else:
        assert performative in (P.NOT_UNDERSTOOD, P.CANCEL)
        assert after.allowed(RECEIVE) == ()


def test_takes_says_what_receive_would_do(asked):
    """True where it takes the message; a message of somebody else, or out of sequence, is not taken."""
    answer = asked.send(PARTICIPANT, P.AGREE)
    mine = asked.sides[INITIATOR]
    assert mine.takes(answer) is True
    assert mine.takes(msgspec.structs.replace(answer, sender="pl")) is False
    assert mine.takes(msgspec.structs.replace(answer, performative=P.CONFIRM)) is False


def test_what_is_said_arrives_as_it_was_said():
    """Content, language, ontology, time and the time to answer by."""
    pair = Pair("request")
    said = {"content": msgspec.Raw(b"\x01"), "language": "CMD", "ontology": "kitchen", "reply_by": 7.0, "now": 3.0}
    heard = pair.say(INITIATOR, P.REQUEST, **said)
    assert (bytes(heard.content), heard.language, heard.ontology, heard.reply_by, heard.sent) == (
        b"\x01",
        "CMD",
        "kitchen",
        7.0,
        3.0,
    )
