"""The outcome as the designer writes it down is the outcome of the steps: agents, groups, channels by number."""

from collections.abc import Iterable, Iterator

from topdown.model.design import Design
from topdown.model.elements import StatedChannel
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
