"""The pure core, step by step: slips of peers are answered and counted, our own raise, nothing is
out of turn.
"""

import dataclasses
from itertools import pairwise
from typing import Any

import pytest
from driven import Driven, Seen, agree, recording, refused, request, stop
from msgspec import Raw, Struct
from msgspec.msgpack import encode as pack
from msgspec.structs import replace
from toy_agents import Double, Doubled, Want, asker, server, single, wirings

from agent_runtime.core.agent import Agent, Arc, Behaviour
from agent_runtime.core.errors import AgentTableError, BehaviourError
from agent_runtime.core.events import (
    Arrived,
    Broken,
    Deed,
    Late,
    LinkChanged,
    Local,
    PeerChanged,
    Receipted,
    Received,
    Started,
    Tick,
    Woken,
)
from agent_runtime.core.state import Outgoing
from agent_runtime.core.step import CHAIN_BOUND, OUTSIDE, Core
from agent_runtime.core.streams import OUTBOX_BOUND
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery
from fipa_codec.errors import LocalProtocolError
from fipa_codec.languages import REASON, Kind, Reason
from fipa_codec.performatives import Performative as P

TO_SERVER, TO_ASKER = wirings()


# --- streams --------------------------------------------------------------------------------------


def test_taken_in_order_and_once() -> None:
    """A gap gets no receipt, a copy is receipted again, the rest is taken in its order."""
    one = Driven(recording(said=agree), TO_ASKER)
    assert one.step(request(2, conversation="b")).receipts == ()
    assert [r.taken for r in one.step(request(1)).receipts] == [1]
    assert [r.taken for r in one.step(request(2, conversation="b")).receipts] == [2]
    again = one.step(request(1))
    assert [r.taken for r in again.receipts] == [1]
    assert again.record is None
    assert one.state.memory.seen == ("Received", "Received")
    assert one.state.counts == {"gap": 1, "taken before": 1}


@pytest.mark.parametrize("waits", [Received, Double(1)])
def test_not_taken_waits_unreceipted_and_holds_its_stream_up(waits: Any) -> None:
    """A message that is not taken gets no receipt, and none behind it is taken, though it could be:
    a receipt for the second would say that the first was taken, and it would be lost. The own side
    is taken.
    """
    wanting = {"go": False}

    def takes(memory: Seen, event: Any) -> bool:
        held = isinstance(event, Received) and waits in (Received, event.content)
        return wanting["go"] or not held

    one = Driven(recording(said=agree, takes=takes), TO_ASKER)
    assert one.step(request(1, content=Raw(pack(Double(1))))).receipts == ()
    assert one.step(request(2, conversation="b", content=Raw(pack(Double(2))))).receipts == ()
    assert one.step(request(1, content=Raw(pack(Double(1))))).record is None
    one.step(Local(Want(1)))
    assert one.state.memory.seen == ("Local",)
    wanting["go"] = True
    one.step(Tick())
    assert [r.taken for effects in one.out for r in effects.receipts] == [1, 2]
    assert one.state.memory.seen == ("Local", "Received", "Received")


def test_back_pressure() -> None:
    """With a full outbox what the peer says is taken, with all that it brings about."""
    one = Driven(asker(*range(3)), TO_SERVER)
    one.step(Started())
    (first,) = one.sends()
    one.state.outbox["server"] = tuple(
        Outgoing(number, replace(first, id=str(number))) for number in range(1, OUTBOX_BOUND + 1)
    )
    one.hears("server", "request", P.AGREE, talk=first.conversation)
    one.hears("server", "request", P.INFORM, Doubled(0), talk=first.conversation)
    assert one.state.taken == {"server": 2}
    assert len(one.state.outbox["server"]) == OUTBOX_BOUND + 1  # the next number is asked for


def test_resending_backs_off_and_ends_with_the_receipt() -> None:
    """0.2 s, doubled up to 2 s; at once on the peer's return; never while the router is away or
    after the receipt.
    """
    one = Driven(asker(1), TO_SERVER)
    times = [one.step(Started()).wake_at or 0.0]
    for _ in range(4):
        times.append(one.later(times[-1]).wake_at or 0.0)
        assert [c.id for c in one.sends()] == ["1"]
    assert [round(b - a, 6) for a, b in pairwise(times)] == [0.4, 0.8, 1.6, 2.0]
    one.now += 1.0
    for event, waits_s, said in (
        (PeerChanged("server", 2), 0.0, ["1"]),
        (LinkChanged(False), 10.0, []),
        (LinkChanged(True), 0.0, ["1"]),
        (Receipted("server", taken=1), 100.0, []),
    ):
        one.step(event)
        if waits_s:
            one.later(one.now + waits_s)
        assert [c.id for c in one.sends()] == said, event


def test_late_comes_once_and_ends_nothing() -> None:
    """reply-by gives one Late, at itself it is in time; the conversation stays open and its answer
    is taken.
    """
    one = Driven(asker(1), TO_SERVER)
    one.step(Started())
    name = one.state.memory.asking
    for now, late in ((105.0, 0), (105.01, 1), (200.0, 1)):
        one.later(now)
        assert one.state.memory.late == late
    one.hears("server", "request", P.INFORM, Doubled(2), talk=name)
    assert one.state.memory.answers == ((1, 2),)


# --- slips of peers -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "fields",
    [
        {"content": Raw(pack({"type": "Nothing"}))},
        {"content": Raw(b"\xc1")},
        {"content": Raw(pack(Double(1))), "language": "KLINGON"},
        {"content": Raw(pack(Double(1))), "language": ""},
        {"conversation": "a b"},  # labels with blanks, control characters or no end
        {"reply_with": "a\n"},
        {"conversation": "x" * 129},
    ],
)
def test_unreadable_requests_are_answered(fields: dict[str, Any]) -> None:
    """Content that no language reads, labels that are none: not-understood with the reason; no
    behaviour sees it.
    """
    one = Driven(recording(), TO_ASKER)
    effects = one.step(request(1, **fields))
    (answer,) = one.sends()
    assert answer.performative is P.NOT_UNDERSTOOD
    why = REASON.decode(answer.content).text  # type: ignore[arg-type]
    assert why if "content" in fields else "must match" in why
    if "content" in fields:
        assert (answer.in_reply_to, answer.conversation) == ("1", "asker-1-1")
        assert [r.taken for r in effects.receipts] == [1]
        assert one.state.counts == {"not understood": 1}
    assert one.state.memory.seen == ()
    assert not one.state.conversations


def test_out_of_sequence_breaks_the_conversation() -> None:
    """A second request in a conversation: not-understood, the conversation is over, and the
    behaviour is told.
    """
    one = Driven(recording(said=agree), TO_ASKER)
    one.step(request(1))
    one.step(request(2))
    assert one.sends()[-1].performative is P.NOT_UNDERSTOOD
    assert one.state.memory.seen == ("Received", "Broken")
    deeds = [effects.deed for effects in one.out if effects.deed is not None]
    assert [(deed.event, deed.took) for deed in deeds] == [("Broken", None)], "nothing was taken"
    assert not one.state.conversations


def test_what_cannot_be_read_breaks_a_volatile_conversation_too() -> None:
    """It is answered not-understood, and nothing is left of the conversation."""
    one = Driven(recording(said=agree), wirings(Delivery.VOLATILE)[1])
    one.step(request(1))
    assert one.state.soft.conversations
    one.step(request(2, performative=P.CANCEL, content=Raw(b"\xc1")))
    assert one.sends()[-1].performative is P.NOT_UNDERSTOOD
    assert one.state.memory.seen == ("Received", "Broken")
    assert not one.state.soft.conversations


def test_a_late_cancel_is_answered_by_the_core() -> None:
    """A cancel for a conversation that ended or never was gets its failure; the behaviour does not
    see it.
    """
    one = Driven(recording(said=stop), TO_ASKER)
    one.step(request(1, performative=P.CANCEL, content=None, language="SUM"))
    (answer,) = one.sends()
    assert (answer.performative, answer.in_reply_to) == (P.FAILURE, "1")
    assert one.state.memory.seen == ()


def test_cancel_in_time() -> None:
    """A cancel of an open conversation reaches the behaviour, whose answer ends it."""
    one = Driven(recording(said=stop), TO_ASKER)
    one.step(request(1))
    one.step(request(2, performative=P.CANCEL))
    assert [(c.performative, c.in_reply_to) for c in one.sends()] == [(P.INFORM, "2")]
    assert not one.state.conversations


@pytest.mark.parametrize(
    ("field", "value"),
    [("sender", "stranger"), ("receiver", "somebody"), ("protocol", "query"), ("id", "first"),
     ("id", "-1")],
)  # fmt: skip
def test_strangers_are_dropped(field: str, value: str) -> None:
    """A message for others, of no known link, or without a number on a stream is counted; no
    receipt, no answer.
    """
    one = Driven(recording(), TO_ASKER)
    effects = one.step(Arrived(replace(request(1).communicate, **{field: value})))
    assert (effects.sends, effects.receipts, effects.record) == ((), (), None)
    assert sum(one.state.counts.values()) == 1
    assert effects.logs[0].level == "warning"


def test_a_stray_not_understood_is_never_answered() -> None:
    """Two agents that do not understand each other must not go on about it for ever."""
    one = Driven(recording(), TO_ASKER)
    one.step(request(1, performative=P.NOT_UNDERSTOOD, content=None, language=""))
    assert one.sends() == []


def test_only_the_same_question_is_answered_again() -> None:
    """Volatile: another one in its conversation is a stray, and so is one of the side that only
    answers.
    """
    to_server, to_asker = wirings(Delivery.VOLATILE)
    one = Driven(recording(said=agree), to_asker)
    (agreed,) = one.step(request(1)).sends
    assert one.step(request(1)).sends == (agreed,)
    other = one.step(request(2))
    assert (other.sends, other.handled) == ((), None)
    assert one.state.counts == {"asked again": 1, "stray": 1}
    one = Driven(recording(name="asker"), to_server)
    turned = replace(request(1).communicate, sender="server", receiver="asker")
    assert one.step(Arrived(turned)).handled is None
    assert one.state.counts == {"stray": 1}


# --- the design -----------------------------------------------------------------------------------


class Strict:
    """Rows by which requests are taken and nothing is ever said; notes what it is asked."""

    def __init__(self) -> None:
        self.asked: list[Deed] = []

    def takes(self, state: str, use: str, act: P, kind: Kind) -> bool:
        """Whether a row names it."""
        return act is P.REQUEST

    def own(self, state: str) -> tuple[str, ...]:
        """What its own side may say."""
        return ()

    def ends_wait(self, use: str) -> bool:
        """Whether a row ends a wait."""
        return False

    def why_not(self, deed: Deed) -> str:
        """Return why it is outside the design."""
        self.asked.append(deed)
        return "nothing is to be said" if deed.said else ""


def test_every_step_outside_the_design_is_told_and_those_within_are_looked_up_once() -> None:
    """Not only the first of its kind; what was found right is not asked again."""
    rows = Strict()
    one = Driven(dataclasses.replace(recording(said=agree), rows=rows), TO_ASKER)
    for number in (1, 2):
        effects = one.step(request(number, conversation=f"asker-1-{number}"))
        assert [line.fields["why"] for line in effects.logs if line.event == OUTSIDE] == [
            "nothing is to be said"
        ]
    assert one.state.counts[OUTSIDE] == 2
    asked = len(rows.asked)
    for _ in range(3):
        one.step(Local(Want(1)))
    assert len(rows.asked) == asked + 1


def test_what_no_row_names_waits_however_often_it_is_looked_at() -> None:
    """A cancel that the design does not take in this state is not taken at the second look
    either.
    """
    one = Driven(dataclasses.replace(recording(), rows=Strict()), TO_ASKER)
    one.step(request(1))
    one.step(request(2, performative=P.CANCEL))
    one.step(Local(Want(1)))
    assert one.state.memory.seen == ("Received", "Local")
    assert [waiting.number for waiting in one.state.soft.inbox] == [2]


# --- our own slips --------------------------------------------------------------------------------


def test_what_is_owed_must_be_said() -> None:
    """An illegal act raises; so does speaking in a conversation that is not open, and half an
    answer: who refuses a request that was cancelled meanwhile owes the cancel its failure.
    """

    def refuse(turn: Turn) -> None:
        if isinstance(turn.event, Received) and turn.event.communicate.performative is P.CANCEL:
            turn.say("asker-1-1", P.REFUSE, Reason("no"))

    for said, words, *events in (
        (lambda turn: turn.say("asker-1-1", P.CONFIRM), "confirm", request(1)),
        (
            lambda turn: turn.say("nowhere", P.AGREE),
            r"'nowhere' is not open; open are none",
            Started(),
        ),
        (lambda turn: turn.open("moon", "request", P.REQUEST, Double(1)), "moon", Started()),
        (refuse, "owes its answer", request(1), request(2, performative=P.CANCEL)),
    ):
        one = Driven(recording(said=said), TO_ASKER)
        *before, last = events
        for event in before:
            one.step(event)
        with pytest.raises((BehaviourError, LocalProtocolError), match=words):
            one.step(last)


ENDS = Behaviour[Seen](lambda memory, turn: memory, terminal=lambda memory: True)


def test_a_chain_without_end_raises() -> None:
    """States that all end at once are a loop, found after a bounded number of them."""
    agent = Agent("server", "a", Seen(), {"a": ENDS, "b": ENDS}, (Arc("a", "b"), Arc("b", "a")))
    refused(f"{CHAIN_BOUND} states", agent, TO_ASKER, Started())


def test_an_end_without_an_arc_raises() -> None:
    """A behaviour that ended where no arc may be taken names the arcs there are."""
    never = {"never": lambda memory: False}
    agent = Agent("server", "a", Seen(), {"a": ENDS}, (Arc("a", "a", "never"),), never)
    refused("never -> a", agent, TO_ASKER, Started())


@pytest.mark.parametrize(
    ("start", "arc"),
    [("x", Arc("a", "a")), ("a", Arc("a", "x")), ("a", Arc("x", "a")), ("a", Arc("a", "a", "x"))],
)
def test_a_table_with_a_hole_is_refused(start: str, arc: Arc) -> None:
    """Unknown start, source, target or condition: said when the agent is built."""
    with pytest.raises(AgentTableError, match="'x'"):
        Agent("server", start, Seen(), {"a": ENDS}, (arc,))


# --- records --------------------------------------------------------------------------------------


class Mixed(Struct, frozen=True):
    """A hard and a soft part."""

    hard: int = 0
    soft: Seen = Seen()


def test_soft_memory_costs_no_record_and_dies() -> None:
    """Changes of the soft field write nothing; the journal brings back the hard part and a fresh
    soft one.
    """

    def transition(memory: Mixed, turn: Turn) -> Mixed:
        if isinstance(turn.event, Woken):
            return replace(memory, hard=memory.hard + 1)
        return replace(memory, soft=Seen((*memory.soft.seen, "x")))

    one = Driven(single("server", Mixed(), transition, local=Want), TO_ASKER)
    assert one.step(Local(Want(1))).record is None
    one.state.wakes["w"] = 100.0
    back = one.core.boot(one.step(Tick()).record)
    assert (back.memory, back.incarnation) == (Mixed(1), 2)


def test_a_restored_core_goes_on() -> None:
    """From its record an agent knows its conversations, numbers, outbox and wake-ups, under the
    next incarnation.
    """
    one = Driven(server(), TO_ASKER)
    one.state = one.core.boot(one.step(request(1)).record)
    one.step(Started(first=False))
    assert [c.performative for c in one.sends()] == [P.AGREE], "the outbox goes out again"
    one.later(100.1)
    assert (one.sends()[-1].performative, one.sends()[-1].id) == (P.INFORM, "2")


def test_a_journal_of_another_agent_is_refused() -> None:
    """A record of another agent, or of a state that is no more, is not believed. A memory that
    cannot be journalled is refused when the core is built, not at the first record.
    """
    record = Core(server(), TO_ASKER).record(Core(server(), TO_ASKER).boot(None))
    with pytest.raises(AgentTableError, match="journal"):
        Core(recording(), TO_ASKER).boot(record)

    class Opaque(Struct, frozen=True):
        thing: object = object()

    with pytest.raises(AgentTableError, match="cannot be journalled"):
        Core(single("server", Opaque(), lambda memory, turn: memory), TO_ASKER)


def test_events_of_the_core_are_not_the_drivers() -> None:
    """A driver may not step with what only the core makes."""
    for event in (Late("c"), Broken("c", ""), Woken("w")):
        refused("core's own", recording(), TO_ASKER, event)


def test_a_question_left_unanswered_is_forgotten() -> None:
    """Unanswered questions do not pile up beyond the asker's reply-by."""
    one = Driven(recording(), wirings(Delivery.VOLATILE, "query")[1])
    one.hears("asker", "query", P.QUERY_REF, Double(1), talk="q-1", reply_by=101.0)
    assert list(one.state.soft.conversations) == ["q-1"]
    one.later(102.0)
    assert not one.state.soft.conversations
    assert one.state.counts == {"left unanswered": 1}
