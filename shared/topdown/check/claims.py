"""Statements of one thing in several places agree; figures within the claim's tolerance.

A statement is an interval or a word or a set of words; figures agree if their intervals have a point in common.
"""

import math
from collections.abc import Iterator

from topdown.check.estimate import total
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind
from topdown.model.statements import Claim, Statement


def findings(design: Design) -> Iterator[Finding]:
    """One for each claim whose statements disagree; a `ruling` does not silence it."""
    for index, claim in enumerate(design.file.claim):
        if not _agree(claim):
            said = "; ".join(f"{one.where}: {words(one, claim.unit)}" for one in claim.stated)
            right = claim.ruling or "state it once, or say under `ruling` what holds"
            yield Finding(Kind.CLAIM, f"claim {claim.name}", said, right, ("claim", index))


def _agree(claim: Claim) -> bool:
    spans = [bounds(one) for one in claim.stated]
    figures = [span for span in spans if span is not None]
    if len(figures) < len(spans):
        return len({_word(one) for one in claim.stated}) <= 1
    least = max((low for low, _ in figures), default=0.0)
    most = min((high for _, high in figures), default=0.0)
    return least - most <= claim.tolerance * max(abs(least), abs(most))


def bounds(one: Statement) -> tuple[float, float] | None:
    """The figures a statement allows, from least to most; None: it is in words."""
    if isinstance(one.says, int | float):
        return one.says, one.says
    if one.says is not None:
        return None
    if one.sum:
        return total(one.sum), total(one.sum)
    if one.product:
        value = math.prod(one.product) / math.prod(one.over)
        return value, value
    return -math.inf if one.least is None else one.least, math.inf if one.most is None else one.most


def _word(one: Statement) -> object:
    return frozenset(one.says) if isinstance(one.says, tuple) else one.says


def words(one: Statement, unit: str) -> str:
    """A statement as people read it."""
    span = bounds(one)
    if span is None:
        return ", ".join(one.says) if isinstance(one.says, tuple) else str(one.says)
    low, high = span
    shown = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    shown = f"at least {low:g}" if high == math.inf else f"at most {high:g}" if low == -math.inf else shown
    how = " (sum)" if one.sum else " (computed)" if one.product else ""
    return f"{shown}{' ' + unit if unit else ''}{how}"
