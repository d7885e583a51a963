"""Whether something that a sender said did not reach a tap: agents number what they put, and a gap tells.

A router drops what a slow reader does not take, and tells nobody; the queue of a slow recorder drops, too. Numbers of
different priorities may overtake each other on the way, so a gap counts once it is SETTLED_S old, by the time at which
samples passed the router. Every agent says something each second (its heartbeat), so a gap is noticed within two. Pure.
"""

from collections import OrderedDict

import msgspec

from agent_runtime.io.tap import Sample
from agent_runtime.io.zenoh_wire import LINK

SETTLED_S = 0.25
"""Longest time by which a number may be overtaken; estimate: priorities differ by milliseconds."""
SOURCES = 1024
"""Senders' sessions that are known; estimate: a fleet has a dozen."""
MOST_OPEN = 1000
"""Numbers of a source that may be missing singly; of more it is said at once (estimate)."""


class _Source(msgspec.Struct):
    """Record of a source since it reached its router for the `link`-th time: its greatest number, when last heard.

    `missing`: those below it that were not heard, in the order in which that was noticed, with the time at which the
    one before them was heard, and that of the one behind them [unix s].
    """

    link: int
    last: int
    at: float
    missing: dict[int, tuple[float, float]] = {}


class Gaps:
    """Of all that one tap hears."""

    def __init__(self) -> None:
        self._sources: OrderedDict[tuple[str, str], _Source] = OrderedDict()

    def heard(self, sample: Sample) -> Sample | None:
        """Return a sample saying that not all of what this one's sender said was heard, where that is certain now."""
        if not sample.number:
            return None
        name = sample.sender, sample.source
        source = self._sources.get(name)
        if source is None:
            self._sources[name] = _Source(*divmod(sample.number, LINK), sample.at)
            if len(self._sources) > SOURCES:
                self._sources.popitem(last=False)
            return None
        self._sources.move_to_end(name)
        _follow(source, sample)
        since = _lost(source)
        return None if since is None else Sample("", b"", sample.at, deaf_since=since, missed=sample.key)


def _follow(source: _Source, sample: Sample) -> None:
    """Note a number, and those that are missing before it."""
    link, number = divmod(sample.number, LINK)
    before, source.at = source.at, max(source.at, sample.at)
    if link != source.link:
        source.link, source.last = link, 0
    if number > source.last:
        first = max(source.last + 1, number - MOST_OPEN)
        source.missing |= dict.fromkeys(range(first, number), (before, sample.at))
        source.last = number
    else:
        source.missing.pop(number, None)


def _lost(source: _Source) -> float | None:
    """Return since when something that is missing for too long may have been said; it is told, and forgotten."""
    found = None
    while source.missing:
        number, (since, noticed) = next(iter(source.missing.items()))
        if source.at <= noticed + SETTLED_S and len(source.missing) < MOST_OPEN:
            break
        found = since if found is None else found
        del source.missing[number]
    return found
