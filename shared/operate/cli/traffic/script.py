"""One agent's part of a recording, and whether a real agent speaks it: its lines and its cues, in the order recorded.

A cue is what another agent says to it; it is given once all lines before it are spoken. A line is what the agent says.
Ids and conversations that the real agent names otherwise are told apart by their place. Pure: no clock, no wire.
"""

from collections.abc import Iterable
from typing import Any

import msgspec

from fipa_codec.communicate import Communicate

COMPARED = ("performative", "receiver", "protocol", "language", "ontology", "in_reply_to")
MOST_WORDS = 160


class Part(msgspec.Struct, frozen=True):
    """One entry, recorded at `at` [unix s]; `n` counts from 1. `mine`: a line of the agent; else a cue."""

    n: int
    at: float
    communicate: Communicate
    mine: bool


class Difference(msgspec.Struct, frozen=True):
    """First difference of the words: the field, its recorded value, its present value; None: nothing.

    `line`: which entry of the part, 0 where the recording has none.
    """

    line: int
    field: str
    recorded: Any
    now: Any


def parts(agent: str, heard: Iterable[tuple[float, Communicate]]) -> tuple[Part, ...]:
    """The part of an agent in a recording, copies left out."""
    known: set[tuple[str, str, str]] = set()
    found: list[Part] = []
    for at, one in heard:
        name = (one.sender, one.receiver, one.id)
        if agent in (one.sender, one.receiver) and name not in known:
            known.add(name)
            found.append(Part(len(found) + 1, at, one, one.sender == agent))
    return tuple(found)


def before(part: tuple[Part, ...]) -> Part | None:
    """The first entry that shows that the agent had lived before the recording began; None where nothing does.

    It answers what is not in the recording, or a stream begins with another number than 1.
    """
    said: set[tuple[str, str]] = set()
    streams: set[tuple[str, str]] = set()
    for one in part:
        words = one.communicate
        if words.in_reply_to and (words.conversation, words.in_reply_to) not in said:
            return one
        if words.id.isdigit() and (words.sender, words.receiver) not in streams and words.id != "1":
            return one
        said.add((words.conversation, words.reply_with))
        streams |= {(words.sender, words.receiver)} if words.id.isdigit() else set()
    return None


class Script:
    """Progress of the script: `spoken` lines of the part, in any order; names that the real agent chose differently."""

    def __init__(self, part: tuple[Part, ...]) -> None:
        self._part, self._at = part, 0
        self.spoken: set[int] = set()
        self._first: dict[str, Part] = {}
        for one in part:
            self._first.setdefault(one.communicate.conversation, one)
        self._recorded: dict[str, str] = {}
        self._real: dict[str, str] = {}
        self._labels: dict[tuple[str, str], str] = {}
        self._given: dict[tuple[str, str], str] = {}

    @property
    def given_cues(self) -> int:
        """Up to which entry all cues are given."""
        return self._at

    def cue(self) -> Part | None:
        """The next cue; None where there is none."""
        return next((one for one in self._part[self._at :] if not one.mine), None)

    def awaited(self) -> Part | None:
        """The first line before the next cue (or the end) that is not spoken yet."""
        cue = self.cue()
        end = len(self._part) if cue is None else cue.n - 1
        return next((one for one in self._part[:end] if one.mine and one.n not in self.spoken), None)

    def adapted(self, cue: Part) -> Communicate:
        """A cue with the names the real agent gave: its conversation, and what it answers."""
        one = cue.communicate
        answers = self._labels.get((one.conversation, one.in_reply_to), one.in_reply_to)
        talk = self._real.get(one.conversation, one.conversation)
        return msgspec.structs.replace(one, conversation=talk, in_reply_to=answers)

    def given(self, cue: Part, said: Communicate) -> None:
        """The cue was said, with these names."""
        self._at = cue.n
        if said.reply_with:
            self._given[said.sender, said.reply_with] = cue.communicate.reply_with

    def hear(self, one: Communicate) -> Difference | None:
        """The real agent said this: None where it is what was recorded, else where it differs."""
        line = self._line(one)
        if line is None:
            return Difference(0, "words", None, plain(one))
        self.spoken.add(line.n)
        was = line.communicate
        self._recorded[one.conversation], self._real[was.conversation] = was.conversation, one.conversation
        if one.reply_with:
            self._labels[was.conversation, was.reply_with] = one.reply_with
        answers = self._given.get((one.receiver, one.in_reply_to), one.in_reply_to)
        now = msgspec.structs.replace(one, in_reply_to=answers)
        found = difference(plain(was), plain(now))
        return None if found is None else Difference(line.n, *found)

    def _line(self, one: Communicate) -> Part | None:
        """The line it must be: the next of its conversation, else the next that opens one with that agent."""
        talk, mine = one.conversation, [part for part in self._part if part.mine and part.n not in self.spoken]
        known = self._recorded.get(talk)
        first = self._first.get(talk)
        if known is None and first is not None and not first.mine:
            known = talk
        if known is not None:
            return next(
                (p for p in mine if (p.communicate.conversation, p.communicate.receiver) == (known, one.receiver)), None
            )
        wanted = (one.receiver, one.protocol)
        opening = [part for part in mine if self._first[part.communicate.conversation] is part]
        return next((p for p in opening if (p.communicate.receiver, p.communicate.protocol) == wanted), None)


def plain(one: Communicate) -> dict[str, Any]:
    """Return the compared part of a communicate: all but its names and times."""
    told: dict[str, Any] = {name: str(getattr(one, name)) for name in COMPARED if getattr(one, name)}
    told["reply_by"] = one.reply_by is not None
    if one.content is not msgspec.UNSET:
        told["content"] = msgspec.msgpack.decode(one.content)
    return told


def difference(was: Any, now: Any, place: str = "") -> tuple[str, Any, Any] | None:
    """The first place where two values differ, and what stands there in both; None where they are the same."""
    if type(was) is not type(now):
        return place, was, now
    if isinstance(was, dict):
        for key in (*was, *(key for key in now if key not in was)):
            where = f"{place}.{key}" if place else str(key)
            if key not in was or key not in now:
                return where, was.get(key), now.get(key)
            found = difference(was[key], now[key], where)
            if found is not None:
                return found
        return None
    if isinstance(was, list):
        for n, (one, other) in enumerate(zip(was, now, strict=False)):
            found = difference(one, other, f"{place}[{n}]")
            if found is not None:
                return found
        return None if len(was) == len(now) else (f"{place} (length)", len(was), len(now))
    return None if was == now else (place, was, now)


def short(value: Any) -> str:
    """A value in JSON, cut off where it is long; None: nothing."""
    text = "nothing" if value is None else msgspec.json.encode(value).decode()
    return text if len(text) <= MOST_WORDS else text[: MOST_WORDS - 1] + "…"
