"""Copies and numbers: what was said before, and in which order a durable stream was said.

A design's durable communicates are numbered per sender and receiver (their ids are the numbers), sent again until
receipted, and so heard several times, perhaps not in order. Nothing here knows protocols.
"""

import zlib
from collections import OrderedDict
from enum import Enum, auto
from typing import Generic, TypeVar

import msgspec

from topdown.design import Rule
from topdown.verdicts import Heard

T = TypeVar("T")
REMEMBERED = 100_000
"""Ids that are known again; estimate: hours of a talkative fleet, some 20 MB."""

Pair = tuple[str, str]
"""Sender and receiver."""
Print = tuple[str, str, str, str, int]


class Known(Enum):
    """What is known of an id."""

    NEW = auto()
    SAME = auto()
    """The same words were said before."""
    OTHER = auto()
    """Other words bore this id."""


class Copies:
    """Ids that were heard, with what was said under them."""

    def __init__(self) -> None:
        self._prints: OrderedDict[tuple[str, str, str, str], Print] = OrderedDict()

    def note(self, heard: Heard, rule: Rule) -> Known:
        """What is known of this one's id; it is remembered. A message without an id is always new.

        A latest value that is still due is said once more in a new conversation: only there it is a copy.
        """
        one = heard.communicate
        if one is None or not one.id:
            return Known.NEW
        words = 0 if one.content is msgspec.UNSET else zlib.crc32(one.content)
        found = (heard.key, one.conversation, one.reply_with, one.in_reply_to, words)
        identity = (one.sender, one.receiver, one.id, one.conversation if rule.latest else "")
        before = self._prints.setdefault(identity, found)
        if before is found:
            if len(self._prints) > REMEMBERED:
                self._prints.popitem(last=False)
            return Known.NEW
        return Known.SAME if before == found else Known.OTHER

    def forget(self, agent: str) -> None:
        """The agent numbers from 1 again."""
        for identity in [one for one in self._prints if one[0] == agent]:
            del self._prints[identity]


class Streams(Generic[T]):
    """Durable streams: what may be judged in order, and what waits for a smaller number."""

    def __init__(self) -> None:
        self._next: dict[Pair, int] = {}
        self._held: dict[Pair, dict[int, T]] = {}

    def put(self, pair: Pair, number: int, entry: T, *, first: int | None = None) -> list[T] | None:
        """What is in order now; nothing, while a smaller number is missing; None for one older than the first heard.

        `first`: the number a stream begins with, where that is known.
        """
        expected = self._next.setdefault(pair, number if first is None else first)
        if number < expected:
            return None
        held = self._held.setdefault(pair, {})
        held[number] = entry
        return self._in_order(pair)

    def unheard(self, pair: Pair, label: str) -> bool:
        """Whether a label is a number of this stream (m_w of a durable message is its number) not heard so far."""
        return label.isascii() and label.isdigit() and int(label) >= self._next.get(pair, 0)

    def give_up(self, pair: Pair, number: int) -> tuple[tuple[int, int], list[T]] | None:
        """The numbers missing before this one, first and last, and what is in order without them.

        None where it waits no longer.
        """
        if number not in self._held.get(pair, {}):
            return None
        missing = (self._next[pair], number - 1)
        before = [self._held[pair].pop(n) for n in sorted(self._held[pair]) if n < number]
        self._next[pair] = number
        return missing, [*before, *self._in_order(pair)]

    def forget(self, agent: str | None = None) -> list[T]:
        """Forget the streams of an agent, or all; what waited in them."""
        pairs = [pair for pair in self._next if agent is None or agent in pair]
        left: list[T] = []
        for pair in pairs:
            del self._next[pair]
            left += self._held.pop(pair, {}).values()
        return left

    def _in_order(self, pair: Pair) -> list[T]:
        held, ready = self._held[pair], []
        while self._next[pair] in held:
            ready.append(held.pop(self._next[pair]))
            self._next[pair] += 1
        return ready
