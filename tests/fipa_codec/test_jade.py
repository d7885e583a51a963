"""Our participants talk with JADE's initiators, text by text, and each conversation ends well; a
judge hears it too.
"""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jade import AchieveREInitiator, ContractNetInitiator, Initiator, SubscriptionInitiator

from fipa_codec.acl_string import Aid, At, from_acl, parse, render, reply_names, to_acl
from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import Profile, named
from fipa_codec.tables import SEND, Role, Row
from topdown.judge.follow import Followed

NOW = 1_763_900_000.0
OURS = {
    name: Aid(name=f"{name}@here", addresses=(f"http://here:8000/{name}",))
    for name in ("ann", "bob", "eve")
}


class Ours:
    """One of our agents: a participant's conversation, ACL text at both ends, and a judge of what
    is said.
    """

    def __init__(self, name: str, profile: Profile = Profile.FIPA) -> None:
        self.name, self.profile, self.names, self.count = name, profile, OURS, 0
        self.talk: Conversation | None = None
        self.judge: Followed | None = None

    @property
    def state(self) -> str:
        """Its state, "" before the first message."""
        return self.talk.state if self.talk else ""

    @property
    def ended(self) -> bool:
        """Whether it has nothing more to say."""
        return self.talk is not None and self.talk.ended

    def hears(self, text: str) -> None:
        """Take a text of the other platform."""
        message = parse(text)
        said = from_acl(message, NOW, names=OURS, profile=self.profile)
        if self.talk is None:
            self.talk = Conversation.answering(said, self.name)
            self.judge = Followed(named(said.protocol), durable=True)
            self.names = reply_names(message, OURS)
        self.talk = self.talk.receive(said)
        self.judged(Role.INITIATOR, said)

    def may_say(self) -> list[Row]:
        """Rows that its table allows now."""
        assert self.talk is not None
        return list(self.talk.table.allowed(self.talk.state, SEND))

    def says(self, act: P, kind: Kind = Kind.PLAIN) -> bytes:
        """The text of a message of its own."""
        assert self.talk is not None
        self.count += 1
        content = msgspec.Raw(msgspec.msgpack.encode(f"(({act} {kind or 'plain'}))"))
        words = {"content": content, "language": "fipa-sl0", "kind": kind}
        self.talk, said = self.talk.send(act, id=f"{self.name}-{self.count}", now=NOW, **words)
        self.judged(Role.PARTICIPANT, said, kind)
        text = render(to_acl(said, names=self.names, profile=self.profile))
        assert from_acl(parse(text), NOW, names=self.names, profile=self.profile) == said
        return text

    def judged(self, role: Role, said: Communicate, kind: Kind = Kind.PLAIN) -> None:
        """Check that a listener finds it in sequence."""
        assert self.judge is not None
        assert not self.judge.mislabelled(role, said.performative, said.reply_with)
        # a listener knows no more than the content
        words = kind if kind is not Kind.CANCEL else Kind.PLAIN
        read = self.judge.read(role, said.performative, said.reply_with, said.in_reply_to, (words,))
        assert not isinstance(read, str), read
        assert self.judge.take(role, read), self.judge.states


def meet(jade: Initiator, *ours: Ours, opening: list[tuple[str, str]] | None = None) -> None:
    """Deliver what JADE says to each."""
    agents = {OURS[one.name].name: one for one in ours}
    for name, text in jade.opens() if opening is None else opening:
        agents[name].hears(text)


def aids(*names: str) -> tuple[Aid, ...]:
    """Identifiers of ours."""
    return tuple(OURS[name] for name in names)


# --- request and query ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("protocol", "opening"), [("fipa-request", P.REQUEST), ("fipa-query", P.QUERY_REF)]
)
@pytest.mark.parametrize("reply_by", [None, At(1_763_900_002_000)])
@given(data=st.data())
def test_a_request_ends_alike_on_both_sides(
    protocol: str, opening: P, reply_by: At | None, data: st.DataObject
) -> None:
    """JADE takes the first inform as the result: of ours there is only one."""
    ann, jade = Ours("ann"), AchieveREInitiator(protocol, opening, aids("ann"), reply_by)
    meet(jade, ann)
    said = []
    while not ann.ended:
        choices = [(row.performative, row.kind) for row in ann.may_say()]
        if not said:
            choices.append((P.NOT_UNDERSTOOD, Kind.PLAIN))
        act, kind = data.draw(st.sampled_from(choices))
        jade.hears(ann.says(act, kind))
        said.append(act)
    assert (jade.lost, jade.heard["ann@here"], jade.sessions) == ([], said, {})


def test_progress_would_be_taken_for_the_result() -> None:
    """The book's request has none for this reason: the paper's is not for a peer of another
    platform.
    """
    ann = Ours("ann", Profile.PAPER)
    jade = AchieveREInitiator("fipa-request", P.REQUEST, aids("ann"))
    meet(jade, ann)
    for act, kind in ((P.AGREE, Kind.PLAIN), (P.INFORM, Kind.PROGRESS), (P.INFORM, Kind.PLAIN)):
        jade.hears(ann.says(act, kind))
    assert (jade.heard["ann@here"], jade.lost) == ([P.AGREE, P.INFORM], [P.INFORM])


# --- contract net ---------------------------------------------------------------------------------


@given(
    answers=st.lists(
        st.sampled_from([P.PROPOSE, P.REFUSE, P.NOT_UNDERSTOOD, None]), min_size=3, max_size=3
    ),
    chosen=st.frozensets(st.sampled_from([aid.name for aid in OURS.values()])),
    results=st.lists(st.sampled_from([P.INFORM, P.FAILURE]), min_size=3, max_size=3),
    later_ms=st.sampled_from([0, 0, 1, 250]),
)
def test_a_contract_is_awarded_and_its_result_is_taken(
    answers: list[P | None], chosen: frozenset[str], results: list[P], later_ms: int
) -> None:
    """Also where an accept has the label of somebody's cfp, since the clock did not move. None:
    silent.
    """
    bidders = [Ours(name) for name in OURS]
    jade = ContractNetInitiator(tuple(OURS.values()), chosen, At(1_763_900_002_000))
    meet(jade, *bidders)
    for bidder, answer in zip(bidders, answers, strict=True):
        if answer is not None:
            jade.hears(bidder.says(answer))
    jade.clock_ms += later_ms
    meet(jade, *bidders, opening=jade.decides())
    ends = {P.REFUSE: "refused", P.NOT_UNDERSTOOD: "not-understood", None: "called"}
    for bidder, answer, result in zip(bidders, answers, results, strict=True):
        aid = OURS[bidder.name].name
        if bidder.state == "awarded":
            assert aid in chosen
            jade.hears(bidder.says(result))
            assert jade.heard[aid] == [P.PROPOSE, result]
            assert bidder.state == ("done" if result is P.INFORM else "failed")
        else:
            assert bidder.state == ends.get(answer, "rejected")
    assert (jade.lost, jade.sessions) == ([], {})


def test_a_bidder_that_names_the_call_is_lost() -> None:
    """The result of a contract answers the accept; JADE logs one with the label of the cfp as
    OUT-OF-SEQUENCE.
    """
    ann, jade = Ours("ann"), ContractNetInitiator(aids("ann"), frozenset(["ann@here"]))
    meet(jade, ann)
    jade.hears(ann.says(P.PROPOSE))
    jade.clock_ms += 1
    meet(jade, ann, opening=jade.decides())
    assert ann.talk is not None
    result = ann.talk.send(P.INFORM, id="9", now=NOW, in_reply_to=ann.talk.asked)[1]
    jade.hears(render(to_acl(result, names=ann.names)))
    assert jade.lost == [P.INFORM]


# --- subscription ---------------------------------------------------------------------------------


class Subscribed:
    """One of ours and JADE's SubscriptionInitiator; what ann says may still be on its way when JADE
    cancels.
    """

    def __init__(self) -> None:
        self.ann = Ours("ann")
        self.jade = SubscriptionInitiator("fipa-subscribe", P.SUBSCRIBE, aids("ann"))
        self.wire: list[bytes] = []
        meet(self.jade, self.ann)

    def says(self, act: P, kind: Kind = Kind.PLAIN) -> None:
        """Ann says it; it is on its way."""
        self.wire.append(self.ann.says(act, kind))

    def arrives(self) -> None:
        """All that is on its way."""
        while self.wire:
            self.jade.hears(self.wire.pop(0))

    def cancels(self, *, ignores: bool) -> None:
        """JADE cancels, whatever is on its way."""
        self.ann.hears(self.jade.cancels(OURS["ann"], ignores=ignores))


@given(
    first=st.sampled_from([P.AGREE, P.INFORM]),
    told=st.integers(0, 3),
    tries=st.integers(0, 2),
    crossing=st.booleans(),
)
def test_a_subscription_is_cancelled(first: P, told: int, tries: int, crossing: bool) -> None:
    """At the second or third try, too: each cancel has the label of the subscription."""
    both = Subscribed()
    both.says(first)
    for attempt in range(tries + 1):
        for _ in range(told):
            both.says(P.INFORM)
        if not crossing:
            both.arrives()
        both.cancels(ignores=False)
        both.says(P.INFORM)  # still one, while it stops
        both.says(P.FAILURE if attempt < tries else P.INFORM, Kind.CANCEL)
        both.arrives()
    both.jade.cancellation_completed()
    assert both.ann.state == "cancelled"
    assert (both.jade.lost, both.jade.sessions) == ([], {})
    notified = (told + 2) * (tries + 1) + (first is P.INFORM)
    assert len(both.jade.heard["ann@here"]) == notified + (first is P.AGREE)


@given(told=st.integers(0, 3))
def test_a_subscription_is_cancelled_and_nobody_asks_for_an_answer(told: int) -> None:
    """The cancel has no reply-with, the answer no in-reply-to, and JADE drops what still comes."""
    both = Subscribed()
    both.says(P.AGREE)
    both.arrives()
    for _ in range(told):
        both.says(P.INFORM)
    both.cancels(ignores=True)
    both.says(P.INFORM, Kind.CANCEL)
    assert parse(both.wire[-1]).in_reply_to is None
    both.arrives()
    assert both.ann.state == "cancelled"
    assert (both.jade.lost, both.jade.sessions) == ([P.INFORM] * (told + 1), {})


@pytest.mark.parametrize("act", [P.REFUSE, P.NOT_UNDERSTOOD])
def test_a_subscription_that_is_not_agreed_is_over(act: P) -> None:
    """On both sides."""
    both = Subscribed()
    both.says(act)
    both.arrives()
    assert both.ann.ended
    assert (both.jade.lost, both.jade.sessions) == ([], {})


def test_a_failure_ends_ours_and_a_cancel_that_comes_then_is_answered() -> None:
    """To JADE a failure is one more notification: its program cancels, and is told that there is
    nothing any more.
    """
    both = Subscribed()
    both.says(P.AGREE)
    both.says(P.FAILURE)
    both.arrives()
    assert both.ann.state == "failed"
    both.cancels(ignores=False)
    assert both.ann.state == "too-late"
    both.says(P.FAILURE, Kind.CANCEL)
    both.arrives()
    assert (both.ann.state, both.jade.lost) == ("settled", [])
