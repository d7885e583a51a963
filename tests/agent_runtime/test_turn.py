"""Acts of a behaviour in its turn: those kept on the disk, those refused, and the time of Late."""

import threading
from collections.abc import Callable
from typing import Any

import msgspec
import pytest
from driven import Driven, agree, ask, quiet, recording, refused, request
from msgspec import Struct
from msgspec.structs import replace
from toy_agents import LANGUAGES, Double, Want, wirings
from toy_observers import Seen, Topic, WhatOf
from toy_observers import wiring as observers

from agent_runtime.core.agent import NOES, Agent, Behaviour, unfilled
from agent_runtime.core.errors import AgentTableError
from agent_runtime.core.events import (
    Deed,
    Garbled,
    Late,
    LinkChanged,
    Local,
    PeerChanged,
    Receipted,
    Started,
)
from agent_runtime.core.step import LATE_AFTER, Core
from agent_runtime.core.streams import OUTBOX_BOUND
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery, Link, Wiring
from agent_runtime.io import tap
from agent_runtime.io.tap import Sample, Waiting
from agent_runtime.testing.alone import Alone
from fipa_codec.conversation import Conversation
from fipa_codec.languages import Kind, Language, Languages, Reason
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import PROTOCOLS
from fipa_codec.tables import Role

TO_SERVER, TO_ASKER = wirings()


def opened(turn: Turn, *, reply_by_s: float | None = 5.0) -> str:
    """A request to the server."""
    return turn.open("server", "request", P.REQUEST, Double(1), reply_by_s=reply_by_s)


def asking(said: Any = ask, **how: Any) -> Driven:
    """The asker, after a word of its own side."""
    one = Driven(quiet(said, name="asker", **how), TO_SERVER)
    one.step(Local(Want(1)))
    return one


def joined(turn: Turn) -> None:
    """A conversation with whoever answers."""
    turn.join(Conversation.open("request", Role.INITIATOR, id="x-1", me="asker", peer=""))


def observing(to: str, subject: str, name: str = "watcher") -> Driven:
    """One that owes an observation at each word of its own side."""
    agent = quiet(lambda turn: turn.observe(to, subject, Seen("x", 1)), name=name)
    return Driven(agent, observers(name))


# --- what is kept ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("said", "durable"),
    [
        (lambda turn: None, False),
        (lambda turn: turn.tell(Want(1)), False),
        (lambda turn: turn.log("x"), False),
        (lambda turn: turn.keep(), True),
        (opened, True),
        (joined, True),
        (lambda turn: turn.leave("x-1"), True),
    ],
)
def test_what_others_count_on_has_a_record(said: Callable[[Turn], Any], durable: bool) -> None:
    """A memory that stays as it is costs none; an observation owed has one though nobody is
    subscribed, and so has, once over all lives, that a durable one is late.
    """
    assert (asking(said).out[0].record is not None) is durable
    assert observing("knower", "jar").step(Local(Want(1))).record is not None
    one = asking()
    assert one.later(106.0).record is not None
    assert one.state.counts["late"] == 1


# --- Late -----------------------------------------------------------------------------------------


def cancels(turn: Turn) -> None:
    """Ask; cancel what is late, with a time of its own."""
    match turn.event:
        case Local():
            opened(turn)
        case Late(conversation=name) if not turn.conversation(name).cancel:
            turn.say(name, P.CANCEL, reply_by_s=5.0)


def test_late_comes_again_for_what_was_said_with_a_new_time() -> None:
    """And the peer is told by when."""
    one = Driven(recording(said=cancels, name="asker"), TO_SERVER)
    one.step(Local(Want(1)))
    one.later(106.0)
    assert [(sent.performative, sent.reply_by) for sent in one.sends()][-1] == (P.CANCEL, 111.0)
    for now, count in ((110.9, 1), (111.1, 2)):
        one.later(now)
        assert one.state.memory.seen.count("Late") == count


def test_what_is_past_and_not_taken_asks_for_no_tick() -> None:
    """Else the driver would turn without end."""
    takes = lambda memory, event: not isinstance(event, Late)  # noqa: E731
    one = Driven(recording(said=cancels, name="asker", takes=takes), TO_SERVER)
    one.step(Local(Want(1)))
    one.step(LinkChanged(False))
    assert one.later(105.0 + LATE_AFTER).wake_at is None


@pytest.mark.parametrize(("peer", "late"), [("", 0), ("server", 1)])
def test_late_comes_for_a_conversation_that_was_joined_with_a_peer(peer: str, late: int) -> None:
    """At its deadline; with whoever answers there is none."""
    talk = Conversation.open("request", Role.INITIATOR, id="x-1", me="asker", peer=peer)
    talk, _ = talk.send(P.REQUEST, id="1", now=100.0, reply_by=103.0)
    said = lambda turn: isinstance(turn.event, Local) and turn.join(talk)  # noqa: E731
    one = Driven(recording(said=said, name="asker"), TO_SERVER)
    one.step(Local(Want(1)))
    one.later(104.0)
    assert one.state.memory.seen.count("Late") == late


# --- what is refused ------------------------------------------------------------------------------


def observe(to: str, subject: str) -> Callable[[Turn], Any]:
    """Owes an observation."""
    return lambda turn: turn.observe(to, subject, Seen("x", 1))


@pytest.mark.parametrize(
    ("name", "said", "words"),
    [
        ("asker", lambda turn: turn.drop(opened(turn)), "dropped durable"),
        # a subject is a word of printable ASCII
        *(
            ("watcher", observe("knower", one), "subject")
            for one in ("", " ", "a jar", "jar\n", "ü")
        ),
        # neither a stranger, nor a peer of another kind of link is owed observations
        ("watcher", observe("asker", "jar"), "latest-value"),
        ("asker", observe("knower", "jar"), "latest-value"),
    ],
)
def test_what_is_none_of_its_acts_is_refused(name: str, said: Any, words: str) -> None:
    """A durable conversation ends by its protocol; only a subscriber is owed observations."""
    wires = TO_SERVER if words == "dropped durable" else observers(name)
    refused(words, quiet(said, name=name), wires, Local(Want(1)))


def test_a_volatile_one_that_is_dropped_is_not_asked_again() -> None:
    """Nothing of it is left."""
    said = lambda turn: turn.drop(turn.open("knower", "query", P.QUERY_REF, WhatOf("jar")))  # noqa: E731
    one = Driven(quiet(said, name="asker"), observers("asker"))
    assert one.step(Local(Want(1))).wake_at is None
    assert one.state.soft.conversations == {}
    one.later(one.now + 10.0)
    assert one.sends() == []


def test_an_agent_is_bound_to_its_own_wiring() -> None:
    """That of another is refused before anything runs."""
    with pytest.raises(AgentTableError, match="is wired as"):
        Core(recording(name="server"), TO_SERVER)


def replace_links(side: Wiring, **fields: str) -> Wiring:
    """The wiring with other links."""
    links = tuple(replace(link, **fields) for link in side.links)
    return Wiring("toy", side.agent, links, LANGUAGES)


def test_the_ontology_of_a_link_is_said() -> None:
    """With each communicate."""
    one = Driven(quiet(opened, name="asker"), replace_links(TO_SERVER, ontology="sums"))
    one.step(Local(Want(1)))
    assert [sent.ontology for sent in one.sends()] == ["sums"]


def test_an_answer_to_nothing_that_was_asked_is_refused() -> None:
    """in_reply_to is said as it was given."""
    said = lambda turn: turn.say("asker-1-1", P.AGREE, in_reply_to="nothing")  # noqa: E731
    refused("nothing", quiet(said), TO_ASKER, request(1))


# --- what a turn shows ----------------------------------------------------------------------------


def test_conversations_are_found_by_peer_and_protocol() -> None:
    """Both where both are named; oldest first."""
    found: dict[tuple[str, str], list[str]] = {}

    def said(turn: Turn) -> None:
        if isinstance(turn.event, PeerChanged):
            turn.open("watcher", "subscribe", P.SUBSCRIBE, Topic())
        for peer in ("", "watcher", "asker", "nobody"):
            for protocol in ("", "subscribe", "query"):
                found[peer, protocol] = [talk.peer for talk in turn.conversations(peer, protocol)]

    one = Driven(recording(said=said, name="knower"), observers("knower"))
    one.step(PeerChanged("watcher", 1))
    one.hears("asker", "query", P.QUERY_REF, WhatOf("jar"), talk="q")
    mine, theirs = ["watcher"], ["asker"]
    assert {place: talks for place, talks in found.items() if talks} == {
        ("", ""): mine + theirs,
        **dict.fromkeys([("", "subscribe"), ("watcher", ""), ("watcher", "subscribe")], mine),
        **dict.fromkeys([("", "query"), ("asker", ""), ("asker", "query")], theirs),
    }


def test_who_is_alive_is_known() -> None:
    """Under which incarnation, till it is gone."""
    seen: list[dict[str, int]] = []
    one = Driven(quiet(lambda turn: seen.append(dict(turn.peers))), TO_ASKER)
    for incarnation in (1, 2, None):
        one.step(PeerChanged("asker", incarnation))
    assert seen == [{"asker": 1}, {"asker": 2}, {}]


def test_a_wake_up_that_is_unwanted_does_not_come() -> None:
    """Nor is the driver asked for its time."""

    def said(turn: Turn) -> None:
        turn.wake("up", turn.now + 1.0)
        turn.unwake("up")
        turn.unwake("never")
        turn.count("said")

    one = Driven(quiet(said), TO_ASKER)
    assert one.step(Local(Want(1))).wake_at is None
    assert one.state.counts == {"said": 1}


def test_a_line_names_the_conversation_it_is_about() -> None:
    """That of the message, none of a word of the own side."""

    def said(turn: Turn) -> None:
        turn.log("x")
        agree(turn)

    one = Driven(quiet(said), TO_ASKER)
    lines = [*one.step(request(1, conversation="c")).logs, *one.step(Local(Want(1))).logs]
    assert [line.fields["conversation"] for line in lines if line.event == "x"] == ["c", ""]


# --- what reaches a behaviour ---------------------------------------------------------------------


def test_what_happened_to_the_agent_reaches_it_whatever_it_takes() -> None:
    """A start and a peer's coming and going do not wait; a person's word does."""
    one = Driven(recording(takes=lambda memory, event: False), TO_ASKER)
    for event in (Started(), Local(Want(1)), PeerChanged("asker", 1), PeerChanged("asker", None)):
        one.step(event)
    assert one.state.memory.seen == ("Started", "PeerChanged", "PeerChanged")


@pytest.mark.parametrize(("forged", "counted"), [(False, "garbled"), (True, "forged")])
def test_bytes_that_are_nothing_are_counted(forged: bool, counted: str) -> None:
    """Apart from those that lie."""
    one = Driven(recording(), TO_ASKER)
    one.step(Garbled("key", "no message", forged))
    assert one.state.counts == {counted: 1}


def test_a_start_says_again_what_was_not_receipted() -> None:
    """At once, not when it would have been due in the life before."""
    one = asking()
    one.state = one.core.boot(one.out[0].record)
    one.now += 0.01
    one.step(Started(first=False))
    assert [sent.id for sent in one.sends()] == ["1"]


def test_a_full_outbox_is_said_once_each_time_it_fills() -> None:
    """However often it is looked at."""
    one = asking(lambda turn: isinstance(turn.event, Local) and opened(turn, reply_by_s=None))
    for _ in range(OUTBOX_BOUND - 1):
        one.step(Local(Want(1)))
    lines = [line.event for _ in range(3) for line in one.step(Local(Want(1))).logs]
    assert lines == ["outbox full"]
    assert one.state.counts["outbox full"] == 1
    assert (one.state.soft.full, len(one.state.soft.inbox)) == ("server", 3)
    one.step(Receipted("server", taken=4))
    assert (one.state.soft.full, one.state.soft.inbox) == ("", ())


def test_a_deed_is_told_in_the_words_of_the_design() -> None:
    """State, event and whom it is about, what was taken, what was said."""
    to_asker, to_server = (replace_links(side, use="deal") for side in (TO_ASKER, TO_SERVER))
    one = Driven(quiet(agree), to_asker)
    taken, agreed = (("deal", act, Kind.PLAIN) for act in (P.REQUEST, P.AGREE))
    for event, deed in (
        (request(1), Deed("s", "Received", taken, (agreed,), "s")),
        (PeerChanged("asker", 1), Deed("s", "PeerChanged asker", None, (), "s")),
        (PeerChanged("asker", None), Deed("s", "PeerChanged", None, (), "s")),
        (request(2, performative=P.INFORM), Deed("s", "Broken deal", None, (), "s")),
    ):
        assert one.step(event).deed == deed
    late = Driven(quiet(ask, name="asker"), to_server)
    late.step(Local(Want(1)))
    assert late.later(106.0).deed == Deed("s", "Late deal", None, (), "s")


# --- Words that wait ------------------------------------------------------------------------------


def sample(size: int, at: float = 0.0) -> Sample:
    """Of `size` bytes."""
    return Sample("k", b"x" * size, at)


def test_what_finds_no_room_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """By number or by bytes, whichever is reached first; what is taken makes room."""
    monkeypatch.setattr(tap, "MOST_WAITING", 3)
    monkeypatch.setattr(tap, "MOST_BYTES", 100)
    one = Waiting()
    for size in (60, 60, 40, 1):
        one.put(sample(size))
    assert one.dropped == 2
    assert [len(each.data) for each in one.left()] == [60, 40]
    for _ in range(5):
        one.put(sample(1))
    assert one.dropped == 4
    taken = one.get(1.0)
    assert taken is not None
    one.put(sample(98))
    assert one.dropped == 4


def test_all_room_is_there_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """After several threads put and one took everything."""
    monkeypatch.setattr(tap, "MOST_BYTES", 3000)
    one = Waiting()
    threads = [
        threading.Thread(target=lambda: [one.put(sample(3)) for _ in range(500)]) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    taken = 0
    while any(thread.is_alive() for thread in threads):
        taken += one.get(0.001) is not None
    taken += len(one.left())
    assert taken + one.dropped == 2000
    one.put(sample(3000))
    assert len(one.left()) == 1


def test_stop_ends_the_wait() -> None:
    """At once, and what waits is there still."""
    one = Waiting()
    one.stop()
    one.put(sample(1))
    assert one.get(60.0) is None
    assert one.stopped
    assert len(one.left()) == 1


def test_what_another_process_wrote_waits_and_its_end_stops() -> None:
    """A last line that is cut off is left out."""
    one, lines = Waiting(), [msgspec.json.encode(sample(size)) for size in (1, 2)]
    one.fill([*lines, lines[0][:9]])
    assert one.stopped
    assert [len(each.data) for each in one.left()] == [1, 2]


# --- A behaviour that is not filled in ------------------------------------------------------------


class Memory(Struct, frozen=True):
    """Nothing."""


class Say(Struct, frozen=True, tag=True):
    """Something."""


SAYING = Languages((Language("L", Say),))
ALONE = [
    protocol for protocol in PROTOCOLS if protocol.name not in ("brokering", "recruiting")
]  # these need a third agent


def stub(protocol: str, says: dict[P, tuple[str, ...]] | None = None) -> Alone:
    """An agent with one behaviour that is not filled in, as the participant of a protocol."""
    agent = Agent(
        "a", "s", Memory(), {"s": Behaviour(lambda memory, turn: unfilled(memory, turn, "work"))}
    )
    delivery = Delivery.LATEST if protocol == "subscribe" else Delivery.DURABLE
    if protocol == "query":
        delivery = Delivery.VOLATILE
    link = Link("b", "C1", protocol, Role.PARTICIPANT, delivery, silent="L", says=says or {})
    return Alone(agent, Wiring("test", "a", (link,), SAYING))


OPENINGS = [(protocol.name, act) for protocol in ALONE for act in sorted(protocol.openings)]


@pytest.mark.parametrize(("protocol", "act"), OPENINGS)
def test_whatever_is_asked_is_declined_and_over(protocol, act):
    """The answer comes in the same step, says which behaviour is missing, and leaves no
    conversation open.
    """
    one = stub(protocol)
    name = one.ask("b", protocol, act, Say())
    (answer,) = [said for said in one.said if said.conversation == name]
    assert answer.performative in (*NOES, P.NOT_UNDERSTOOD)
    assert one.content(answer) == Reason("behaviour work of a is not filled in")
    assert one.talks[name].ended
    assert one.state == "s"


def test_a_protocol_that_may_refuse_is_refused():
    """Request has refuse, so nothing stronger is said."""
    one = stub("request")
    assert one.answers(one.ask("b", "request", P.REQUEST, Say())) == (P.REFUSE,)


@pytest.mark.parametrize(
    ("says", "answer"),
    [
        ({P.FAILURE: (), P.NOT_UNDERSTOOD: ("reason.Reason",)}, P.FAILURE),
        ({P.INFORM: (), P.NOT_UNDERSTOOD: ("reason.Reason",)}, P.NOT_UNDERSTOOD),
    ],
)
def test_a_design_without_refuse_gets_the_next_word(says, answer):
    """Only acts that the design lists are said."""
    one = stub("request", says)
    assert one.answers(one.ask("b", "request", P.REQUEST, Say())) == (answer,)
