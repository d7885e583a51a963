"""What a sentence is about where the grammar does not read it: the wishes that its words hint at,
and the things that it names, part by part.

Parts end at marks and at words such as "because" (`border` of the catalogue), so that small talk
beside a wish hides nothing. What comes of hints is asked, refused with a reason or answered; never
done. Must not know: what was said before, which things there are.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from companion.stop_words import fold, forms
from services.human_interface.catalogue import CATALOGUE, LANGUAGES, TASKS, WISHES
from services.human_interface.device_messages import Hints, Mention, NamedObject, Part

Named = tuple[int, int, NamedObject]
"""A thing in the words of a sentence: its first word, the word behind it, what was named."""


class _Found(NamedTuple):
    """Words that hint at rows of the catalogue, from one to before another."""

    at: int
    end: int
    does: tuple[str, ...]


class _Phrases:
    """The phrases of a language; a word that ends with * may end otherwise."""

    def __init__(self, rows: Iterable[tuple[str, str]]) -> None:
        found: dict[tuple[str, ...], list[str]] = {}
        for does, texts in rows:
            for form in forms(texts):
                words = found.setdefault(tuple(_plain(form).split()), [])
                if does not in words:
                    words.append(does)
        self._by_start: dict[str, list[tuple[tuple[str, ...], tuple[str, ...]]]] = {}
        for phrase, does in sorted(found.items(), key=lambda one: (-len(one[0]), one[0])):
            start = phrase[0].removesuffix("*")
            self._by_start.setdefault(start, []).append((phrase, tuple(does)))
        self._longest = max(map(len, self._by_start), default=0)

    def found(self, words: tuple[str, ...]) -> Iterator[_Found]:
        """Yield the phrases in the words from left to right; the longest of two that overlap."""
        at = 0
        while at < len(words):
            one = self._longest_at(words, at)
            if one is not None:
                yield one
            at = at + 1 if one is None else one.end

    def _longest_at(self, words: tuple[str, ...], at: int) -> _Found | None:
        word, best = words[at], None
        for length in range(min(len(word), self._longest), 0, -1):
            for phrase, does in self._by_start.get(word[:length], ()):
                end = at + len(phrase)
                longer = best is None or end > best.end
                if longer and len(words) >= end and all(map(_fits, phrase, words[at:end])):
                    best = _Found(at, end, does)
        return best


def _plain(form: str) -> str:
    """A row in the letters of sentences."""
    return fold(form.replace("'", " "))


def _fits(pattern: str, word: str) -> bool:
    return word.startswith(pattern[:-1]) if pattern.endswith("*") else word == pattern


_OF = {
    language: _Phrases(
        [(row.does, row.hint[language]) for row in WISHES if row.hint]
        + [(one.says, getattr(one, language)) for one in CATALOGUE.cannot]
    )
    for language in LANGUAGES
}
_CANNOT = frozenset(one.says for one in CATALOGUE.cannot)
_BORDERS, _ASKING, _EXCEPT, _TO, _FROM, _BESIDE, _DENYING = (
    {one: frozenset(fold(rows[one]).split("|")) for one in LANGUAGES}
    for rows in (
        CATALOGUE.border,
        CATALOGUE.asking,
        CATALOGUE.excepting,
        CATALOGUE.to,
        CATALOGUE.source,
        CATALOGUE.beside,
        CATALOGUE.denying,
    )
)


def hints(words: tuple[str, ...], language: str, named: Iterable[Named]) -> Hints:
    """Return what the words of a sentence hint at; `named`: the things in them."""
    names, parts = list(named), list[tuple[int, int]]()
    begin = 0
    for at, word in enumerate((*words, ",")):
        inside = any(one[0] <= at < one[1] for one in names)
        if not inside and (word == "," or word in _BORDERS[language]):
            parts.append((begin, at))
            begin = at + 1
    read = [_read(words, begin, end, language, names) for begin, end in parts if begin < end]
    read = list(_joined(read))
    kept = [one.part for one in read if one.kept]
    told = [one for one in kept if one.does or _has_role(one)]
    asked = _first(kept, "talk")
    cannot = _first(kept, "cannot")
    done = any(one.does and one.mentions for one in told)
    if asked and not done:
        return Hints(talk=asked)
    plain = tuple(one for one in kept if one.mentions and one not in told)
    return Hints(tuple(told), "", cannot, tuple(of for one in plain for of in one.mentions))


class _Read(NamedTuple):
    """A part of a sentence. `bare`: it is a name alone; `kept`: no word excepts it."""

    part: Part
    bare: bool
    kept: bool


def _first(parts: list[Part], field: str) -> str:
    return next((found for one in parts if (found := getattr(one, field))), "")


def _has_role(part: Part) -> bool:
    return any(one.role == "to" for one in part.mentions)


def _joined(parts: list[_Read]) -> Iterator[_Read]:
    """The parts, those of a name alone with the next one: "the jar and the bowl go ..."."""
    waiting: tuple[Mention, ...] = ()
    last: _Read | None = None
    for one in parts:
        if one.bare and one.kept:
            waiting += one.part.mentions
            continue
        if last is not None:
            yield last
        mentions = waiting + one.part.mentions if one.kept else one.part.mentions
        waiting = () if one.kept else waiting
        last = one._replace(part=_with(one.part, mentions))
    if last is not None:
        yield last._replace(part=_with(last.part, last.part.mentions + waiting))
    elif waiting:
        yield _Read(Part(mentions=waiting), True, True)


def _with(part: Part, mentions: tuple[Mention, ...]) -> Part:
    return Part(part.does, mentions, part.talk, part.cannot)


def _read(
    words: tuple[str, ...], begin: int, end: int, language: str, names: list[Named]
) -> _Read:
    """One part: its first words decide whether it asks or wishes."""
    said = words[begin:end]
    inside = [one for one in names if begin <= one[0] and one[1] <= end]
    mentions = tuple(
        Mention(thing, _role(words, at, begin, language)) for at, _, thing in inside
    )
    does: list[str] = []
    talk = cannot = ""
    for found in _OF[language].found(said):
        tasks = [one for one in found.does if one in TASKS]
        if found.at and tasks and said[found.at - 1] in _DENYING[language]:
            continue
        if not (does or talk):
            talk = next((one for one in found.does if one not in TASKS and one not in _CANNOT), "")
        cannot = cannot or next((one for one in found.does if one in _CANNOT), "")
        does += [one for one in tasks if one not in does and not talk]
    if not (does or talk or cannot) and said[0] in _ASKING[language] and mentions:
        talk = "see"
    bare = len(said) == sum(to - at for at, to, _ in inside) and bool(inside)
    excepted = begin > 0 and words[begin - 1] in _EXCEPT[language]
    return _Read(Part(tuple(does), mentions, talk, cannot), bare, not excepted)


def _role(words: tuple[str, ...], at: int, begin: int, language: str) -> str:
    """What the word before a thing makes of it."""
    before = words[at - 1] if at > begin else ""
    rows = (("to", _TO), ("from", _FROM), ("beside", _BESIDE))
    return next((role for role, of in rows if before in of[language]), "")
