"""Parents of conversations, and the evidence for them."""

import re
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from agent_runtime.core.events import Arrived
from agent_runtime.io.steplog import NOTHING, StepLog
from agent_runtime.io.steplog import Step as LoggedStep
from companion.tools.system import SYSTEM
from fipa_codec.communicate import Communicate
from fipa_codec.performatives import Performative
from operate.recording.run import opened
from operate.recording.traced import _steps
from operate.tracing.otlp import CLIENT, ERROR, SERVER, exported
from operate.tracing.trace import Known, Message, Span, Step, Talk, Trace, spans


def say(
    sender: str, receiver: str, id: str, sent: float, talk: str = "c", protocol: str = "request"
) -> Message:
    """A message that says no more than who, when and in which conversation."""
    return Message(sender, receiver, id, "inform", protocol, "C1", talk, sent, sent + 0.001)


def talk(*messages: Message, ended: bool = True) -> Talk:
    """The conversation of these messages, opened by the sender of the first."""
    first = messages[0]
    return Talk(
        first.conversation, first.protocol, "C1", first.sender, first.receiver, ended, messages
    )


ORDER = talk(say("hi", "co", "1", 1.0, "order"), say("co", "hi", "1", 9.0, "order"))
PLAN = talk(say("co", "pl", "1", 2.0, "plan"), say("pl", "co", "1", 3.0, "plan"))
WORK = talk(say("co", "ta", "1", 3.5, "work"), say("ta", "co", "1", 8.0, "work"))


def step(
    agent: str,
    at: float,
    took: Message | None,
    *said: Message,
    event: str = "Received",
    **more: object,
) -> Step:
    """A step that took one message and said others."""
    found = None if took is None else took.identity
    return Step(agent, at, event, found, tuple(one.identity for one in said), **more)  # type: ignore[arg-type]


def by_id(talks: Sequence[Talk], *steps: Step) -> dict[str, Span]:
    """Spans by their id."""
    return {one.id: one for one in spans(talks, steps)}


TAKEN = step("co", 2.0, ORDER.messages[0], PLAN.messages[0])
ANSWERED = step("co", 3.5, PLAN.messages[1], WORK.messages[0])


def test_what_is_opened_for_a_request_stands_below_it_and_so_does_what_its_answer_leads_to() -> (
    None
):
    """The plan is made for the order; the work begins when the plan is there, and is for the order,
    too.
    """
    found = by_id([ORDER, PLAN, WORK], TAKEN, ANSWERED)
    assert [found[name].parent for name in ("order", "plan", "work")] == ["", "order", "order"]
    assert {found["plan"].known, found["work"].known} == {Known.STEP}


def test_an_agent_knows_better_than_the_rule() -> None:
    """The end of one order lets another begin: what is opened then is for the other one, and the
    agent says so.
    """
    other = talk(say("hi", "co", "2", 4.0, "other"), say("co", "hi", "3", 20.0, "other"))
    second = talk(say("co", "pl", "2", 8.5, "second"), say("pl", "co", "2", 9.5, "second"))
    ended = step("co", 8.5, WORK.messages[1], second.messages[0])
    talks, before = [ORDER, PLAN, WORK, other, second], (TAKEN, ANSWERED)
    assert by_id(talks, *before, ended)["second"].parent == "order"
    told = step("co", 8.5, WORK.messages[1], second.messages[0], parents=(("second", "other"),))
    assert by_id(talks, *before, told)["second"].parent == "other"


def test_without_logs_it_is_the_open_conversation_and_said_to_be_by_time() -> None:
    """Of two that are open the newer one; none of a subscription, which is always open."""
    newer = talk(say("hi", "co", "2", 1.5, "newer"), say("co", "hi", "3", 9.0, "newer"))
    watch = talk(say("ox", "co", "1", 1.7, "watch", "subscribe"), ended=False)
    found = by_id([ORDER, newer, watch, PLAN])
    assert (found["plan"].parent, found["plan"].known) == ("newer", Known.TIME)
    assert found["order"].parent == ""
    late = talk(say("co", "pl", "7", 9.5, "late"))
    assert by_id([ORDER, newer, late])["late"].parent == ""


@pytest.mark.parametrize("event", ["Started", "PeerChanged pl"])
def test_what_an_agent_opens_of_itself_is_for_nobodys_sake(event: str) -> None:
    """A subscription after a restart is not part of the task that happens to be open."""
    own = step("co", 2.0, None, PLAN.messages[0], event=event)
    assert by_id([ORDER, PLAN], own)["plan"].parent == ""
    local = step("co", 2.0, None, PLAN.messages[0], event="Local")
    assert by_id([ORDER, PLAN], local)["plan"].parent == "order"


def test_a_conversation_with_several_is_a_span_for_each() -> None:
    """Their ids tell them apart; below each stands what that participant opened."""
    one, other = talk(say("co", "pl", "1", 2.0, "call")), talk(say("co", "ta", "1", 2.0, "call"))
    asked = talk(say("ta", "km", "1", 2.5, "asked"))
    found = by_id([ORDER, one, other, asked], step("ta", 2.5, other.messages[0], asked.messages[0]))
    assert found.keys() == {"order", "call/pl", "call/ta", "asked"}
    assert found["asked"].parent == "call/ta"


def test_an_answer_after_work_of_its_own_is_caused_by_the_request() -> None:
    """The step took a device's word; by the protocol the message answers what was asked last."""
    done = step("ta", 8.0, None, WORK.messages[1], event="Local")
    (answer,) = by_id([ORDER, WORK], done)["work"].messages[1:]
    assert (answer.cause, answer.known) == (WORK.messages[0].identity, Known.REPLY)


def test_what_is_said_in_another_trace_stands_beside_its_cause() -> None:
    """An answer in the work makes ta tell a subscriber something: a line of the work, no
    conversation of it.
    """
    told = say("ta", "km", "5", 5.0, "watch", "subscribe")
    watch = talk(say("km", "ta", "1", 0.5, "watch", "subscribe"), told, ended=False)
    act = talk(say("ta", "ex", "1", 4.0, "act"), say("ex", "ta", "1", 4.9, "act"))
    asked, answered = act.messages
    steps = step("ta", 4.0, WORK.messages[0], asked), step("ta", 5.0, answered, told)
    found = by_id([watch, ORDER, WORK, act], *steps)
    assert [one.identity for one in found["act"].beside] == [told.identity]
    assert not found["watch"].beside


# --- The export for tools of OpenTelemetry --------------------------------------------------------


HISTORIES = Path(__file__).parents[2] / "histories"


@pytest.fixture(scope="module", params=["pour_seed_7", "verified_pour_seed_7"])
def trace(request: pytest.FixtureRequest) -> Trace:
    """The trace of a recorded pour."""
    return opened(HISTORIES / request.param, SYSTEM).trace


def spans_of(request: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """(Service, span) of a request."""
    return [
        (resource["resource"]["attributes"][0]["value"]["stringValue"], span)
        for resource in request["resourceSpans"]
        for scope in resource["scopeSpans"]
        for span in scope["spans"]
    ]


def test_every_conversation_is_a_client_and_a_server_span_of_its_two_agents(trace: Trace) -> None:
    """Ids are 8 and 16 bytes in hexadecimal digits and unique; a trace has one root, every other
    parent is in it.
    """
    task = next(one for one in trace.roots if one.initiator == "hi")
    found = spans_of(exported(trace, [task]))
    ids = {span["spanId"]: (agent, span) for agent, span in found}
    assert len(ids) == len(found) == 2 * len(list(trace.below(task)))
    (name,) = {span["traceId"] for _, span in found}
    assert re.fullmatch("[0-9a-f]{32}", name)
    assert [span["kind"] for _, span in found if "parentSpanId" not in span] == [CLIENT]
    for agent, span in found:
        assert re.fullmatch("[0-9a-f]{16}", span["spanId"])
        assert int(span["startTimeUnixNano"]) <= int(span["endTimeUnixNano"])
        if "parentSpanId" in span:
            above, parent = ids[span["parentSpanId"]]
            assert (parent["kind"], span["kind"]) in {(CLIENT, SERVER), (SERVER, CLIENT)}
            assert int(parent["startTimeUnixNano"]) <= int(span["startTimeUnixNano"])
            assert (above == agent) is (span["kind"] == CLIENT)


def test_roots_are_traces_of_their_own_and_made_again_the_same(trace: Trace) -> None:
    """One trace-id for each."""
    found = spans_of(exported(trace, trace.roots))
    assert len({span["traceId"] for _, span in found}) == len(trace.roots)
    assert exported(trace, trace.roots) == exported(trace, trace.roots)


def test_a_no_is_an_error_with_its_reason() -> None:
    """On both sides; an open conversation has no status."""
    asked = Message("a", "b", "1", "request", "request", "C1", "c", 1.0, 1.1)
    no = Message("b", "a", "1", "refuse", "request", "C1", "c", 2.0, 2.1, reason="busy")
    span = Span("c", "c", "request", "C1", "a", "b", "go", 1.0, 2.0, True, messages=(asked, no))
    told = spans_of(exported(Trace("s", 1.0, (span,)), [span]))
    assert [one["status"] for _, one in told] == [{"code": ERROR, "message": "busy"}] * 2
    going = Span("c", "c", "request", "C1", "a", "b", "go", 1.0, 1.0, False, messages=(asked,))
    told = spans_of(exported(Trace("s", 1.0, (going,)), [going]))
    assert [one["status"] for _, one in told] == [{}, {}]


@pytest.mark.parametrize("history", ["pour_seed_7", "verified_pour_seed_7"])
def test_a_trace_needs_no_signals(history: str) -> None:
    """It is the same whether or not the telemetry was read before."""
    place = HISTORIES / history
    alone, after = opened(place), opened(place)
    assert after.history.said
    assert alone.trace == after.trace


def test_a_long_log_is_traced_in_a_time_that_grows_with_it(tmp_path: Path) -> None:
    """Of messages that were taken at once none is looked for among all that came before."""
    log = StepLog(tmp_path / "co.steps")
    one = Communicate(performative=Performative.INFORM, sender="hi", receiver="co", protocol="x")
    for number in range(20_000):
        data = msgspec.msgpack.encode(Arrived(replace(one, id=str(number))))
        took = f"hi {number}"
        log.write([(LoggedStep(1, number, 1.0, Arrived.__name__, data, took=took), NOTHING)])
    log.close()
    begun = time.process_time()
    assert list(_steps(log.path, [], SYSTEM)) == []
    assert time.process_time() - begun < 10.0
