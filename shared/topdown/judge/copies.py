"""Copies and numbers: what was said before, and in which order a durable stream was said.

A design's durable communicates are numbered per sender and receiver (their ids are the numbers), sent again until
receipted, and so heard several times, perhaps not in order. Nothing here knows protocols.
"""

import zlib
from collections import OrderedDict, defaultdict
from collections.abc import Hashable
from enum import Enum, auto
from typing import Generic, TypeVar

import msgspec

from fipa_codec.communicate import number_of
from topdown.judge.verdicts import Heard
from topdown.model.design import Rule

T = TypeVar("T")
REMEMBERED = 20_000
"""Ids of one sender that are known again, 4 MB; estimate: minutes of an agent that says 40 communicates a second, whose
outbox is smaller by far."""

Pair = tuple[str, str]
"""Sender and receiver."""


class Remembered(Generic[T]):
    """Values noted under some keys, the last `most` of them. Of a key only its hash is kept (64 bits)."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._noted: OrderedDict[int, T] = OrderedDict()

    def note(self, key: Hashable, value: T) -> T | None:
        """Return the value noted under this key before; where there was none, note `value`."""
        name = hash(key)
        before = self._noted.get(name)
        if before is None:
            self._noted[name] = value
            if len(self._noted) > self._most:
                self._noted.popitem(last=False)
        return before

    def __contains__(self, key: Hashable) -> bool:
        return hash(key) in self._noted


class Known(Enum):
    """State of an id."""

    NEW = auto()
    SAME = auto()
    """The same words were said before."""
    OTHER = auto()
    """Other words bore this id."""


class Copies:
    """Ids that were heard, with what was said under them; of some nobody knows the content."""

    def __init__(self) -> None:
        self._prints: defaultdict[str, Remembered[tuple[int, int]]] = defaultdict(lambda: Remembered(REMEMBERED))
        self._journals: defaultdict[str, int] = defaultdict(int)

    def note(self, heard: Heard, rule: Rule) -> Known:
        """Return the state of this communicate's id and remember it. A message without an id is always new.

        A latest value that is still due is said once more in a new conversation: only there it is a copy.
        """
        one = heard.communicate
        if one is None or not one.id:
            return Known.NEW
        words = 0 if one.content is msgspec.UNSET else zlib.crc32(one.content)
        found = hash((heard.key, one.conversation, one.reply_with, one.in_reply_to)), words
        receiver = (one.receiver, self._journals[one.receiver]) if one.receiver in self._journals else one.receiver
        identity = (receiver, one.id, one.conversation if rule.latest else "")
        before = self._prints[one.sender].note(identity, found)
        if before is None:
            return Known.NEW
        same = before[0] == found[0] and (before[1] == words or 0 in (before[1], words))
        return Known.SAME if same else Known.OTHER

    def forget(self, agent: str) -> None:
        """The agent lost its journal: it numbers from 1 again, and so does who speaks to it."""
        self._prints.pop(agent, None)
        self._journals[agent] += 1


class Streams(Generic[T]):
    """Durable streams: what may be judged in order, and what waits for a smaller number."""

    def __init__(self) -> None:
        self._next: dict[Pair, int] = {}
        self._held: dict[Pair, dict[int, T]] = {}

    def put(self, pair: Pair, number: int, entry: T, *, first: int | None = None) -> list[T] | None:
        """Return what is in order now; nothing, while a smaller number is missing; None if older than the first heard.

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
        number = number_of(label)
        return number is not None and number >= self._next.get(pair, 0)

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
