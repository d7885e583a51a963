"""Admission of an arriving communicate: each stream for itself, the newest of a subject, one copy
of a question.
"""

from typing import Any

import pytest
from driven import Driven, message, recording, request
from toy_agents import Double, Want, wired, wirings
from toy_observers import Seen, WhatOf
from toy_observers import wiring as observers

from agent_runtime.core import reception
from agent_runtime.core.events import Arrived, Local, PeerChanged, Receipt, Tick
from agent_runtime.core.reception import HELD_OF_STREAM, HELD_VOLATILE
from agent_runtime.core.streams import digest_of
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery
from fipa_codec.performatives import Performative as P

TO_ASKER = wirings()[1]


def only_local(memory: Any, event: Any) -> bool:
    """Takes a person's words alone."""
    return isinstance(event, Local)


def query(id: str, **fields: Any) -> Arrived:
    """A question of toy_observers' asker to the knower."""
    fields = {"conversation": f"q-{id}", "reply_with": id, "id": id} | fields
    content = fields.pop("content", WhatOf("jar"))
    return Arrived(message(P.QUERY_REF, "asker>knower", "query", content, **fields))


def busy() -> Driven:
    """A knower that takes nothing, and has a word of its own side waiting."""
    one = Driven(recording(takes=lambda memory, event: False, name="knower"), observers("knower"))
    one.step(Local(Want(1)))
    return one


def waiting(one: Driven) -> list[str]:
    """Ids of the communicates in the inbox."""
    events = [entry.event for entry in one.state.soft.inbox]
    return [event.communicate.id for event in events if isinstance(event, Arrived)]


def test_a_copy_of_what_waits_is_told_how_far_the_stream_is() -> None:
    """Nothing is taken yet, so the receipt says 0; the copy is counted and does not wait twice."""
    one = Driven(recording(takes=only_local), TO_ASKER)
    one.step(request(1))
    assert one.step(request(1)).receipts == (Receipt("asker", taken=0),)
    assert waiting(one) == ["1"]
    assert one.state.counts == {"waiting already": 1}


def test_a_copy_of_the_newest_that_was_taken_is_one_taken_before() -> None:
    """Its receipt was lost: it is receipted again."""
    one = Driven(recording(said=lambda turn: turn.say("asker-1-1", P.AGREE)), TO_ASKER)
    first = one.step(request(1)).receipts
    assert first == (Receipt("asker", taken=1, digest=digest_of(request(1).communicate)),)
    assert one.step(request(1)).receipts == first
    assert one.state.counts == {"taken before": 1}


def test_of_one_stream_only_so_many_wait() -> None:
    """As many as its sender may have out; the next one comes again."""
    one = Driven(recording(takes=only_local), TO_ASKER)
    for number in range(1, HELD_OF_STREAM + 2):
        one.step(request(number, conversation=f"asker-1-{number}"))
    assert waiting(one) == [str(number) for number in range(1, HELD_OF_STREAM + 1)]
    assert one.state.counts == {"gap": 1}


def test_streams_do_not_hold_each_other_up() -> None:
    """Waiting communicates of one peer do not affect another's numbers."""
    uses = [(peer, "server", "T1", "request", Delivery.DURABLE) for peer in ("asker", "other")]
    one = Driven(recording(takes=only_local), wired("server", uses))
    one.step(request(1))
    one.step(request(1, conversation="other-1-1", sender="other"))
    assert waiting(one) == ["1", "1"]
    assert one.state.counts == {}


def observation(subject: str, version: str, name: str, reply_with: str = "") -> Arrived:
    """Return the watcher's observation of a subject."""
    labels = {"conversation": name, "in_reply_to": reply_with, "id": f"{subject}@{version}"}
    seen = Seen(subject, 1)
    return Arrived(message(P.INFORM, "watcher>knower", "subscribe", seen, **labels))


def subscriber(takes: Any = None) -> tuple[Driven, str, str]:
    """A knower that has subscribed and is agreed to, and takes no observation but where `takes`
    says so.
    """

    def said(turn: Turn) -> None:
        if isinstance(turn.event, PeerChanged):
            turn.open("watcher", "subscribe", P.SUBSCRIBE, WhatOf("jar"))

    one = Driven(recording(said=said, takes=takes, name="knower"), observers("knower"))
    one.step(PeerChanged("watcher", 1))
    (opening,) = one.sends()
    labels = {"talk": opening.conversation, "in_reply_to": opening.reply_with}
    # an at sign alone makes no observation
    one.hears("watcher", "subscribe", P.AGREE, id="watcher@1.1", **labels)
    return one, opening.conversation, opening.reply_with


def test_of_a_subject_only_the_newest_waits() -> None:
    """An older one that waits makes room, one that comes later is nothing; other subjects stay."""
    one, *name = subscriber(takes=lambda memory, event: getattr(event, "content", None) is None)
    for told in ("jar 1.1", "bowl 1.2", "jar 1.3", "jar 1.1", "jar 1.3"):
        one.step(observation(*told.split(), *name))
    assert waiting(one) == ["bowl@1.2", "jar@1.3"]


def test_an_observation_is_taken_once_and_receipted_as_often_as_it_comes() -> None:
    """The same or an older version changes nothing."""
    one, *name = subscriber()
    for counter in (3, 3, 2):
        told = one.step(observation("jar", f"1.{counter}", *name)).receipts
        assert told == (Receipt("watcher", subject="jar", version=(1, counter)),)
        assert one.state.memory.seen == ("PeerChanged", "Received", "Received")
    assert one.state.counts == {"observed before": 2}


def test_an_observation_of_a_subscription_that_is_not_held_is_counted() -> None:
    """And gets no receipt: it is owed to the newer subscription."""
    one, *_ = subscriber()
    assert one.step(observation("jar", "1.1", "knower-0-9")).receipts == ()
    assert one.state.counts == {"observation of no subscription": 1}


def test_a_question_waits_once_however_often_it_is_asked() -> None:
    """A copy has sender, id and conversation of it; another id is another question."""
    one = busy()
    for question in (query("a"), query("a"), query("b"), query("b", conversation="q-c")):
        one.step(question)
    assert waiting(one) == ["a", "b", "b"]
    assert one.state.counts == {"waiting already": 1}


def test_so_many_questions_wait_and_the_next_is_dropped_aloud() -> None:
    """Words of the own side and streams have their own room."""
    one = busy()
    for number in range(HELD_VOLATILE):
        one.step(query(str(number)))
    effects = one.step(query("one-more"))
    assert len(waiting(one)) == HELD_VOLATILE
    assert one.state.counts == {"inbox full": 1}
    assert [line.event for line in effects.logs] == ["inbox full"]


def test_long_questions_take_bounded_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """However few they are: their bytes are counted, too."""
    one = busy()
    monkeypatch.setattr(reception, "HELD_BYTES", 2 * len(query("0").communicate.content))
    for number in range(4):
        one.step(query(str(number)))
    assert waiting(one) == ["0", "1"]
    assert one.state.counts == {"inbox full": 2}


def test_streams_that_wait_are_no_questions() -> None:
    """A copy of a question is found among messages of a stream, and they are not copies of it."""
    uses = [("asker", "server", "T1", "request", Delivery.DURABLE)]
    uses += [("asker", "server", "T3", "query", Delivery.VOLATILE)]
    one = Driven(recording(takes=only_local), wired("server", uses))
    question = query("1", receiver="server", conversation="asker-1-1", content=Double(1))
    for event in (request(1), question, question, Tick()):
        one.step(event)
    assert [entry.number for entry in one.state.soft.inbox] == [1, 0]
