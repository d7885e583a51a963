"""A parser of patterns over words: (a|b) is a choice, [a] may be left out, a name in capitals is a
rule.

A pattern matches part of a sentence from a given word on; all ends of its matches are kept, the
best match for each end. Each part of a pattern is matched once at each word, so that the work is
bounded by parts x words. Patterns do not call themselves. Must not know: which words there are.
"""

import re
from collections.abc import Callable, Mapping
from typing import NamedTuple

from companion.stop_words import fold

_PART = re.compile(r"[()|\[\]]|[^\W\d]+")


class Match(NamedTuple):
    """What was found on the way: captured values in the order of the words.

    `strange`: words that were taken for a name because nobody knows them.
    """

    found: tuple[object, ...] = ()
    strange: int = 0


Ends = Mapping[int, Match]
"""The ends of a pattern's matches (index of the word behind), each with its best match."""
NOWHERE: Ends = {}
_NOTHING = Match()
Rule = Callable[["Sentence", int], Ends]
"""A rule made by code: matches from a word on."""


class Part:
    """A part of a pattern. `first`: the words that it can begin with; None if any word can."""

    first: frozenset[str] | None
    empty: bool

    def ends(self, sentence: "Sentence", at: int) -> Ends:
        """Return the ends of its matches from this word on."""
        raise NotImplementedError


class _Word(Part):
    empty = False

    def __init__(self, word: str) -> None:
        self._word, self.first = word, frozenset((word,))

    def ends(self, sentence: "Sentence", at: int) -> Ends:
        fits = at < len(sentence.words) and sentence.words[at] == self._word
        return {at + 1: _NOTHING} if fits else NOWHERE


class _Made(Part):
    """A rule made by code."""

    first, empty = None, False

    def __init__(self, rule: Rule) -> None:
        self._rule = rule

    def ends(self, sentence: "Sentence", at: int) -> Ends:
        return self._rule(sentence, at) if at < len(sentence.words) else {}


class _Row(Part):
    """Parts one after the other."""

    def __init__(self, parts: tuple[Part, ...]) -> None:
        self._parts = parts
        self.empty = all(one.empty for one in parts)
        firsts: set[str] = set()
        for one in parts:
            if one.first is None:
                self.first = None
                return
            firsts |= one.first
            if not one.empty:
                break
        self.first = frozenset(firsts)

    def ends(self, sentence: "Sentence", at: int) -> Ends:
        ends: Ends = {at: _NOTHING}
        for part in self._parts:
            longer: dict[int, Match] = {}
            for end, before in ends.items():
                for then, match in sentence.ends(part, end).items():
                    if before is not _NOTHING:
                        strange = before.strange + match.strange
                        match = Match(before.found + match.found, strange)
                    _keep(longer, then, match)
            if not longer:
                return {}
            ends = longer
        return ends


class _Choice(Part):
    """One of several parts; of two with the same end, the one with fewer strange words, then the
    first one.
    """

    def __init__(self, parts: tuple[Part, ...], *, optional: bool) -> None:
        self._parts, self.empty = parts, optional or any(one.empty for one in parts)
        firsts = [one.first for one in parts]
        known = [one for one in firsts if one is not None]
        self.first = frozenset().union(*known) if len(known) == len(firsts) else None
        self._optional = optional

    def ends(self, sentence: "Sentence", at: int) -> Ends:
        ends: dict[int, Match] = {}
        for part in self._parts:
            for end, match in sentence.ends(part, at).items():
                _keep(ends, end, match)
        if self._optional:
            _keep(ends, at, _NOTHING)
        return ends


def _keep(ends: dict[int, Match], end: int, match: Match) -> None:
    if end not in ends or match.strange < ends[end].strange:
        ends[end] = match


class Sentence:
    """The words of a sentence, and what was matched in them so far."""

    def __init__(self, words: tuple[str, ...]) -> None:
        self.words = words
        self._next = (*words, None)
        self._ends: list[dict[Part, Ends]] = [{} for _ in self._next]

    def ends(self, part: Part, at: int) -> Ends:
        """Return the ends of a part's matches from this word on."""
        first = part.first
        if first is not None and self._next[at] not in first and not part.empty:
            return NOWHERE
        known = self._ends[at]
        if part not in known:
            known[part] = part.ends(self, at)
        return known[part]

    def said(self, at: int, end: int) -> str:
        """Return the words from one to before another."""
        return " ".join(self.words[at:end])


class Patterns:
    """The patterns of a language. `texts`: rules as patterns, by name; equal parts are one part.

    `rules`: rules made by code; one that a pattern names is to be there before it. `words`: the
    words of the patterns so far.
    """

    def __init__(self, texts: Mapping[str, str]) -> None:
        self._texts = dict(texts)
        self.rules: dict[str, Rule] = {}
        self.words: set[str] = set()
        self._parts: dict[object, Part] = {}

    def part(self, text: str) -> Part:
        """Return a pattern as a part. Raises KeyError for a rule that is not known."""
        open_: list[list[list[Part]]] = [[[]]]
        for sign in _PART.findall(text):
            if sign in "([":
                open_.append([[]])
            elif sign in ")]":
                group = self._choice(open_.pop(), optional=sign == "]")
                open_[-1][-1].append(group)
            elif sign == "|":
                open_[-1].append([])
            else:
                open_[-1][-1].append(self._rule(sign) if sign.isupper() else self._word(sign))
        (rows,) = open_
        return self._choice(rows, optional=False)

    def _rule(self, name: str) -> Part:
        if name in self.rules:
            return self._once(name, lambda: _Made(self.rules[name]))
        return self.part(self._texts[name])

    def _word(self, word: str) -> Part:
        plain = fold(word)
        self.words.add(plain)
        return self._once(plain, lambda: _Word(plain))

    def _choice(self, rows: list[list[Part]], *, optional: bool) -> Part:
        parts = tuple(self._row(tuple(row)) for row in rows)
        if len(parts) == 1 and not optional:
            return parts[0]
        key = (optional, *map(id, parts))
        return self._once(key, lambda: _Choice(parts, optional=optional))

    def _row(self, parts: tuple[Part, ...]) -> Part:
        if len(parts) == 1:
            return parts[0]
        return self._once(tuple(map(id, parts)), lambda: _Row(parts))

    def _once(self, key: object, make: Callable[[], Part]) -> Part:
        if key not in self._parts:
            self._parts[key] = make()
        return self._parts[key]
