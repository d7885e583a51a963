"""Brokering and recruiting with an initiator, a broker and targets: the embedded conversations and
their answers.
"""

import pytest
from msgspec.structs import replace

from fipa_codec import proxying
from fipa_codec.acts import (
    EXPRESSIONS,
    Action,
    Descriptor,
    Proposition,
    Quantifier,
    Variable,
    content_of,
    denotes,
)
from fipa_codec.conversation import Conversation
from fipa_codec.errors import ContentError, LocalProtocolError, RemoteProtocolError
from fipa_codec.languages import Kind, Languages
from fipa_codec.multicast import Multicast
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import Role

LANGUAGES = Languages([EXPRESSIONS])
TRUE = Proposition("true")
WEIGHERS = Descriptor(Quantifier.ALL, "x", Proposition("weighs-things", (Variable("x"),)))
WEIGHT = Descriptor(Quantifier.IOTA, "w", Proposition("weight", ("jar", Variable("w"))))
INTERNAL = (Action("t1", "inform-ref"), Proposition("internal-error"))


class Party:
    """An agent with its conversations by id and peer."""

    def __init__(self, name):
        self.name, self.talks, self.count = name, {}, 0

    def label(self):
        """Return a new id."""
        self.count += 1
        return f"{self.name}-1-{self.count}"

    def keep(self, talk):
        """Store a conversation and return it."""
        self.talks[talk.id, talk.peer] = talk
        return talk

    def opens(self, protocol, peer, act, content):
        """Open a conversation; return its first message."""
        talk = Conversation.open(protocol, Role.INITIATOR, id=self.label(), me=self.name, peer=peer)
        return self.says(talk, act, content)

    def says(self, talk, act, content=None, kind=None):
        """Send a message in a conversation; return it."""
        kind = kind or (EXPRESSIONS.kind(content) if content else Kind.PLAIN)
        raw = EXPRESSIONS.encode(content) if content else None
        talk, message = talk.send(
            act, id=self.label(), now=1.0, content=raw, language=EXPRESSIONS.name, kind=kind
        )
        self.keep(talk)
        return message

    def hears(self, message):
        """Receive a message; return the conversation after it, and the content."""
        content, kind = LANGUAGES.read(message)
        talk = self.talks.get((message.conversation, message.sender)) or Conversation.answering(
            message, self.name
        )
        return self.keep(talk.receive(message, kind)), content


@pytest.fixture
def parties():
    """Initiator, broker, two targets and a designated receiver."""
    return {name: Party(name) for name in ("i", "b", "t1", "t2", "d")}


def question(receiver, *, protocol="query", act=P.QUERY_REF, content=None):
    """Return the embedded message: the weight of the jar is asked for."""
    raw = EXPRESSIONS.encode(content or content_of(act, WEIGHT))
    return proxying.embedded_message(
        protocol,
        act,
        receiver=receiver,
        conversation=f"{receiver}-1-77",
        id=f"{receiver}-1-78",
        now=1.0,
        content=raw,
        language=EXPRESSIONS.name,
        reply_by=30.0,
    )


def searching(parties, protocol, message):
    """Send the proxy and the agree; return what the broker has received."""
    i, b = parties["i"], parties["b"]
    opening = i.opens(
        protocol, "b", P.PROXY, proxying.proxy_content(P.PROXY, WEIGHERS, message, TRUE)
    )
    talk, content = b.hears(opening)
    i.hears(b.says(talk, P.AGREE, content_of(P.AGREE, Action("b", "proxy"), TRUE)))
    found = proxying.proxy_request(content)
    assert (found.targets, found.condition) == (WEIGHERS, TRUE)
    assert replace(found.message, content=message.content) == message
    return found


def brokered(parties, *targets):
    """Let the broker ask the targets, with its own id, and inform the initiator that the message
    was forwarded.
    """
    i, b = parties["i"], parties["b"]
    message = searching(parties, "brokering", question("i")).message
    conversation = b.label()
    talks = []
    for name in targets:
        talk, asked = proxying.ask_target(
            message, broker="b", target=name, conversation=conversation, id=b.label(), now=2.0
        )
        talks.append(b.keep(talk))
        parties[name].hears(asked)
        assert (asked.sender, asked.conversation, asked.content) == (
            "b",
            conversation,
            message.content,
        )
    outer = b.talks[next(key for key in b.talks if key[1] == "i")]
    i.hears(b.says(outer, P.INFORM, content_of(P.INFORM, Proposition("proxied", ("t1", "t2")))))
    return Multicast.opened(talks)


def outer_talk(party, peer):
    """Return the brokering or recruiting conversation with a peer."""
    return next(talk for (_, other), talk in party.talks.items() if other == peer)


def test_brokering_relays_every_answer_and_the_last_one_ends_it(parties):
    """The targets know the broker only; the initiator gets their answers unchanged, and the last
    one is marked.
    """
    i, b = parties["i"], parties["b"]
    group = brokered(parties, "t1", "t2")
    answers = {
        "t1": (P.INFORM, content_of(P.INFORM, denotes(WEIGHT, 0.4))),
        "t2": (P.FAILURE, content_of(P.FAILURE, *INTERNAL)),
    }
    heard = []
    for name, (act, content) in answers.items():
        inner = outer_talk(parties[name], "b")
        said = parties[name].says(inner, act, content)
        assert said.receiver == "b"
        talk, _ = b.hears(said)
        group = group.noted(talk, 3.0)
        relay = b.says(
            outer_talk(b, "i"), P.INFORM, proxying.relay_content(said, last=group.over(3.0))
        )
        outer, content = i.hears(relay)
        heard.append((outer.state, proxying.relayed_answer(content)))
    assert [state for state, _ in heard] == ["relaying", "done"]
    assert [(answer.sender, answer.performative) for _, answer in heard] == [
        ("t1", P.INFORM),
        ("t2", P.FAILURE),
    ]
    assert LANGUAGES.read(heard[0][1])[0].expressions == (denotes(WEIGHT, 0.4),)
    assert all(talk.ended for party in parties.values() for talk in party.talks.values())


def test_silent_target_does_not_keep_the_initiator_waiting(parties):
    """The reply-by of M applies to each answer of a target; then the broker sends failure."""
    group = brokered(parties, "t1", "t2")
    assert group.awaited(30.0) == ("t1", "t2")
    assert group.silent(30.1) == ("t1", "t2")
    failed = content_of(P.FAILURE, Action("b", "proxy"), Proposition("no-answer"))
    talk, _ = parties["i"].hears(
        parties["b"].says(outer_talk(parties["b"], "i"), P.FAILURE, failed)
    )
    assert talk.state == "failed"


def test_cancel_of_a_brokering_cancels_the_embedded_conversation_first(parties):
    """The broker cancels the acts of its targets, and answers the initiator when they have
    answered.
    """
    i, b, t1 = parties["i"], parties["b"], parties["t1"]
    act = content_of(P.REQUEST, Action("t1", "weigh", ("jar",)))
    message = question("i", protocol="request", act=P.REQUEST, content=act)
    searching(parties, "brokering", message)
    talk, asked = proxying.ask_target(
        message, broker="b", target="t1", conversation="b-1-9", id="b-1-10", now=2.0
    )
    b.keep(talk)
    t1.hears(asked)
    i.hears(
        b.says(outer_talk(b, "i"), P.INFORM, content_of(P.INFORM, Proposition("proxied", ("t1",))))
    )
    outer, _ = b.hears(i.says(outer_talk(i, "b"), P.CANCEL))
    assert outer.state == "stopping-relaying"
    t1.hears(b.says(b.talks["b-1-9", "t1"], P.CANCEL))
    stopped = content_of(P.INFORM, Proposition("cancelled"))
    inner, _ = b.hears(t1.says(t1.talks["b-1-9", "b"], P.INFORM, stopped, Kind.CANCEL))
    outer, _ = i.hears(b.says(outer, P.INFORM, stopped, Kind.CANCEL))
    assert (inner.state, outer.state) == ("cancelled", "cancelled")


@pytest.mark.parametrize("receiver", ["i", "d"])
@pytest.mark.parametrize("early", [False, True])
def test_recruited_target_answers_the_receiver_directly(parties, receiver, early):
    """The target answers the sender of M, before or after the recruiter informs the initiator."""
    i, b, t1 = parties["i"], parties["b"], parties["t1"]
    message = searching(parties, "recruiting", question(receiver)).message
    passed = proxying.proxy_content(P.PROPAGATE, WEIGHERS, proxying.addressed(message, "t1"), TRUE)
    handed, content = t1.hears(b.opens("propagate", "t1", P.PROPAGATE, passed))
    assert handed.ended
    inner = t1.keep(proxying.target_conversation(proxying.proxy_request(content).message, "t1"))
    assert (inner.peer, inner.id, inner.deadline) == (receiver, message.conversation, 30.0)
    told = b.says(
        outer_talk(b, "i"), P.INFORM, content_of(P.INFORM, Proposition("proxied", ("t1",)))
    )
    if not early:
        assert i.hears(told)[0].state == "done"
    answer = t1.says(inner, P.INFORM, content_of(P.INFORM, denotes(WEIGHT, 0.4)))
    asker = parties[receiver]
    asker.keep(proxying.receiver_conversation(message, answer.sender))
    assert asker.hears(answer)[0].state == "done"
    if early:
        assert i.hears(told)[0].state == "done"
    assert all(talk.ended for party in parties.values() for talk in party.talks.values())
    assert not any(
        talk.peer == "b" and talk.id == message.conversation for talk in t1.talks.values()
    )


def test_recruiting_several_gives_the_receiver_a_multicast(parties):
    """One message, several targets: one id, and one conversation with each."""
    message = searching(parties, "recruiting", question("i")).message
    group = Multicast.opened(
        [proxying.receiver_conversation(message, name) for name in ("t1", "t2")]
    )
    for name in ("t1", "t2"):
        inner = parties[name].keep(
            proxying.target_conversation(proxying.addressed(message, name), name)
        )
        said = parties[name].says(inner, P.INFORM, content_of(P.INFORM, denotes(WEIGHT, 0.4)))
        group = group.noted(group.talk(name).receive(said), 5.0)
    assert group.over(0.0)
    assert [group.outcome(name, 40.0) for name in ("t1", "t2")] == ["done", "done"]


def test_no_target_found(parties):
    """The broker sends failure; no embedded conversation is opened."""
    for protocol in ("brokering", "recruiting"):
        searching(parties, protocol, question("i"))
        talk = next(t for t in parties["b"].talks.values() if t.protocol == protocol)
        failed = content_of(P.FAILURE, Action("b", "proxy"), Proposition("no-match"))
        assert parties["i"].hears(parties["b"].says(talk, P.FAILURE, failed))[0].state == "failed"


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
    message = replace(question("i"), **change)
    with pytest.raises(LocalProtocolError, match=word):
        proxying.proxy_content(P.PROXY, WEIGHERS, message, TRUE)
    with pytest.raises(ContentError, match=word):
        proxying.proxy_request(content_of(P.PROXY, WEIGHERS, proxying.Embedded(message), TRUE))


def test_contents_of_other_acts():
    """Typed errors, and None for an inform without a relayed answer."""
    with pytest.raises(ContentError, match="not the descriptor, message and proposition"):
        proxying.proxy_request(content_of(P.INFORM, TRUE))
    assert proxying.relayed_answer(content_of(P.INFORM, TRUE)) is None
    with pytest.raises(RemoteProtocolError, match="is 't1', not 't2'"):
        proxying.target_conversation(proxying.addressed(question("i"), "t1"), "t2")
