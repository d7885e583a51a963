"""A trace as OTLP in JSON (opentelemetry-proto 1.x, ExportTraceServiceRequest), as Jaeger and the
collector read it.

An agent is a service. A conversation is a client span of its initiator and, below it, a server span
of its participant; messages in between are events. Ids are hashes of names, so that an export made
again has the same. Pure.
"""

import hashlib
from collections import defaultdict
from collections.abc import Sequence
from typing import Any

from operate.tracing.trace import Message, Span, Trace

SERVER, CLIENT = 2, 3
"""SpanKind of OTLP."""
OK, ERROR = 1, 2
"""StatusCode of OTLP."""
SCOPE = "roco"


def exported(trace: Trace, roots: Sequence[Span]) -> dict[str, Any]:
    """Return the request for the traces of some roots; a trace-id is that of the run's begin and
    the root.
    """
    of_agent: defaultdict[str, list[dict[str, Any]]] = defaultdict(list)
    for root in roots:
        name = _hash(16, trace.system, repr(trace.begin), root.id)
        spans = [span for _, span in trace.below(root)]
        known = {span.id for span in spans}
        for span in spans:
            above = span.parent if span.parent in known else ""
            of_agent[span.initiator].append(
                _span(trace, name, span, CLIENT, _id(trace, above, SERVER) if above else "")
            )
            of_agent[span.participant].append(
                _span(trace, name, span, SERVER, _id(trace, span.id, CLIENT))
            )
    resources = []
    for agent, found in sorted(of_agent.items()):
        own = _attributes({"service.name": agent, "service.namespace": trace.system})
        scope = {"scope": {"name": SCOPE}, "spans": found}
        resources.append({"resource": {"attributes": own}, "scopeSpans": [scope]})
    return {"resourceSpans": resources}


def _span(trace: Trace, name: str, span: Span, kind: int, parent: str) -> dict[str, Any]:
    """Return one side of a conversation. No recording says when the participant took the opening:
    both begin alike.
    """
    side = span.initiator if kind == CLIENT else span.participant
    status: dict[str, Any] = {"code": OK} if span.ended else {}
    if span.bad:
        status = {"code": ERROR, "message": span.last.reason}
    return {
        "traceId": name,
        "spanId": _id(trace, span.id, kind),
        **({"parentSpanId": parent} if parent else {}),
        "name": f"{span.protocol} {span.text}".strip(),
        "kind": kind,
        "startTimeUnixNano": _nano(span.start),
        "endTimeUnixNano": _nano(span.end),
        "attributes": _attributes(
            {
                "fipa.conversation": span.conversation,
                "fipa.protocol": span.protocol,
                "roco.channel": span.channel,
                "roco.peer": span.participant if kind == CLIENT else span.initiator,
                "roco.link": span.known or "none",
            }
        ),
        "events": [_event(one) for one in span.messages if one.sender == side],
        "status": status,
    }


def _event(one: Message) -> dict[str, Any]:
    told = {
        "fipa.performative": one.performative,
        "fipa.id": one.id,
        "text": one.text,
        "reason": one.reason,
    }
    kept = {name: value for name, value in told.items() if value}
    return {
        "timeUnixNano": _nano(one.sent),
        "name": f"{one.performative} {one.text}".strip(),
        "attributes": _attributes(kept),
    }


def _attributes(values: dict[str, str]) -> list[dict[str, Any]]:
    return [{"key": key, "value": {"stringValue": value}} for key, value in values.items()]


def _id(trace: Trace, span: str, kind: int) -> str:
    return _hash(8, repr(trace.begin), span, str(kind))


def _hash(size: int, *words: str) -> str:
    """Return hexadecimal digits, two for each byte; OTLP's JSON has ids so."""
    return hashlib.blake2b("\0".join(words).encode(), digest_size=size).hexdigest()


def _nano(at: float) -> str:
    return str(round(at * 1e9))
