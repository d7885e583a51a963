"""The shell carries a step's effects out in the promised order, and logs the step, whatever the
step was.
"""

import time
from collections import deque
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import msgspec
import pytest
import zenoh
from driven import Driven, World, agree, message, recording, request
from toy_agents import Want, wirings
from toy_observers import Seen, Topic, WhatOf, knower, watcher, wiring

from agent_runtime.core.control import Command, Pause
from agent_runtime.core.events import (
    AnyEvent,
    Arrived,
    Deed,
    Local,
    Ordered,
    PeerChanged,
    Receipt,
    Started,
)
from agent_runtime.core.peers import Peers
from agent_runtime.core.step import Core
from agent_runtime.core.wiring import Delivery, Link, Wiring
from agent_runtime.io import shell, steplog
from agent_runtime.io.heartbeat import SHOWN, looked_into
from agent_runtime.io.inbox import Inbox
from agent_runtime.io.options import Options
from agent_runtime.io.zenoh_wire import BULK_BYTES, ZenohWire
from fipa_codec.communicate import Communicate, encode
from fipa_codec.conversation import Conversation
from fipa_codec.languages import Kind, Languages
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import Role


class Order(World):
    """Journal, wire and device of a shell: they write down what they were told, in one list."""

    def __init__(self) -> None:
        self.done: list[str] = []

    def append(self, record: bytes) -> None:
        """The journal's."""
        self.done.append("record")

    def send_receipt(self, receipt: Receipt) -> None:
        """The wire's."""
        self.done.append("receipt")

    def send(self, communicate: Communicate, after: bytes = b"", heard: int = 0) -> int:
        """The wire's."""
        self.done.append(str(communicate.performative))
        return 1

    def tell(self, content: Any) -> None:
        """The device's."""
        self.done.append("tell")


def options(run: Path, wires: Wiring) -> Options:
    """Nobody listens at these endpoints."""
    nowhere = dict.fromkeys((wires.agent, *wires.peers), "tcp/127.0.0.1:1")
    return Options(run_dir=run, system="toy", agents=nowhere)


class Stepped:
    """A shell without a session: events are given to it by hand."""

    def __init__(self, agent: Any, run: Path) -> None:
        self.order = Order()
        self.shell: Any = shell.Shell(agent, wiring(agent.name), options(run, wiring(agent.name)))
        self.shell._journal.close()
        self.shell._journal = self.shell._wire = self.shell._device = self.order
        assert isinstance(self.shell._peers, Peers)

    def happen(self, event: AnyEvent) -> list[str]:
        """Return the shell's acts for one event, in order."""
        self.order.done.clear()
        self.shell._happen(event)
        return list(self.order.done)


def test_a_run_folder_that_an_agent_makes_is_its_owners_alone(tmp_path: Path) -> None:
    """An agent that is started by hand makes it; its journal holds what TLS hides."""
    run = tmp_path / "runs" / "one"
    Stepped(knower(), run).shell._close()
    assert run.stat().st_mode & 0o777 == 0o700


@pytest.fixture
def watching(tmp_path: Path):
    """The watcher, started."""
    one = Stepped(watcher(), tmp_path)
    one.happen(Started(first=True))
    yield one
    one.shell._close()


def said(protocol: str, act: P, content: Any, way: str, talk: str = "") -> Arrived:
    """An opening of a peer."""
    labels = {"conversation": talk or f"{way.partition('>')[0]}-1-1", "reply_with": "1"}
    return Arrived(message(act, way, protocol, content, **labels))


def subscribed(number: int = 1) -> Arrived:
    """The knower's subscription."""
    way, talk = "knower>watcher", f"knower-1-{number}"
    return said("subscribe", P.SUBSCRIBE, Topic(), way, talk)


def test_the_record_comes_before_what_leaves(watching: Stepped) -> None:
    """An observation owed is on the disk before it is sent."""
    watching.happen(subscribed())
    assert watching.happen(Local(Seen("jar", 1))) == ["record", "inform"]


def test_receipts_come_between_record_and_communicates(tmp_path: Path) -> None:
    """An agent that takes an observation writes it, receipts it, and then speaks of anything."""
    one = Stepped(knower(), tmp_path)
    one.happen(PeerChanged("watcher", 1))
    (name,) = one.shell._state.soft.conversations
    agreed, seen = (
        message(act, "watcher>knower", "subscribe", content, conversation=name, id=id, sent=0.0)
        for act, content, id in ((P.AGREE, None, "w-1"), (P.INFORM, Seen("jar", 1), "jar@1.1"))
    )
    one.happen(Arrived(agreed))
    assert one.happen(Arrived(seen)) == ["record", "receipt"]
    assert one.happen(Arrived(seen)) == ["receipt"], "it is in the journal already"
    one.shell._close()


def test_a_question_is_answered_without_a_record(tmp_path: Path) -> None:
    """Nothing durable happened, so nothing is synced."""
    one = Stepped(knower(), tmp_path)
    question = said("query", P.QUERY_REF, WhatOf("jar"), "asker>knower")
    assert one.happen(question) == ["inform-ref"]
    one.shell._close()


def test_every_step_is_in_the_log_and_replays(watching: Stepped, tmp_path: Path) -> None:
    """The log has each event with a hash of what it led to; run again the agent does the same."""
    watching.happen(subscribed())
    for value in range(5):
        watching.happen(Local(Seen("jar", value)))
    file = tmp_path / "steps" / "watcher.steps"
    kinds = [step.kind for step in steplog.read(file)]
    assert kinds == ["boot", "Started", "Arrived", *["Local"] * 5]
    found = steplog.again(Core(watcher(), wiring("watcher")), file)
    assert (found.steps, found.parted) == (7, None)


def written(run: Path) -> int:
    """Steps in the watcher's log."""
    return len(list(steplog.read(run / "steps" / "watcher.steps")))


@pytest.fixture
def serving(watching: Stepped) -> Stepped:
    """The watcher while it serves, its heartbeat far off."""
    watching.shell._serving = True
    watching.shell._beat_at = time.time() + 100.0
    return watching


def test_while_it_serves_logs_wait_for_a_pause_but_not_for_ever(
    serving: Stepped, tmp_path: Path
) -> None:
    """Nobody who asks waits for the disk; of many steps without a pause only the last few are not
    written yet.
    """
    before = written(tmp_path)
    serving.happen(Local(Seen("jar", 0)))
    assert written(tmp_path) == before
    assert serving.shell._next_at() <= time.time() + shell.QUIET_S
    serving.shell._recorder.write()
    assert written(tmp_path) == before + 1
    seen = set()
    for value in range(1, 3 * steplog.MOST_UNWRITTEN):
        serving.happen(Local(Seen("jar", value)))
        seen.add(written(tmp_path))
        assert before + value + 1 - written(tmp_path) < steplog.MOST_UNWRITTEN
    assert len(seen) == 3, "written in batches"


def test_much_that_was_said_is_written_sooner(
    serving: Stepped, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Unwritten words are bounded in bytes, too."""
    monkeypatch.setattr(steplog, "MOST_SAID", 500)
    serving.happen(subscribed())
    serving.shell._wire.send = lambda communicate, after, heard: 400
    before = written(tmp_path)
    for value, steps in ((1, 0), (2, 3), (3, 3)):  # 400 bytes and a few wait, 800 do not
        serving.happen(Local(Seen("jar", value)))
        assert written(tmp_path) == before + steps


def test_much_that_was_heard_is_let_go_at_once(
    serving: Stepped, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its memory is for the next message; the log has it at the next pause."""
    content = subscribed().communicate.content
    assert isinstance(content, msgspec.Raw)
    monkeypatch.setattr(steplog, "MOST_HEARD", len(content) + 1)
    before = written(tmp_path)
    serving.happen(subscribed())
    assert len(serving.shell._recorder._unwritten) == 1
    serving.happen(subscribed(2))
    assert serving.shell._recorder._unwritten == [], "what was heard counts, taken or not"
    assert written(tmp_path) == before
    assert serving.shell._next_at() <= time.time() + shell.QUIET_S
    serving.shell._recorder.write()
    assert written(tmp_path) == before + 2
    for number in range(3, 3 * steplog.MOST_UNWRITTEN):
        serving.happen(subscribed(number))
        assert before + number - written(tmp_path) < steplog.MOST_UNWRITTEN


def test_what_waits_to_be_written_is_written_when_it_stops(tmp_path: Path) -> None:
    """An end in order loses no step and no line."""
    one = Stepped(watcher(), tmp_path)
    one.shell._serving = True
    one.happen(Started(first=True))
    one.happen(Local(Seen("jar", 1)))
    one.shell._close()
    steps = [step.kind for step in steplog.read(tmp_path / "steps" / "watcher.steps")]
    assert steps == ["boot", "Started", "Local"]


def test_what_a_step_says_leaves_before_the_step_is_compared_and_written(watching: Stepped) -> None:
    """A peer that waits for an answer waits only for the work it needs."""
    end = watching.shell._core.end
    watching.shell._core.end = lambda *given: watching.order.done.append("end") or end(*given)
    watching.happen(subscribed())
    assert watching.happen(Local(Seen("jar", 1))) == ["record", "inform", "end"]


@pytest.mark.parametrize(
    ("delivery", "size", "priority"),
    [
        (Delivery.VOLATILE, 10, zenoh.Priority.DATA),
        (Delivery.VOLATILE, BULK_BYTES, zenoh.Priority.DATA_LOW),
        (Delivery.DURABLE, 10, zenoh.Priority.INTERACTIVE_HIGH),
        (Delivery.DURABLE, BULK_BYTES, zenoh.Priority.INTERACTIVE_HIGH),
    ],
)
def test_much_that_may_wait_goes_behind_the_rest(
    monkeypatch: pytest.MonkeyPatch, delivery: Delivery, size: int, priority: object
) -> None:
    """A large answer delays nobody; a stream keeps one priority, so that nothing in it
    overtakes.
    """
    session = MagicMock()
    session.is_closed.return_value = False
    session.declare_keyexpr.side_effect = lambda key: key
    link = Link("b", "C1", "query", Role.INITIATOR, delivery)
    wire = ZenohWire(session, Wiring("toy", "a", (link,), Languages()), 1, Inbox())
    content = msgspec.Raw(msgspec.msgpack.encode("x" * size))
    asked = Conversation.open("query", Role.INITIATOR, id="a-1-1", me="a", peer="b")
    communicate = asked.send(P.QUERY_REF, id="a-1-2", now=1.0, content=content, language="X")[1]
    for _ in range(2):
        assert wire.send(communicate) == len(encode(communicate))
        (key, data), how = session.put.call_args
        assert (key, data) == ("roco/toy/C1/a/b/query/query-ref", encode(communicate))
        assert how["priority"] == priority


# --- Memory of an agent as its heartbeat's file tells it ------------------------------------------


_, TO_ASKER = wirings()


def test_what_waits_is_told_in_its_order() -> None:
    """A communicate by act, sender and protocol; a word of the own side by its class. More than is
    shown is counted.
    """
    one = Driven(recording(said=agree), TO_ASKER)
    for event in (Ordered(Command("1", Pause())), request(1), Local(Want(1))):
        one.step(event)
    found = looked_into(one.state, deque())
    told = [(each.what, each.peer, each.protocol) for each in found.inbox]
    assert told == [("request", "asker", "request"), ("Local", "", "")]
    assert (found.waiting, found.open) == (2, 0)
    for number in range(SHOWN):
        one.step(Local(Want(number)))
    found = looked_into(one.state, deque())
    assert (found.waiting, len(found.inbox)) == (SHOWN + 2, SHOWN)


def test_open_conversations_are_told_until_they_end() -> None:
    """With the state they are in, as this side sees it."""
    one = Driven(recording(said=agree), TO_ASKER)
    one.step(request(1, conversation="b"))
    (talk,) = looked_into(one.state, deque()).talks
    assert (talk.id, talk.peer, talk.protocol) == ("b", "asker", "request")
    assert (talk.role, talk.state) == ("participant", "agreed")


def test_a_step_is_told_in_the_words_of_the_design() -> None:
    """The step tells the word taken, the word said with its guard, and the state it led to."""
    taken, said = ("order", P.REQUEST, Kind.PLAIN), ("order", P.INFORM, Kind.CANCEL)
    deeds = [Deed("idle", "Received", taken, (said,), "busy")]
    deeds += [Deed("busy", "Woken", None, (), "idle")]
    one = Driven(recording(), TO_ASKER)
    first, second = looked_into(one.state, deque(enumerate(deeds))).steps
    assert (first.event, first.said) == ("order request", ("order inform[cancel]",))
    assert (second.before, second.event, second.after) == ("busy", "Woken", "idle")
