"""Whether what the paper states in several places agrees, and whether the counts of its Table 8 fit
a design.

Only a design that is transcribed from a text contradicts itself in this way; the checks of any
design file are topdown.check. A statement is an interval, a word or a set of words; figures agree
if their intervals have a point in common.
"""

import math
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path

import msgspec
from msgspec.structs import replace

from topdown.check.estimate import total
from topdown.check.recorded import sums
from topdown.model.design import Design
from topdown.model.findings import Finding, located


class Kind(StrEnum):
    """Names of faults, beside those of topdown.model.findings."""

    CLAIM = "statements disagree"


class Stated(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of statements. `where`: the place the statement stands in, as people find it."""

    where: str


class Statement(Stated, frozen=True):
    """One statement of a claim: exactly one of `says` (a figure, a word, or a set of words), `sum`,
    `product`, or bounds (`least`, `most`; either may be missing). `over`: what a product is divided
    by.
    """

    says: float | str | tuple[str, ...] | None = None
    sum: tuple[float, ...] = ()
    product: tuple[float, ...] = ()
    over: tuple[float, ...] = ()
    least: float | None = None
    most: float | None = None


class Claim(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One thing that is stated in several places, which must agree; figures within the share
    `tolerance`.
    """

    name: str
    stated: tuple[Statement, ...]
    unit: str = ""
    tolerance: float = 0.0
    ruling: str = ""


class Tally(Stated, frozen=True):
    """Communicates counted in a run: [sender, receiver, how many]. A pair that is missing had
    none.
    """

    counts: tuple[tuple[str, str, int], ...]


class Statements(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The file of them."""

    claim: tuple[Claim, ...] = ()
    tally: Tally | None = None


def findings(design: Design, file: Path) -> tuple[Finding, ...]:
    """All findings of the statements in a file, with their lines in it."""
    text = file.read_text(encoding="utf-8")
    return located(tuple(_findings(design, msgspec.toml.decode(text, type=Statements))), text)


def _findings(design: Design, stated: Statements) -> Iterator[Finding]:
    for index, claim in enumerate(stated.claim):
        if not _agree(claim):
            said = "; ".join(
                f"{one.where}: {statement_text(one, claim.unit)}" for one in claim.stated
            )
            right = claim.ruling or "state it once, or say under `ruling` what holds"
            yield Finding(Kind.CLAIM, f"claim {claim.name}", said, right, ("claim", index))
    if stated.tally is not None:
        counts = {(sender, receiver): count for sender, receiver, count in stated.tally.counts}
        for one in sums(design, counts, stated.tally.where):
            yield replace(one, at=("tally",))


def _agree(claim: Claim) -> bool:
    spans = [bounds(one) for one in claim.stated]
    figures = [span for span in spans if span is not None]
    if len(figures) < len(spans):
        says = (one.says for one in claim.stated)
        said = {frozenset(one) if isinstance(one, tuple) else one for one in says}
        return len(said) <= 1
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


def statement_text(one: Statement, unit: str) -> str:
    """A statement as people read it."""
    span = bounds(one)
    if span is None:
        return ", ".join(one.says) if isinstance(one.says, tuple) else str(one.says)
    low, high = span
    shown = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    if high == math.inf:
        shown = f"at least {low:g}"
    elif low == -math.inf:
        shown = f"at most {high:g}"
    how = " (sum)" if one.sum else " (computed)" if one.product else ""
    return f"{shown}{' ' + unit if unit else ''}{how}"
