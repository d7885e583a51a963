"""One call, several participants: who is silent, late, awarded, called again."""

import itertools

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fipa_codec.conversation import Conversation
from fipa_codec.errors import LocalProtocolError
from fipa_codec.multicast import Multicast
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import named
from fipa_codec.tables import SEND, Role

CROWD = ("a", "b", "c")
REPLY_BY = 10.0
OPENINGS = {
    "cfp": P.CFP,
    "icfp": P.CFP,
    "propose": P.PROPOSE,
    "subscribe": P.SUBSCRIBE,
    "request": P.REQUEST,
    "request-when": P.REQUEST_WHEN,
}


class Call:
    """An initiator, its multicast, and the participants' conversations; every message arrives at once."""

    def __init__(self, protocol, crowd=CROWD, reply_by=REPLY_BY):
        self.count, self.reply_by = 0, reply_by
        self.theirs = {}
        talks = [Conversation.open(protocol, Role.INITIATOR, id="i-1-1", me="i", peer=peer) for peer in crowd]
        self.group = Multicast.opened([self.said(talk, OPENINGS[protocol], 0.0) for talk in talks])

    def said(self, talk, act, now):
        """The initiator's conversation after it spoke, and the participant's after it heard."""
        self.count += 1
        opening = act in named(talk.protocol).openings
        reply_by = self.reply_by if opening else None
        talk, message = talk.send(act, id=f"i-{self.count}", now=now, reply_by=reply_by)
        theirs = self.theirs.get(talk.peer) or Conversation.answering(message, talk.peer)
        self.theirs[talk.peer] = theirs.receive(message)
        return talk

    def tell(self, told, now=5.0):
        """The initiator says what it was told to say."""
        for peer, act in told:
            self.note(self.said(self.group.talk(peer), act, now), now)

    def answer(self, peer, act, now=5.0):
        """A participant speaks."""
        self.count += 1
        self.theirs[peer], message = self.theirs[peer].send(act, id=f"{peer}-{self.count}", now=now)
        self.note(self.group.talk(peer).receive(message), now)

    def note(self, talk, now):
        """Noted, journalled, and the same."""
        group = self.group.noted(talk, now)
        self.group = msgspec.msgpack.decode(msgspec.msgpack.encode(group), type=Multicast)
        assert self.group == group

    def outcomes(self, now=11.0):
        """Of everybody."""
        return [self.group.outcome(peer, now) for peer in CROWD]


@pytest.mark.parametrize("protocol", OPENINGS)
def test_who_is_silent_at_reply_by_counts_as_refused_or_failed(protocol):
    """Equal to reply-by is in time; silence counts as refused in a contract net, as failed elsewhere."""
    call = Call(protocol)
    answer = next(row.performative for row in call.theirs["a"].table.allowed(call.theirs["a"].state, SEND))
    call.answer("a", answer, now=REPLY_BY)
    assert call.group.awaited(REPLY_BY) == ("b", "c")
    assert call.group.silent(REPLY_BY) == call.group.late == ()
    assert call.group.awaited(REPLY_BY + 0.001) == ()
    assert call.group.silent(REPLY_BY + 0.001) == ("b", "c")
    counted = "refused" if protocol in ("cfp", "icfp") else "failed"
    assert call.outcomes()[1:] == [counted, counted]


def test_several_awards_and_the_others_rejected():
    """Two of three are accepted in one word, each brings its own end."""
    call = Call("cfp")
    for peer in CROWD:
        call.answer(peer, P.PROPOSE)
    assert call.group.offers == CROWD
    told = call.group.award("a", "c")
    assert told == (("a", P.ACCEPT_PROPOSAL), ("c", P.ACCEPT_PROPOSAL), ("b", P.REJECT_PROPOSAL))
    call.tell(told)
    assert call.group.awarded == ("a", "c")
    call.answer("a", P.INFORM)
    call.answer("c", P.FAILURE)
    assert call.outcomes() == ["done", "rejected", "failed"]
    assert call.group.over


def test_a_later_award_may_follow_an_earlier_one():
    """Who proposes in time after an award may have one too."""
    call = Call("cfp")
    call.answer("a", P.PROPOSE)
    call.tell(call.group.award("a"))
    call.answer("b", P.PROPOSE)
    call.tell(call.group.award("b"))
    assert call.group.awarded == ("a", "b")


def test_late_proposals_are_rejected_whatever_they_offer():
    """A proposal after reply-by is no offer: it is rejected at once, and cannot be accepted."""
    call = Call("cfp")
    call.answer("a", P.PROPOSE, now=REPLY_BY)
    call.answer("b", P.PROPOSE, now=REPLY_BY + 0.001)
    assert (call.group.offers, call.group.late) == (("a",), ("b",))
    assert call.group.rejections == (("b", P.REJECT_PROPOSAL),)
    with pytest.raises(LocalProtocolError, match="'b' has no standing offer, a has"):
        call.group.award("b")
    call.tell(call.group.rejections)
    assert call.group.rejections == ()
    call.tell(call.group.award("a"))
    assert call.outcomes() == ["", "refused", "refused"]
    assert call.theirs["b"].state == "rejected"


def test_late_answer_elsewhere_counts_as_failed():
    """An agree that comes too late does not make the request good again; it is the initiator's to cancel."""
    call = Call("request")
    call.answer("a", P.AGREE, now=REPLY_BY + 1)
    call.answer("b", P.AGREE, now=REPLY_BY - 1)
    assert call.outcomes() == ["failed", "", "failed"]
    call.answer("b", P.INFORM, now=REPLY_BY + 9)
    assert call.outcomes() == ["failed", "done", "failed"]


def test_new_round_goes_to_those_that_proposed_only():
    """The chosen are called again with a reply-by of their own, the others are rejected, the silent get nothing."""
    call = Call("icfp")
    call.answer("a", P.PROPOSE)
    call.answer("b", P.PROPOSE)
    told = call.group.call_again("a")
    assert told == (("a", P.CFP), ("b", P.REJECT_PROPOSAL))
    call.reply_by = 20.0
    call.tell(told, now=11.0)
    assert call.group.awaited(15.0) == ("a",)
    assert call.group.silent(15.0) == ("c",)
    call.answer("a", P.PROPOSE, now=20.0)
    call.tell(call.group.award("a"), now=21.0)
    assert call.outcomes(21.0) == ["", "rejected", "refused"]


def test_late_in_one_round_is_not_late_in_the_next():
    """Every round has its own reply-by."""
    call = Call("icfp")
    call.answer("a", P.PROPOSE)
    call.reply_by = 20.0
    call.tell(call.group.call_again("a"))
    call.answer("a", P.PROPOSE, now=15.0)
    assert call.group.offers == ("a",)


@pytest.mark.parametrize(
    ("protocol", "chosen", "word"),
    [
        ("cfp", ("a",), "one round only; icfp has several"),
        ("icfp", (), "at least one participant"),
        ("icfp", ("b",), "'b' has no standing offer"),
        ("icfp", ("z",), "'z' has no standing offer"),
    ],
)
def test_rounds_that_cannot_be(protocol, chosen, word):
    """The error says what would be right."""
    call = Call(protocol)
    call.answer("a", P.PROPOSE)
    with pytest.raises(LocalProtocolError, match=word):
        call.group.call_again(*chosen)


@pytest.mark.parametrize("end", [None, P.INFORM, P.FAILURE])
def test_no_call_after_an_award(end):
    """Also when what was awarded has come to its end."""
    call = Call("icfp")
    call.answer("a", P.PROPOSE)
    call.answer("b", P.PROPOSE)
    call.tell(call.group.award("a")[:1])
    if end:
        call.answer("a", end)
    assert call.group.offers == ("b",)
    with pytest.raises(LocalProtocolError, match="no cfp after an award, and a has one"):
        call.group.call_again("b")


def test_what_is_no_multicast():
    """One id, one protocol, one conversation with each, all just opened."""
    talks = Call("cfp").group.talks
    others = Call("request").group.talks
    opened = Conversation.open("cfp", Role.INITIATOR, id="i-1-1", me="i", peer="d")
    for wrong in ((), (talks[0], others[1]), (talks[0], talks[0]), (*talks, opened)):
        with pytest.raises(LocalProtocolError):
            Multicast.opened(wrong)
    with pytest.raises(LocalProtocolError, match="'z' takes no part in i-1-1, a, b, c do"):
        Call("cfp").group.talk("z")


@given(st.data())
def test_contract_net_always_ends_and_only_with_what_was_offered_in_time(data):
    """Any order of answers, in time or late, and any choice: all end, and nobody late or silent is awarded."""
    call = Call("icfp")
    offered_late, now = set(), 0.0
    for _ in range(40):
        if call.group.over:
            break
        speakers = [peer for peer, talk in call.theirs.items() if talk.table.allowed(talk.state, SEND)]
        peer = data.draw(st.sampled_from([*speakers, "initiator"]))
        now += data.draw(st.sampled_from([0.0, 1.0, 12.0]))
        if peer == "initiator":
            choose(call, data, now)
            continue
        talk = call.theirs[peer]
        act = data.draw(st.sampled_from([row.performative for row in talk.table.allowed(talk.state, SEND)]))
        if act is P.PROPOSE and talk.late(now):
            offered_late.add(peer)
        call.answer(peer, act, now)
    assert not offered_late & set(call.group.awarded)
    for peer in offered_late:
        assert call.group.outcome(peer, now) == "refused"


def choose(call, data, now):
    """The initiator rejects the late ones and decides on the offers, one way or the other."""
    call.tell(call.group.rejections, now)
    some = data.draw(st.sets(st.sampled_from(call.group.offers))) if call.group.offers else set()
    if some and not call.group.awarded and data.draw(st.booleans()):
        call.reply_by = now + 5.0
        call.tell(call.group.call_again(*some), now)
    else:
        call.tell(call.group.award(*some), now)


def test_any_order_of_noting_comes_to_the_same():
    """What is known of a crowd does not depend on who answered first."""
    ends = set()
    for order in itertools.permutations(CROWD):
        call = Call("cfp")
        for peer in order:
            call.answer(peer, P.PROPOSE if peer != "b" else P.REFUSE)
        ends.add((call.group.offers, tuple(call.outcomes(5.0))))
    assert ends == {(("a", "c"), ("", "refused", ""))}
