"""Several participants of one call: silence, late answers, awards, further rounds."""

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
OPENINGS = dict.fromkeys(("cfp", "icfp"), P.CFP) | {
    act: P(act) for act in ("propose", "subscribe", "request", "request-when")
}


class Call:
    """An initiator with its multicast, and the conversations of the participants; messages arrive
    at once.
    """

    def __init__(self, protocol, crowd=CROWD, reply_by=REPLY_BY):
        self.count, self.reply_by = 0, reply_by
        self.theirs = {}
        talks = [
            Conversation.open(protocol, Role.INITIATOR, id="i-1-1", me="i", peer=peer)
            for peer in crowd
        ]
        self.group = Multicast.opened([self.said(talk, OPENINGS[protocol], 0.0) for talk in talks])

    def said(self, talk, act, now):
        """Send a message of the initiator to a participant; return the initiator's conversation
        after it.
        """
        self.count += 1
        opening = act in named(talk.protocol).openings
        reply_by = self.reply_by if opening else None
        talk, message = talk.send(act, id=f"i-{self.count}", now=now, reply_by=reply_by)
        theirs = self.theirs.get(talk.peer) or Conversation.answering(message, talk.peer)
        self.theirs[talk.peer] = theirs.receive(message)
        return talk

    def tell(self, told, now=5.0):
        """Send messages of the initiator."""
        for peer, act in told:
            self.note(self.said(self.group.talk(peer), act, now), now)

    def answer(self, peer, act, now=5.0):
        """Send a message of a participant to the initiator."""
        self.count += 1
        self.theirs[peer], message = self.theirs[peer].send(act, id=f"{peer}-{self.count}", now=now)
        self.note(self.group.talk(peer).receive(message), now)

    def note(self, talk, now):
        """Record a conversation in the multicast, which must be equal after encoding and
        decoding.
        """
        group = self.group.noted(talk, now)
        self.group = msgspec.msgpack.decode(msgspec.msgpack.encode(group), type=Multicast)
        assert self.group == group

    def outcomes(self, now=11.0):
        """Return the outcome of every participant."""
        return [self.group.outcome(peer, now) for peer in CROWD]


@pytest.mark.parametrize("protocol", OPENINGS)
def test_silence_at_reply_by_counts_as_refused_or_failed(protocol):
    """As refused in a contract net, as failed elsewhere; equal to reply-by is in time."""
    call = Call(protocol)
    answer = next(
        row.performative for row in call.theirs["a"].table.allowed(call.theirs["a"].state, SEND)
    )
    call.answer("a", answer, now=REPLY_BY)
    assert call.group.awaited(REPLY_BY) == ("b", "c")
    assert call.group.silent(REPLY_BY) == call.group.late == ()
    assert call.group.awaited(REPLY_BY + 0.001) == ()
    assert call.group.silent(REPLY_BY + 0.001) == ("b", "c")
    counted = "refused" if protocol in ("cfp", "icfp") else "failed"
    assert call.outcomes()[1:] == [counted, counted]


def test_a_silent_participant_keeps_nobody_waiting():
    """After reply-by, if all others have ended; without a reply-by it is waited for, and what was
    agreed is, too.
    """
    call = Call("cfp")
    call.answer("a", P.PROPOSE)
    call.answer("b", P.REFUSE)
    assert not call.group.over(REPLY_BY + 0.001)
    call.tell(call.group.award("a"))
    assert not call.group.over(REPLY_BY + 0.001)
    call.answer("a", P.INFORM)
    assert not call.group.over(REPLY_BY)
    assert call.group.over(REPLY_BY + 0.001)
    assert call.outcomes() == ["done", "refused", "refused"]
    assert not Call("cfp", reply_by=None).group.over(1e9)


def test_a_silent_winner_keeps_nobody_waiting():
    """After the reply-by of its award it counts as failed, until it reports."""
    call = offered("cfp", *CROWD)
    for peer, act in call.group.award("b"):
        talk, message = call.group.talk(peer).send(act, id=f"i-{peer}", now=5.0, reply_by=20.0)
        call.theirs[peer] = call.theirs[peer].receive(message)
        call.note(talk, 5.0)
    assert (call.group.over(20.0), call.outcomes(20.0)) == (False, ["rejected", "", "rejected"])
    assert (call.group.over(20.1), call.outcomes(20.1)[1]) == (True, "failed")
    call.answer("b", P.INFORM, now=21.0)
    assert call.outcomes(21.0)[1] == "done"


def offered(protocol, *peers):
    """A call that these have answered with a proposal."""
    call = Call(protocol)
    for peer in peers:
        call.answer(peer, P.PROPOSE)
    return call


def test_several_awards_and_the_others_rejected():
    """Two of three proposals are accepted at once; each award has its own outcome."""
    call = offered("cfp", *CROWD)
    assert call.group.offers == CROWD
    told = call.group.award("a", "c")
    assert told == (("a", P.ACCEPT_PROPOSAL), ("c", P.ACCEPT_PROPOSAL), ("b", P.REJECT_PROPOSAL))
    call.tell(told)
    assert call.group.awarded == ("a", "c")
    call.answer("a", P.INFORM)
    call.answer("c", P.FAILURE)
    assert call.outcomes() == ["done", "rejected", "failed"]
    assert call.group.over(0.0)


def test_a_later_award_may_follow_an_earlier_one():
    """A proposal in time after an award can be accepted too."""
    call = Call("cfp")
    call.answer("a", P.PROPOSE)
    call.tell(call.group.award("a"))
    call.answer("b", P.PROPOSE)
    call.tell(call.group.award("b"))
    assert call.group.awarded == ("a", "b")


def test_late_proposals_are_rejected():
    """A proposal after reply-by is rejected at once and cannot be accepted."""
    call = Call("cfp")
    call.answer("a", P.PROPOSE, now=REPLY_BY)
    call.answer("b", P.PROPOSE, now=REPLY_BY + 0.001)
    assert (call.group.offers, call.group.late) == (("a",), ("b",))
    assert call.group.rejections == (("b", P.REJECT_PROPOSAL),)
    with pytest.raises(
        LocalProtocolError, match="'b' has no open proposal; there are proposals of: a"
    ):
        call.group.award("b")
    call.tell(call.group.rejections)
    assert call.group.rejections == ()
    call.tell(call.group.award("a"))
    assert call.outcomes() == ["", "refused", "refused"]
    assert call.theirs["b"].state == "rejected"


def test_late_answer_elsewhere_counts_as_failed():
    """A late agree does not change the outcome; the initiator must cancel."""
    call = Call("request")
    call.answer("a", P.AGREE, now=REPLY_BY + 1)
    call.answer("b", P.AGREE, now=REPLY_BY - 1)
    assert call.outcomes() == ["failed", "", "failed"]
    call.answer("b", P.INFORM, now=REPLY_BY + 9)
    assert call.outcomes() == ["failed", "done", "failed"]


def test_new_round_is_for_participants_with_proposals():
    """The chosen ones get a cfp with its own reply-by, other proposals are rejected, the silent get
    no message. Late in one round is not late in the next.
    """
    call = offered("icfp", "a", "b")
    told = call.group.call_again("a")
    assert told == (("a", P.CFP), ("b", P.REJECT_PROPOSAL))
    call.reply_by = 20.0
    call.tell(told, now=11.0)
    assert call.group.awaited(15.0) == ("a",)
    assert call.group.silent(15.0) == ("c",)
    call.answer("a", P.PROPOSE, now=20.0)
    assert call.group.offers == ("a",)
    call.tell(call.group.award("a"), now=21.0)
    assert call.outcomes(21.0) == ["", "rejected", "refused"]


@pytest.mark.parametrize(
    ("protocol", "chosen", "word"),
    [
        ("cfp", ("a",), "one round only; use icfp"),
        ("icfp", (), "needs a participant"),
        ("icfp", ("b",), "'b' has no open proposal"),
        ("icfp", ("z",), "'z' has no open proposal"),
    ],
)
def test_illegal_rounds_are_local_errors(protocol, chosen, word):
    """The error says what is allowed."""
    call = offered(protocol, "a")
    with pytest.raises(LocalProtocolError, match=word):
        call.group.call_again(*chosen)


@pytest.mark.parametrize("end", [None, P.INFORM, P.FAILURE])
def test_no_new_round_after_an_award(end):
    """Not even after the awarded act has ended."""
    call = offered("icfp", "a", "b")
    call.tell(call.group.award("a")[:1])
    if end:
        call.answer("a", end)
    assert call.group.offers == ("b",)
    with pytest.raises(LocalProtocolError, match=r"no new round after an award \(to a\)"):
        call.group.call_again("b")


def test_illegal_multicasts_are_local_errors():
    """They need one id, one protocol, one conversation with each participant, all just opened."""
    talks = Call("cfp").group.talks
    others = Call("request").group.talks
    opened = Conversation.open("cfp", Role.INITIATOR, id="i-1-1", me="i", peer="d")
    for wrong in ((), (talks[0], others[1]), (talks[0], talks[0]), (*talks, opened)):
        with pytest.raises(LocalProtocolError):
            Multicast.opened(wrong)
    with pytest.raises(
        LocalProtocolError, match="'z' is not a participant of i-1-1, these are: a, b, c"
    ):
        Call("cfp").group.talk("z")


@given(st.data())
def test_contract_net_always_ends_and_only_with_what_was_offered_in_time(data):
    """Any order of answers, in time or late, and any choice: late and silent participants get no
    award.
    """
    call = Call("icfp")
    offered_late, now = set(), 0.0
    for _ in range(40):
        if call.group.over(0.0):
            break
        speakers = [
            peer for peer, talk in call.theirs.items() if talk.table.allowed(talk.state, SEND)
        ]
        peer = data.draw(st.sampled_from([*speakers, "initiator"]))
        now += data.draw(st.sampled_from([0.0, 1.0, 12.0]))
        if peer == "initiator":
            choose(call, data, now)
            continue
        talk = call.theirs[peer]
        act = data.draw(
            st.sampled_from([row.performative for row in talk.table.allowed(talk.state, SEND)])
        )
        if act is P.PROPOSE and talk.late(now):
            offered_late.add(peer)
        call.answer(peer, act, now)
    assert not offered_late & set(call.group.awarded)
    for peer in offered_late:
        assert call.group.outcome(peer, now) == "refused"


def choose(call, data, now):
    """Reject late proposals, then accept, reject or start a new round at random."""
    call.tell(call.group.rejections, now)
    some = data.draw(st.sets(st.sampled_from(call.group.offers))) if call.group.offers else set()
    if some and not call.group.awarded and data.draw(st.booleans()):
        call.reply_by = now + 5.0
        call.tell(call.group.call_again(*some), now)
    else:
        call.tell(call.group.award(*some), now)


def test_the_order_of_answers_does_not_matter():
    """Proposals and outcomes are equal for every order."""
    ends = set()
    for order in itertools.permutations(CROWD):
        call = Call("cfp")
        for peer in order:
            call.answer(peer, P.PROPOSE if peer != "b" else P.REFUSE)
        ends.add((call.group.offers, tuple(call.outcomes(5.0))))
    assert ends == {(("a", "c"), ("", "refused", ""))}
