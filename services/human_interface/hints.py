"""What a sentence is about where the grammar does not read it: the wishes that its words hint at,
and the things that it names, part by part.

Parts end at marks and at words such as "because" (`border` of the catalogue), so that small talk
beside a wish hides nothing. What comes of hints is asked, refused with a reason or answered; never
done. Must not know: what was said before, which things there are.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from msgspec.structs import replace

from companion.commands import Offer
from companion.stop_words import fold, forms
from services.human_interface.catalogue import CATALOGUE, LANGUAGES, LIGHT, TASKS, WISHES
from services.human_interface.device_messages import Hints, Mention, NamedObject, Part

Named = tuple[int, int, NamedObject]
"""A thing in the words of a sentence: its first word, the word behind it, what was named."""


class _Found(NamedTuple):
    """Words that hint at rows of the catalogue, from one to before another."""

    at: int
    end: int
    does: tuple[str, ...]


class _Phrases:
    """The phrases of a language; a word that ends with * may end otherwise, one that begins with *
    may begin otherwise, and is a phrase by itself.
    """

    def __init__(self, rows: Iterable[tuple[str, str]]) -> None:
        found: dict[tuple[str, ...], list[str]] = {}
        for does, texts in rows:
            for form in forms(texts):
                words = found.setdefault(tuple(_plain(form).split()), [])
                if does not in words:
                    words.append(does)
        self._ends = {one[0][1:]: tuple(of) for one, of in found.items() if one[0][0] == "*"}
        self._by_start: dict[str, list[tuple[tuple[str, ...], tuple[str, ...]]]] = {}
        for phrase, of in found.items():
            start = phrase[0].removesuffix("*")
            self._by_start.setdefault(start, []).append((phrase, tuple(of)))
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
        for ending, does in self._ends.items():
            if word.endswith(ending):
                best = _Found(at, at + 1, does)
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
_ALONE = frozenset(does for does, wish in TASKS.items() if wish.offer is Offer.ALONE)
"""Wishes that need no thing."""
_STANDS, _AND, _UNTIL, _BORDERS, _ASKING, _EXCEPT, _TO, _FROM, _BESIDE, _DENYING = (
    {one: frozenset(fold(rows[one]).split("|")) for one in LANGUAGES}
    for rows in (
        CATALOGUE.standing,
        CATALOGUE.listing,
        CATALOGUE.until,
        CATALOGUE.border,
        CATALOGUE.asking,
        CATALOGUE.excepting,
        CATALOGUE.to,
        CATALOGUE.source,
        CATALOGUE.beside,
        CATALOGUE.denying,
    )
)
_QUESTIONS = {
    language: {word: does for does, words in rows.items() for word in fold(words).split("|")}
    for language, rows in CATALOGUE.question.items()
}
"""What is answered to a question of which only the first word is known."""


def hints(words: tuple[str, ...], language: str, named: Iterable[Named]) -> Hints:
    """Return what the words of a sentence hint at; `named`: the things in them."""
    names, parts = list(named), list[tuple[int, int]]()
    begin, begins, ends = 0, {one[0] for one in names}, {one[1] for one in names}
    for at, word in enumerate((*words, ",")):
        inside = any(one[0] <= at < one[1] for one in names)
        between = word in _AND[language] and at in ends and at + 1 in begins
        inside = inside or between
        if not inside and (word == "," or word in _BORDERS[language]):
            parts += [(begin, at)] if begin < at else []
            begin = at + 1
    read = [_read(words, begin, end, language, names) for begin, end in parts]
    perhaps = any(
        words[begin] in _ASKING[language] and one == Part(mentions=one.mentions) and _names_one(one)
        for (begin, _), one in zip(parts, read, strict=True)
    )
    read = list(_joined(read))
    told = [one for one in read if one.does or any(of.role == "to" for of in one.mentions)]
    cannot = next((one.cannot for one in read if one.cannot), "")
    asked = next((one.talk for one in read if one.talk and not (cannot and one.talk in LIGHT)), "")
    if asked and not any(map(_wishes, told)):
        return Hints(talk=asked)
    if parts and not (told or cannot) and not any(map(_names_one, read)):
        begin, end = parts[0]
        asked = _QUESTIONS[language].get(words[begin], "") if begin + 1 < end else ""
        if asked:
            return Hints(talk=asked)
    others = (of for one in read if one not in told for of in one.mentions)
    return Hints(tuple(told), "", cannot, tuple(others), perhaps)


def _wishes(part: Part) -> bool:
    """Whether a part wishes by itself: with a verb and what it needs, or a thing and its place."""
    roles = {one.role for one in part.mentions if one.thing.kinds or one.thing.ref == "both"}
    verb = part.does and (roles or _ALONE & {*part.does})
    return bool(verb or (not part.talk and roles >= {"", "to"}))


def _names_one(part: Part) -> bool:
    return any(one.thing.kinds for one in part.mentions)


def _joined(parts: Iterable[Part]) -> Iterator[Part]:
    """The parts, those of a name alone with the next one: "the jar and the bowl go ..."."""
    waiting: tuple[Mention, ...] = ()
    last: Part | None = None
    for one in parts:
        if one == Part(mentions=one.mentions) and all(not of.role for of in one.mentions):
            waiting += one.mentions
            continue
        if last is not None:
            yield last
        last, waiting = replace(one, mentions=waiting + one.mentions), ()
    if last is not None:
        yield replace(last, mentions=last.mentions + waiting)
    elif waiting:
        yield Part(mentions=waiting)


def _read(words: tuple[str, ...], begin: int, end: int, language: str, names: list[Named]) -> Part:
    """One part: its first words decide whether it asks or wishes."""
    said = words[begin:end]
    mentions = tuple(
        Mention(thing, _role(words, at, language))
        for at, to, thing in names
        if begin <= at and to <= end
    )
    does: list[str] = []
    talk = cannot = ""
    for found in _OF[language].found(said):
        tasks = [one for one in found.does if one in TASKS]
        if found.at and said[found.at - 1] in _DENYING[language]:
            found = found._replace(does=tuple(one for one in found.does if one in _CANNOT))
            tasks = []
        if not (does or talk):
            talk = next((one for one in found.does if one not in TASKS and one not in _CANNOT), "")
        before = words[begin + found.at - 1] if begin + found.at else ""
        meal = {"no_chores"} if before in _UNTIL[language] else set[str]()  # "before supper"
        cannot = cannot or next((one for one in found.does if one in _CANNOT - meal), "")
        # "throw the jar away to get it out": what comes behind is no wish of its own
        does += [one for one in tasks if one not in does and not (talk or (cannot and not does))]
    if not (does or talk or cannot):
        things = any(one.thing.kinds for one in mentions)
        talk = "see" if things and said[0] in _STANDS[language] else ""
    return Part(tuple(does), mentions, talk, cannot)


def _role(words: tuple[str, ...], at: int, language: str) -> str:
    """What the word before a thing makes of it."""
    before = words[at - 1] if at else ""
    rows = (("to", _TO), ("from", _FROM), ("beside", _BESIDE), ("except", _EXCEPT))
    return next((role for role, of in rows if before in of[language]), "")
