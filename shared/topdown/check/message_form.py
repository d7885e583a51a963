"""The form of messages: one form for each act, a budget for each, no act that FIPA says is never performed."""

from collections.abc import Iterator

from fipa_codec.performatives import Performative
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind
from topdown.model.loading import Path_

MACRO = (Performative.INFORM_IF, Performative.INFORM_REF)
"""Macro acts: planned with, never performed (SC00037J); the inform or its like is what is said."""


def findings(design: Design) -> Iterator[Finding]:
    """Of every message; a `ruling` on it or its protocol answers for a macro act."""
    for index, use in enumerate(design.file.protocol):
        at: Path_ = ("protocol", index)
        if use.latency_s <= 0:
            right = "say `latency_s`, what an answer should need at most"
            yield Finding(Kind.NO_BUDGET, f"protocol {use.name}", "has no latency budget", right, at)
        for number, message in enumerate(use.message):
            yield from _message(use, message, use.message[:number], (*at, "message", number))


def _message(
    use: elements.Protocol, message: elements.Message, before: tuple[elements.Message, ...], at: Path_
) -> Iterator[Finding]:
    where = f"protocol {use.name}, {message.sender} {message.performative}"
    same = [one for one in before if (one.sender, one.performative) == (message.sender, message.performative)]
    for other in same[:1]:
        if other.language != message.language:
            wrong = f"is written in {other.language} and in {message.language}"
            yield Finding(Kind.TWO_FORMS, where, wrong, "one language for each act of a protocol", at)
        elif bool(other.content) != bool(message.content):
            yield Finding(Kind.TWO_FORMS, where, "is said with content and without", "one or the other", at)
    if message.performative in MACRO and not (message.ruling or use.ruling) and not same:
        right = "answer with inform, or give the entry a ruling"
        yield Finding(Kind.MACRO_ACT, where, "FIPA makes it a macro act, which is never performed", right, at)
    if message.bytes <= 0:
        yield Finding(Kind.NO_BUDGET, where, "has no size budget", "say `bytes`, the largest size", at)
