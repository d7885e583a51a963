"""The export for tools of OpenTelemetry: what the format of OTLP in JSON demands of spans, on
recorded runs.
"""

import re
from pathlib import Path
from typing import Any

import pytest

from companion.tools.system import SYSTEM
from operate.recording.run import opened
from operate.tracing.otlp import CLIENT, ERROR, SERVER, exported
from operate.tracing.trace import Message, Span, Trace

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
