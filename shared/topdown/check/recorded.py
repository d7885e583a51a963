"""A recording against the design: traffic it does not have, sizes and latencies over budget, what was never heard.

Findings are gathered per act and content: how many, and the worst.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator

from topdown.check.adding_up import sums
from topdown.check.observe import Observation, Observed, answers, counts, use_of
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind


def findings(design: Design, run: Observed) -> tuple[Finding, ...]:
    """All findings of one run."""
    said = run.communicates
    parts = (_strange(design, said), _sizes(design, said), _latencies(design, said), sums(design, counts(said)))
    return tuple(finding for part in parts for finding in part)


def _strange(design: Design, said: Iterable[Observation]) -> Iterator[Finding]:
    """Messages that the design does not have; between agents without a channel adding_up says it."""
    odd: dict[tuple[str, str, str, str], int] = defaultdict(int)
    pairs = {frozenset(channel.ends) for channel in design.channels.values()}
    for one in said:
        if use_of(design, one) is None and frozenset((one.sender, one.receiver)) in pairs:
            odd[one.sender, one.receiver, one.protocol, str(one.performative)] += 1
    for (sender, receiver, protocol, act), count in odd.items():
        allowed = ", ".join(sorted(design.allowed(sender, receiver, protocol))) or "nothing"
        right = f"it may say {allowed} there"
        wrong = f"{count} {act} in {protocol}"
        yield Finding(Kind.NOT_DESIGNED, f"run, {sender} to {receiver}", wrong, right)


def _sizes(design: Design, said: Iterable[Observation]) -> Iterator[Finding]:
    over: dict[tuple[str, str, str, str, int], list[int]] = defaultdict(list)
    for one in said:
        rule = design.rules.get((one.sender, one.receiver, one.protocol, one.performative))
        if rule is None:
            continue
        budget = rule.sizes.get(one.content, rule.bytes)
        if 0 < budget < one.bytes:
            over[rule.use, one.sender, str(one.performative), one.content, budget].append(one.bytes)
    for (use, sender, act, content, budget), sizes in over.items():
        wrong = f"{len(sizes)} larger than {budget} B, the largest {max(sizes)} B"
        where = f"run, protocol {use}, {sender} {act}{' ' + content if content else ''}"
        right = "say it shorter, or allow more"
        yield Finding(Kind.TOO_LARGE, where, wrong, right, _place(design, use))


def _latencies(design: Design, said: Iterable[Observation]) -> Iterator[Finding]:
    for name, answered in answers(design, said).items():
        budget = design.protocols[name].latency_s
        late = [one.latency_s for one in answered if one.latency_s is not None and 0 < budget < one.latency_s]
        if late:
            wrong = f"{len(late)} of {len(answered)} answers took more than {budget:g} s, the longest {max(late):.3g} s"
            where, right = f"run, protocol {name}", "answer faster, or allow more"
            yield Finding(Kind.TOO_LATE, where, wrong, right, (*_place(design, name), "latency_s"))


def _place(design: Design, use: str) -> tuple[str | int, ...]:
    return ("protocol", next(i for i, entry in enumerate(design.file.protocol) if entry.name == use))
