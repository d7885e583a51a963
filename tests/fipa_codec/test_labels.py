"""Labels as FIPA and other platforms use them: any message may be answered, a cancel may repeat its
subscribe's.

Behaviours of JADE 4.6.5 (ContractNetInitiator, SubscriptionInitiator) as they were observed on
loopback (2026-11-22).
"""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fipa_codec.communicate import Communicate
from fipa_codec.conversation import MOST_HEARD, Conversation
from fipa_codec.errors import LocalProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import Role

ME, PEER = "ta", "jade"


def foreign(protocol: str, act: P, label: str = "", answers: str = "") -> Communicate:
    """A message of the other platform."""
    return Communicate(
        performative=act, protocol=protocol, reply_with=label, in_reply_to=answers,
        conversation="C1", sender=PEER,
        receiver=ME,
    )  # fmt: skip


def opened(protocol: str, act: P, label: str) -> Conversation:
    """Our side after the peer's opening."""
    message = foreign(protocol, act, label)
    return Conversation.answering(message, ME).receive(message)


def test_a_contractor_answers_the_accept() -> None:
    """ContractNetInitiator puts a new reply-with on the accept and looks for the result by it. The
    label of the cfp was heard, too; one that nobody said is an error.
    """
    side, _ = opened("cfp", P.CFP, "R1").send(P.PROPOSE, id="1", now=1.0)
    side = side.receive(foreign("cfp", P.ACCEPT_PROPOSAL, "R2"))
    for answers, label in ({}, "R2"), ({"in_reply_to": "R1"}, "R1"):
        done, result = side.send(P.INFORM, id="2", now=2.0, **answers)
        assert (done.state, result.in_reply_to) == ("done", label)
    with pytest.raises(LocalProtocolError, match="'R9' is not a message"):
        side.send(P.INFORM, id="2", now=2.0, in_reply_to="R9")


def opening(protocol: str, act: P) -> tuple[Conversation, Communicate]:
    """Our side after its own opening, and that."""
    side = Conversation.open(protocol, Role.INITIATOR, id="C1", me=ME, peer=PEER)
    return side.send(act, id="1", now=1.0)


def test_an_initiator_answers_the_proposal() -> None:
    """A proposal with a reply-with of its own is accepted under it; an award of the second round
    does not answer the proposal of the first.
    """
    side, call = opening("icfp", P.CFP)
    side = side.receive(foreign("icfp", P.PROPOSE, "R7", call.reply_with))
    assert side.send(P.ACCEPT_PROPOSAL, id="2", now=2.0)[1].in_reply_to == "R7"
    side, second = side.send(P.CFP, id="2", now=2.0)
    assert side.heard == ()
    side = side.receive(foreign("icfp", P.PROPOSE, "", second.reply_with))
    assert side.send(P.ACCEPT_PROPOSAL, id="3", now=3.0)[1].in_reply_to == ""


def test_the_newest_label_is_answered() -> None:
    """A message of the peer without one changes nothing; an older one can be named."""
    side, asked = opening("subscribe", P.SUBSCRIBE)
    for label in ("R7", "R8", ""):
        side = side.receive(foreign("subscribe", P.INFORM, label, asked.reply_with))
    assert side.send(P.NOT_UNDERSTOOD, id="2", now=2.0)[1].in_reply_to == "R8"
    assert side.send(P.NOT_UNDERSTOOD, id="2", now=2.0, in_reply_to="R7")[1].in_reply_to == "R7"


def test_a_cancel_may_carry_the_label_of_its_subscribe() -> None:
    """SubscriptionInitiator sends the subscription's own reply-with again: that is not a copy, and
    it is answered.
    """
    side, _ = opened("subscribe", P.SUBSCRIBE, "R1").send(P.AGREE, id="1", now=1.0)
    side, told = side.send(P.INFORM, id="2", now=2.0)
    assert told.in_reply_to == "R1"
    side = side.receive(foreign("subscribe", P.CANCEL, "R1"))
    side, answer = side.send(P.INFORM, id="3", now=3.0, kind=Kind.CANCEL)
    assert (side.state, answer.in_reply_to) == ("cancelled", "R1")


def test_a_request_goes_on_beside_a_cancel_of_the_same_label() -> None:
    """The state decides whether a word answers the opening or the cancel."""
    side, _ = opened("request", P.REQUEST, "R1").send(P.AGREE, id="1", now=1.0)
    side = side.receive(foreign("request", P.CANCEL, "R1"))
    assert side.state == "stopping"
    done, _ = side.send(P.INFORM, id="2", now=2.0, in_reply_to="R1")
    assert done.state == "too-late"
    stopped, _ = side.send(P.INFORM, id="2", now=2.0, kind=Kind.CANCEL)
    assert stopped.state == "cancelled"


@pytest.mark.parametrize("label", ["R1", ""])
def test_a_cancel_without_a_label_is_answered_without_one(label: str) -> None:
    """As SubscriptionInitiator says it where it ignores the answer; no answer of the opening is
    taken for it.
    """
    side, _ = opened("fipa-subscribe", P.SUBSCRIBE, label).send(P.AGREE, id="1", now=1.0)
    with pytest.raises(LocalProtocolError, match=r"cannot send inform\[cancel\]"):
        side.send(P.INFORM, id="2", now=2.0, kind=Kind.CANCEL)
    side = side.receive(foreign("fipa-subscribe", P.CANCEL))
    told, message = side.send(P.INFORM, id="2", now=2.0)
    assert (told.state, message.in_reply_to) == ("stopping", label)
    ended, answer = told.send(P.INFORM, id="3", now=3.0, kind=Kind.CANCEL)
    assert (ended.state, answer.in_reply_to) == ("cancelled", "")


def test_a_late_cancel_without_a_label_is_answered() -> None:
    """After the end, and of a conversation that nobody remembers."""
    ended, _ = opened("fipa-request", P.REQUEST, "R1").send(P.INFORM, id="1", now=1.0)
    forgotten = Conversation.answering(foreign("fipa-request", P.CANCEL), ME)
    for side in (ended, forgotten):
        owing = side.receive(foreign("fipa-request", P.CANCEL))
        assert owing.owes
        settled, answer = owing.send(P.FAILURE, id="2", now=2.0, kind=Kind.CANCEL)
        assert (settled.state, answer.in_reply_to) == ("settled", "")


@given(st.lists(st.integers(0, 99), max_size=3 * MOST_HEARD))
def test_labels_of_a_long_subscription_are_bounded(numbers: list[int]) -> None:
    """The newest ones can be answered; memory does not grow with the subscription."""
    side, asked = opening("subscribe", P.SUBSCRIBE)
    labels = [f"R{number}" for number in numbers]
    for label in labels:
        side = side.receive(foreign("subscribe", P.INFORM, label, asked.reply_with))
    assert side.heard == tuple(labels[-MOST_HEARD:])


def test_the_name_of_an_act_is_that_act() -> None:
    """Coerced, so that nothing works by half; what is no act is refused, sent or received, with
    what would have been right.
    """
    side = opened("cfp", P.CFP, "R1")
    for act in ("propose", P.PROPOSE):
        offered, said = side.send(act, id="1", now=1.0)  # type: ignore[arg-type]
        assert (offered.state, type(said.performative)) == ("offered", P)
    with pytest.raises(LocalProtocolError, match="must be one of accept-proposal, agree"):
        side.send("offer", id="1", now=1.0)  # type: ignore[arg-type]
    with pytest.raises(LocalProtocolError, match="must be a Performative"):
        side.receive(foreign("cfp", "cancel"))  # type: ignore[arg-type]
