"""From the words of a sentence to its meaning, by the catalogue: an Earley parser over words.

A sentence has at most MOST_CHARACTERS, MOST_WORDS and MOST_WISHES, so that the time of a parse is
bounded; it is for the thread that listens to people, never of the agent's step. Must not know:
HTTP, tasks, what was said before.
"""

import difflib
import re
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from msgspec.structs import replace

from companion.letters import fold
from services.human_interface import patterns
from services.human_interface.catalogue import CATALOGUE, LANGUAGES, RULES, WISHES, phrases
from services.human_interface.device_messages import Clause, Meaning, NamedObject, When

# --- Times, as people say them: "first", "within ten minutes", "before noon", "in ten minutes" ----
# Such words are taken out of a sentence before the grammar reads the rest; words about time that
# are not understood stay, so that the grammar refuses the sentence. By the catalogue. Must not
# know: tasks, clocks.


HALF_DAY, DAY = 12 * 60, 24 * 60
MORNING, NIGHT = 6 * 60, 22 * 60  # estimate: who says three o'clock between them means three by day


def _choice(words: object) -> str:
    return "|".join(sorted(words, key=len, reverse=True))  # type: ignore[call-overload]


def _part(language: str) -> str:
    """Return the expression of a part of a duration: number, half, unit, half."""
    number = rf"(\d{{1,4}}(?:[.,]\d{{1,2}})?|{_choice(CATALOGUE.number[language])})"
    text = re.sub(r"\bN\b", lambda _: number, CATALOGUE.time[language].part)
    return text.replace("UNIT", f"({_choice(CATALOGUE.unit[language])})")


_TIME_PART = {language: re.compile(rf"\b{_part(language)}\b") for language in LANGUAGES}


def _expression(text: str, language: str) -> re.Pattern[str]:
    """Return a row of the catalogue as an expression over words with a blank between them."""
    numbers = _choice(CATALOGUE.number[language])
    hour = rf"\d{{1,2}}|{numbers}"
    spoken = (
        rf"half past (?:{hour})|quarter (?:past|to) (?:{hour})|(?:{hour}) o clock|godziny"
        rf" (?:{hour})"
    )
    clock = (
        rf"\d{{1,2}}:\d\d(?: [ap]m)?|\d{{1,2}} ?[ap]m|{spoken}|{_choice(CATALOGUE.clock[language])}"
    )
    text = text.replace("\n", "").replace("CLOCK", f"({clock})")
    part = re.sub(r"\((?!\?)", "(?:", _part(language))
    text = text.replace(
        "DURATION", f"({part}(?: (?:(?:{CATALOGUE.time[language].plus}) )?{part})*)"
    )
    return re.compile(rf"(?:^| )(?:{text})(?= |$)")


_URGENT, _WITHIN, _BY, _LATER, _AT = (
    {
        language: _expression(getattr(CATALOGUE.time[language], kind), language)
        for language in LANGUAGES
    }
    for kind in ("urgent", "within", "by", "later", "at")
)


def split_time(words: tuple[str, ...]) -> tuple[tuple[str, ...], When]:
    """Return the words without those that say when, and what these say; all of them where nothing
    else is left.
    """
    text, when = " ".join(words), When()
    for language in LANGUAGES:
        if found := _WITHIN[language].search(text):
            when = replace(when, within_s=_seconds(found, language))
            text = _without_time(text, found)
        if (found := _BY[language].search(text)) and (by := _clocks(found.group(1), language)):
            text, when = _without_time(text, found), replace(when, by=by)
        if found := _LATER[language].search(text):
            when = replace(when, later_s=_seconds(found, language))
            text = _without_time(text, found)
        if (found := _AT[language].search(text)) and (at := _clocks(found.group(1), language)):
            text, when = _without_time(text, found), replace(when, at=at)
        # behind the others: "first" is the last word of what is left
        if found := _URGENT[language].search(text):
            text, when = _without_time(text, found), replace(when, urgent=True)
    rest = tuple(text.split())
    return (rest, when) if any(word != "," for word in rest) else (words, When())


def _without_time(text: str, found: re.Match[str]) -> str:
    return text[: found.start()] + text[found.end() :]


def _seconds(found: re.Match[str], language: str) -> float:
    """The sum of the parts of the duration that was found."""
    seconds = 0.0
    for part in _TIME_PART[language].finditer(next(one for one in found.groups() if one)):
        number, half, unit, half_more = part.groups()
        amount = (_number(number, language) if number else 1.0) + (
            0.5 if half or half_more else 0.0
        )
        seconds += amount * CATALOGUE.unit[language][unit]
    return seconds


def _number(word: str, language: str) -> float:
    return (
        float(word.replace(",", ".")) if word[0].isdecimal() else CATALOGUE.number[language][word]
    )


def _clocks(said: str, language: str) -> tuple[int, ...]:
    """The times of day that are meant, in minutes."""
    if said in CATALOGUE.clock[language]:
        return (CATALOGUE.clock[language][said],)
    if found := re.fullmatch(r"(\d+):(\d+)(?: ([ap]m))?", said):
        if found[1].startswith("0") and not found[3] and int(found[2]) < 60:  # 03:30 is by night
            return (60 * int(found[1]) + int(found[2]),)
        return _of_day(int(found[1]), int(found[2]), found[3] or "")
    if found := re.fullmatch(r"(\d+) ?([ap]m)", said):
        return _of_day(int(found[1]), 0, found[2])
    plain = re.sub(r"half past |quarter past |quarter to | o clock|godziny ", "", said)
    hour = int(_number(plain, language))
    past = {"half": 30, "quarter": 15}.get(said.partition(" ")[0], 0)
    return _of_day(hour, -past if said.startswith("quarter to") else past, "")


def _of_day(hour: int, minute: int, half: str) -> tuple[int, ...]:
    """The times of day of a clock's time; none for one that no clock shows."""
    if hour > 24 or minute > 59 or (half and not 1 <= hour <= 12):
        return ()
    at = 60 * hour + minute
    if half:
        return ((at % HALF_DAY + (HALF_DAY if half == "pm" else 0)) % DAY,)
    return (at % HALF_DAY, at % HALF_DAY + HALF_DAY) if 1 <= hour <= 12 else (at % DAY,)


def seconds_left(when: When, minute_of_day: float) -> float:
    """Return the seconds until it is to be done, from the asker's time of day [min]; 0 where
    nothing was said.
    """
    return _sooner(when.within_s, when.by, minute_of_day)


def seconds_until(when: When, minute_of_day: float) -> float:
    """Return the seconds until it may begin, from the asker's time of day [min]; 0 where nothing
    was said.
    """
    return _sooner(when.later_s, when.at, minute_of_day)


def _sooner(after_s: float, clocks: tuple[int, ...], minute_of_day: float) -> float:
    """The sooner one. Of two times of day who speaks by day does not mean the one by night."""
    if MORNING <= minute_of_day < NIGHT:
        clocks = tuple(at for at in clocks if at >= MORNING) or clocks
    ahead = [(at - minute_of_day) % DAY * 60.0 for at in clocks]
    return min([after_s] * (after_s > 0.0) + ahead, default=0.0)


# --- From the words of a sentence to its meaning, by the catalogue --------------------------------


MOST_CHARACTERS = 200
MOST_WORDS = 51  # and marks; as many as four wishes have as hi itself says them
MOST_WISHES = 4
# a comma within a wish, ", and" after it; many cost the parser most (measured)
MOST_SEPARATORS = 3 * MOST_WISHES
MOST_STRANGE = 3  # words that nobody knows; with more the sentence is of something else (estimate)
# similarity from which an unknown word may be a typing error (as difflib counts; estimate)
NEAR = 0.75
# letters below which no word is taken for another one (estimate; a guess is only ever asked)
SHORT = 3

_TASK = re.compile(r"hi-\d+-\d+")
_WORDS = re.compile(r"hi-\d+-\d+|(?<!\w)[-\u2212]\d+|\d{1,2}:\d\d|\d+[.,]\d+|[^\W_]+|[,.;:!?]")


class _Found(NamedTuple):
    """Words that were found: a side, a task, a part of a name; and what they mean."""

    what: str
    value: Any


def _word_that(
    fits: Callable[[str], object], what: str, means: Callable[[str], Any]
) -> patterns.Rule:
    """Return the rule of one word."""

    def rule(sentence: patterns.Sentence, at: int) -> patterns.Ends:
        word = sentence.words[at]
        return {at + 1: patterns.Match((_Found(what, means(word)),))} if fits(word) else {}

    return rule


def _strange_words(sentence: patterns.Sentence, at: int) -> patterns.Ends:
    """One to three words that nobody knows."""
    ends = {}
    for end in range(at + 1, min(at + MOST_STRANGE, len(sentence.words)) + 1):
        if not _unknown(sentence.words[end - 1]):
            break
        ends[end] = patterns.Match((_Found("strange", sentence.said(at, end)),), end - at)
    return ends


_THING = """REFERENCE|[DET] [QUALITIES] NAME [NUMBER] [WHERE]|REFERENCE NAME|
[DET] [QUALITIES] STRANGE [WHERE]"""
"""A thing: of two readings with the same end the first one counts."""


class _Language:
    """The grammar of a language."""

    def __init__(self, language: str) -> None:
        names = [
            (one.covers or (one.name,), "|".join(getattr(one, language))) for one in CATALOGUE.thing
        ]
        texts = RULES[language] | {
            "NOUN": "|".join(text for _, text in names),
            "QUALITIES": "ADJECTIVE [ADJECTIVE [ADJECTIVE]]",
        }
        self._of = patterns.Patterns(texts)
        references = [(one, one.upper()) for one in ("it", "other", "both")]
        sides = [(side, words[language]) for side, words in CATALOGUE.side.items()]
        numbers = _word_that(str.isdecimal, "number", lambda word: int(word[:3]))
        self._of.rules |= {
            "SIDE": self._one_of("side", sides),
            "NAME": self._one_of("kinds", names),
            "REFERENCE": self._one_of("ref", references),
            "ADJECTIVE": self._one_of("quality", [(None, "QUALITY")]),
            "WHERE": self._one_of("quality", [(None, "PLACE")]),
            "NUMBER": numbers,
            "TASK": _word_that(_TASK.fullmatch, "task", str),
            "STRANGE": _strange_words,
        }
        whole = self._of.part(_THING)
        self._of.rules["THING"] = lambda sentence, at: {
            end: patterns.Match(
                (_named_object(sentence.said(at, end), match.found),), match.strange
            )
            for end, match in sentence.ends(whole, at).items()
        }
        self._joining = self._of.part(CATALOGUE.joining[language])
        self._forms: list[tuple[int, bool, patterns.Part]] = []
        for lacks in (False, True):
            for at, row in enumerate(WISHES):
                texts_of = row.lacking.get(language, ()) if lacks else getattr(row, language)
                self._forms += [(at, lacks, self._of.part(text)) for text in texts_of]
        self.words = frozenset(self._of.words)

    def _one_of(self, what: str, rows: list[tuple[Any, str]]) -> patterns.Rule:
        """Return the rule of several patterns, each with its meaning (None: its words)."""
        parts = [(means, self._of.part(text)) for means, text in rows]

        def rule(sentence: patterns.Sentence, at: int) -> patterns.Ends:
            ends: dict[int, patterns.Match] = {}
            for means, part in parts:
                for end in sentence.ends(part, at):
                    value = sentence.said(at, end) if means is None else means
                    ends.setdefault(end, patterns.Match((_Found(what, value),)))
            return ends

        return rule

    def clauses(self, words: tuple[str, ...]) -> tuple[Clause, ...] | None:
        """Return the wishes that a whole sentence has, one more than are taken at most; None where
        it is none. The reading with the fewest strange words, then with the fewest wishes.
        """
        sentence = patterns.Sentence(words)
        best = self._best(sentence, 0, MOST_WISHES + 1, {})
        return None if best is None else best[1]

    def _best(
        self,
        sentence: patterns.Sentence,
        at: int,
        left: int,
        known: dict[tuple[int, int], tuple[int, tuple[Clause, ...]] | None],
    ) -> tuple[int, tuple[Clause, ...]] | None:
        """The strange words and wishes of the best reading of the rest; None for none."""
        if (at, left) in known:
            return known[at, left]
        best: tuple[int, tuple[Clause, ...]] | None = None
        for end, (strange, clause) in self._clause_ends(sentence, at).items():
            if end == len(sentence.words):
                rests: list[tuple[int, tuple[Clause, ...]] | None] = [(0, ())]
            elif left > 1:
                behind = self._behind_joining(sentence, end)
                rests = [self._best(sentence, one, left - 1, known) for one in behind]
            else:
                continue
            for rest in rests:
                if rest is not None:
                    found = (strange + rest[0], (clause, *rest[1]))
                    if best is None or (found[0], len(found[1])) < (best[0], len(best[1])):
                        best = found
        known[at, left] = best
        return best

    def _behind_joining(self, sentence: patterns.Sentence, at: int) -> set[int]:
        """Where the next wish may begin: behind a comma, a joining word, or both."""
        comma = sentence.words[at] == ","
        behind = {at + 1} if comma else set()
        for end in sentence.ends(self._joining, at + comma):
            behind |= {end, end + (sentence.words[end : end + 1] == (",",))}
        return behind

    def _clause_ends(self, sentence: patterns.Sentence, at: int) -> dict[int, tuple[int, Clause]]:
        """The ends of the wishes that begin at a word, the first one of the catalogue for each."""
        ends: dict[int, tuple[int, Clause]] = {}
        for row, lacks, form in self._forms:
            for end, (found, strange) in sentence.ends(form, at).items():
                if end not in ends or strange < ends[end][0]:
                    ends[end] = strange, _clause(WISHES[row].does, found, lacks=lacks)
        return ends


def _named_object(said: str, found: tuple[Any, ...]) -> NamedObject:
    of = dict(found)
    quality = " ".join(one.value for one in found if one.what == "quality")
    return NamedObject(
        of.get("strange", said),
        of.get("kinds", ()),
        of.get("number", 0),
        quality,
        of.get("ref", ""),
    )


def _clause(does: str, found: tuple[Any, ...], *, lacks: bool) -> Clause:
    things = tuple(one for one in found if isinstance(one, NamedObject))
    of = dict(one for one in found if isinstance(one, _Found))
    return Clause(does, things, of.get("side", ""), of.get("task", ""), lacks)


_OF = {language: _Language(language) for language in LANGUAGES}
VOCABULARY = frozenset[str]().union(*(one.words for one in _OF.values()))


def _unknown(word: str) -> bool:
    """Whether nobody knows the word; marks and numbers are no words."""
    return (
        word != ","
        and not word.isdecimal()
        and not _TASK.fullmatch(word)
        and word not in VOCABULARY
    )


# --- reading --------------------------------------------------------------------------------------


def understand(sentence: str) -> Meaning:
    """Return the meaning of a sentence; never raises."""
    if len(sentence) > MOST_CHARACTERS:
        return Meaning(why="long")
    words = _split(sentence)
    if len(words) > MOST_WORDS:
        return Meaning(why="long")
    words, when = split_time(words)
    return replace(_read(words), when=when)


def _read(words: tuple[str, ...]) -> Meaning:
    """The meaning of words without those that say when."""
    polite, plain = _polite(words), tuple(_commas(words))
    separators = sum(word == "," or word in _JOINING for word in polite)
    if separators > MOST_SEPARATORS:
        return Meaning(_language(words), why="many")
    run = tuple(word for word in polite if word != ",")  # Polish has commas within a wish
    readings = [reading for reading in dict.fromkeys((polite, plain, run)) if reading]
    parsed = (meaning for reading in readings if (meaning := _parsed(reading)) is not None)
    found = next(parsed, None)
    if found is not None and not _strange(found):
        return found
    for reading in readings:
        if (
            (near := _corrected(reading)) != reading
            and (guess := _parsed(near)) is not None
            and not _strange(guess)
        ):
            return Meaning(guess.language, guess.clauses, guessed=True)
    if found is not None:
        return found
    strange = next((word for word in words if _unknown(word)), "")
    return Meaning(
        _language(words), why="many" if separators > MOST_WISHES else "sorry", strange=strange
    )


def _strange(meaning: Meaning) -> bool:
    """Whether a thing is called by a word that nobody knows."""
    things = (thing for clause in meaning.clauses for thing in clause.things)
    return any(not (thing.kinds or thing.ref) for thing in things)


def _split(sentence: str) -> tuple[str, ...]:
    """The words, and a comma for every mark that parts them."""
    return tuple("," if one in ",.;:!?" else one for one in _WORDS.findall(fold(sentence)))


def _commas(words: tuple[str, ...]) -> Iterator[str]:
    """The words with no comma first, last or twice."""
    before = ","
    kept = list(words)
    while kept and kept[-1] == ",":
        kept.pop()
    for word in kept:
        if word != "," or before != ",":
            yield word
        before = word


def _polite(words: tuple[str, ...]) -> tuple[str, ...]:
    """The words without polite ones: some are left out wherever they stand, some at the beginning
    of a wish.
    """
    words = tuple(_without(words, _ANYWHERE, opening=False))
    words = tuple(_commas(words))
    return tuple(_commas(tuple(_without(words, _OPENING, opening=True))))


def _without(
    words: tuple[str, ...], lists: tuple[tuple[str, ...], ...], *, opening: bool
) -> Iterator[str]:
    at, begins = 0, True
    while at < len(words):
        found = next((one for one in lists if words[at : at + len(one)] == one), None)
        if found and (begins or not opening) and at + len(found) < len(words) + (not opening):
            at += len(found)
            continue
        begins = words[at] == "," or words[at] in _JOINING
        yield words[at]
        at += 1


def _parsed(words: tuple[str, ...]) -> Meaning | None:
    """The meaning in the first language whose words these are and that has such a sentence."""
    if sum(_unknown(word) for word in words) > MOST_STRANGE:
        return None
    ours = VOCABULARY.intersection(words)
    possible = (language for language in LANGUAGES if ours <= _OF[language].words)
    parsed = (_parsed_in(language, words) for language in possible)
    return next((found for found in parsed if found is not None), None)


def _parsed_in(language: str, words: tuple[str, ...]) -> Meaning | None:
    clauses = _OF[language].clauses(words)
    if clauses is None:
        return None
    if len(clauses) > MOST_WISHES:
        return Meaning(language, why="many")
    return Meaning(language, clauses)


def _corrected(words: tuple[str, ...]) -> tuple[str, ...]:
    """The words, those that nobody knows replaced by known ones that are written alike, where they
    are few.
    """
    if sum(_unknown(word) for word in words) > MOST_STRANGE:
        return words
    unknown = {word for word in words if _unknown(word) and len(word) >= SHORT}
    return tuple(_near(word) if word in unknown else word for word in words)


def _near(word: str) -> str:
    found = difflib.get_close_matches(word, _LONG, n=1, cutoff=NEAR)
    return found[0] if found else word


def _language(words: tuple[str, ...]) -> str:
    """The language that most of the words are of; English if in doubt."""
    counts = {one: sum(word in _OF[one].words for word in words) for one in LANGUAGES}
    return max(LANGUAGES, key=lambda one: counts[one])


_LONG = tuple(sorted(word for word in VOCABULARY if len(word) >= SHORT))
_ANYWHERE = tuple(one for language in LANGUAGES for one in phrases(CATALOGUE.anywhere[language]))
_OPENING = tuple(
    sorted((one for x in LANGUAGES for one in phrases(CATALOGUE.opening[x])), key=len, reverse=True)
)
_JOINING = frozenset(
    one[0] for language in LANGUAGES for one in phrases(CATALOGUE.joining[language])
)
