"""The outcome as the designer writes it down is the outcome of the steps: agents, groups, channels by number."""

import math
from collections.abc import Iterable, Iterator

from topdown.check.estimate import total
from topdown.model.design import Design
from topdown.model.elements import Claim, StatedChannel, Statement
from topdown.model.findings import Finding, Kind


def findings(design: Design) -> Iterator[Finding]:
    """Yield findings against a stated outcome; none if no outcome is stated."""
    outcome = design.file.outcome
    if outcome is None:
        return
    where = outcome.where
    yield from _names(where, "agents", outcome.agents, design.agents)
    yield from _names(where, "groups", outcome.groups, [entry.name for entry in design.file.group])
    stated = {channel.id: channel for channel in outcome.channels}
    if not design.decomposition.astray:
        for channel in stated.values():
            yield from _channel(design, where, channel)
        listed = [set(stated.between) for stated in outcome.channels]
        for known in design.channels.values():
            if set(known.ends) not in listed and known.id not in design.decomposition.doubtful:
                wrong = f"leaves out {known.id}, between {' and '.join(known.ends)}"
                yield Finding(Kind.OUTCOME, where, wrong, "list it", ("outcome", "channels"))


def _names(where: str, what: str, stated: Iterable[str], known: Iterable[str]) -> Iterator[Finding]:
    extra, missing = sorted(set(stated) - set(known)), sorted(set(known) - set(stated))
    for name in extra:
        right = f"{what} are {', '.join(known) or 'none'}"
        yield Finding(Kind.OUTCOME, where, f"lists {name} among the {what}", right, ("outcome",))
    for name in missing:
        yield Finding(Kind.OUTCOME, where, f"leaves {name} out of the {what}", "list it", ("outcome",))


def _channel(design: Design, where: str, stated: StatedChannel) -> Iterator[Finding]:
    known = design.channels.get(stated.id)
    if stated.id in design.decomposition.doubtful or (known is not None and set(known.ends) == set(stated.between)):
        return
    ends = " and ".join(stated.between)
    same = [channel.id for channel in design.channels.values() if set(channel.ends) == set(stated.between)]
    if same:
        wrong = f"calls the channel of {ends} {stated.id}"
        right = f"the steps made it {same[0]}: numbers never change"
        yield Finding(Kind.RENUMBERED, where, wrong, right, ("outcome", "channels"))
    else:
        right = f"{known.id} joins {' and '.join(known.ends)}" if known else "no step makes it"
        yield Finding(Kind.OUTCOME, where, f"has {stated.id} between {ends}", right, ("outcome", "channels"))


# --- Statements of one thing in several places agree; figures within the claim's tolerance ---------------------------
# A statement is an interval or a word or a set of words; figures agree if their intervals have a point in common.


def claim_findings(design: Design) -> Iterator[Finding]:
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
        return len({frozenset(one.says) if isinstance(one.says, tuple) else one.says for one in claim.stated}) <= 1
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
