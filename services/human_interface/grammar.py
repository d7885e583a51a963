"""From the words of a sentence to its meaning, by the catalogue.

Words are matched with patterns. A sentence of which only a part is understood, or with words that
were taken for others, is a guess, about which a person is asked. A sentence has at most
MOST_CHARACTERS, MOST_WORDS and MOST_WISHES, so that the time of a parse is bounded; it is for the
thread that listens to people, never of the agent's step. Must not know: HTTP, tasks, what was said
before.
"""

import itertools
import re
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from typing import Any, NamedTuple

from msgspec.structs import replace
from rapidfuzz import fuzz, process
from rapidfuzz.distance import OSA

from companion.languages import cmd
from companion.stop_words import fold
from services.human_interface import patterns
from services.human_interface.catalogue import (
    CATALOGUE,
    LANGUAGES,
    LIGHT,
    RULES,
    TASKS,
    THINGS,
    WISHES,
    phrases,
)
from services.human_interface.device_messages import Clause, Hints, Meaning, NamedObject
from services.human_interface.hints import Named, hints
from services.human_interface.times import split_time

MOST_CHARACTERS = cmd.MOST_CHARACTERS
MOST_WORDS = 51  # and marks; as many as four wishes have as hi itself says them
MOST_WISHES = 4
# a comma within a wish, ", and" after it; many cost the parser most (measured)
MOST_SEPARATORS = 3 * MOST_WISHES
MOST_STRANGE = 3  # words that nobody knows; with more the sentence is of something else (estimate)
# Letters from which an unknown word may have one slip, and two: a letter wrong, missing, too much,
# or two in the other order (estimates; a guess is only ever asked).
SHORT, LONG = 3, 6
# likeness of the words of a sentence and an example, of 100, from which it is named in a refusal
# (estimate)
ALIKE = 45.0
MOST_ALIKE = 3  # known words that an unknown one may be (estimate)
SURE_BY = 2  # known words more than of another language, which is not tried then (estimate)
MOST_GUESSES = 9  # sentences that are tried for one with unknown words (estimate)

LACKS = "lacks"  # how a form asks for a wish: something is left out
UNSAID = LIGHT | {"rather"}  # no part of a sentence alone is taken for one of these
LESS = 0.5  # words; one wish is likelier than two that have as many words (estimate)

Wishes = dict[int, tuple[int, Clause]]
"""The wishes that begin at a word, by their number of words, with their strange ones."""
Known = dict[tuple[str, ...], Wishes]
"""What was found so far, by the rest of a sentence: readings of one sentence have most of it in
common.
"""
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


def _any_word(sentence: patterns.Sentence, at: int) -> patterns.Ends:
    """A known word that is no name, in the place of one: "take the light"."""
    if sentence.words[at] == "," or sentence.words[at].isdecimal():
        return {}
    found = patterns.Match((_Found("strange", sentence.words[at]),), MOST_STRANGE + 1)
    return {at + 1: found}


_THING = """REFERENCE|[DET] [QUALITIES] NAME [NUMERAL] [WHERE]|REFERENCE NAME|
[DET] [QUALITIES] STRANGE [WHERE]|DET ANY"""
"""A thing: of two readings with the same end the first one counts."""


class _Language:
    """The grammar of a language."""

    def __init__(self, language: str) -> None:
        self.name = language
        names = [
            ((one.covers or (one.name,), doubt), "|".join(words))
            for one in CATALOGUE.thing
            for doubt, words in (
                ("", getattr(one, language)),
                ("many", one.many.get(language, ())),
                ("like", one.like.get(language, ())),
            )
            if words
        ]
        texts = RULES[language] | {
            "NOUN": "|".join(text for _, text in names),
            "QUALITIES": "ADJECTIVE [ADJECTIVE [ADJECTIVE]]",
        }
        self._of = patterns.Patterns(texts)
        references = [(one, one.upper()) for one in ("it", "this", "other", "both")]
        sides = [(side, words[language]) for side, words in CATALOGUE.side.items()]
        counted = {fold(word): n for word, n in CATALOGUE.counted[language].items()}
        numbers = _word_that(
            lambda word: word.isdecimal() or word in counted,
            "number",
            lambda word: counted[word] if word in counted else int(word[:3]),
        )
        self._of.rules |= {
            "SIDE": self._one_of("side", sides),
            "NAME": self._one_of("name", names),
            "REFERENCE": self._one_of("ref", references),
            "ADJECTIVE": self._one_of("quality", [(None, "QUALITY")]),
            "WHERE": self._one_of("quality", [(None, "PLACE")]),
            "NUMBER": numbers,
            "COMMA": _word_that(",".__eq__, "comma", str),
            "TASK": _word_that(_TASK.fullmatch, "task", str),
            "STRANGE": self._strange_words,
            "ANY": _any_word,
        }
        self._of.words |= counted.keys()
        whole = self._of.part(_THING)
        self._of.rules["THING"] = lambda sentence, at: {
            end: patterns.Match(
                (_named_object(sentence.said(at, end), match.found),), match.strange
            )
            for end, match in sentence.ends(whole, at).items()
        }
        self._thing = self._of.rules["THING"]
        self._hand = self._of.part("ONE_HAND")
        self._joining = self._of.part(CATALOGUE.joining[language])
        self._forms = [
            (row.does, how, self._of.part(text))
            for how in ("", LACKS, *dict.fromkeys(why for row in WISHES for why in row.unsure))
            for row in WISHES
            for text in row.texts(language, how)
        ]
        self.words = frozenset(self._of.words)
        self._borders = frozenset(fold(CATALOGUE.border[language]).split("|"))
        self._by_first: dict[str, list[tuple[str, str, patterns.Part]]] = {}

    def _strange_words(self, sentence: patterns.Sentence, at: int) -> patterns.Ends:
        """One to three words that nobody knows."""
        ends = {}
        for end in range(at + 1, min(at + MOST_STRANGE, len(sentence.words)) + 1):
            if (
                not self.unknown(sentence.words[end - 1])
                or sentence.words[end - 1] in self._borders
            ):
                break
            ends[end] = patterns.Match((_Found("strange", sentence.said(at, end)),), end - at)
        return ends

    def unknown(self, word: str) -> bool:
        """Whether the language has no such word; marks and numbers are no words."""
        known = word == "," or word.isdecimal() or _TASK.fullmatch(word) or word in self.words
        return not known

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

    def meaning(self, words: tuple[str, ...], known: Known) -> Meaning | None:
        """Return the meaning of a whole sentence; None where it has none. The reading with the
        fewest strange words, then with the fewest wishes. `known` grows.
        """
        if sum(map(self.unknown, words)) > MOST_STRANGE:
            return None
        best = self._best(patterns.Sentence(words), 0, MOST_WISHES + 1, {}, known)
        if best is None:
            return None
        if len(best[1]) > MOST_WISHES:
            return Meaning(self.name, why="many")
        return Meaning(self.name, best[1])

    def _best(
        self,
        sentence: patterns.Sentence,
        at: int,
        left: int,
        done: dict[tuple[int, int], tuple[int, tuple[Clause, ...]] | None],
        known: Known,
    ) -> tuple[int, tuple[Clause, ...]] | None:
        """The strange words and wishes of the best reading of the rest; None for none."""
        if (at, left) in done:
            return done[at, left]
        best: tuple[int, tuple[Clause, ...]] | None = None
        for end, (strange, clause) in self._clause_ends(sentence, at, known).items():
            end += at
            if end == len(sentence.words):
                rests: list[tuple[int, tuple[Clause, ...]] | None] = [(0, ())]
            elif left > 1:
                behind = self._behind_joining(sentence, end)
                rests = [self._best(sentence, one, left - 1, done, known) for one in behind]
            else:
                continue
            for rest in rests:
                if rest is not None:
                    found = (strange + rest[0], (clause, *rest[1]))
                    if best is None or (found[0], len(found[1])) < (best[0], len(best[1])):
                        best = found
        done[at, left] = best
        return best

    def parts(
        self, words: tuple[str, ...], known: Known, *, light: bool = False
    ) -> tuple[float, tuple[Clause, ...], tuple[str, ...]]:
        """Return the wishes that have most of the known words between them, how many they have
        (less for each further wish), and the words that are left over. Names and courtesies count
        where they may be `light`.
        """
        sentence = patterns.Sentence(words)
        best: list[tuple[float, tuple[Clause, ...], tuple[str, ...]]] = [(0.0, (), ())]
        for at in reversed(range(len(words))):
            covered, clauses, left = best[0]
            found = (covered, clauses, (words[at], *left))
            denied = at > 0 and words[at - 1] in _DENYING
            ends = {} if denied else self._clause_ends(sentence, at, known)
            for count, (strange, clause) in ends.items():
                end = at + count
                covered, clauses, left = best[count - 1]
                sure = count - strange
                covered += sure - (LESS if clauses else 0.0)
                apart = words[at - 1 : at] in ((), (",",)) and words[end : end + 1] in ((), (",",))
                told = sure > 1 or (apart and not strange)
                if told and (light or clause.does not in UNSAID) and covered > found[0]:
                    found = (covered, (clause, *clauses), left)
            best.insert(0, found)
        return best[0]

    def named(self, words: tuple[str, ...]) -> list[Named]:
        """Return the things in the words by known names, or called it, with where they stand."""
        sentence, found = patterns.Sentence(words), list[Named]()
        at = 0
        while at < len(words):
            ends = self._thing(sentence, at).items()
            known = [
                (end, thing)
                for end, match in ends
                for thing in match.found
                if isinstance(thing, NamedObject)
                and not match.strange
                and (
                    thing.kinds
                    or thing.ref == "both"
                    or (thing.ref == "it" and words[at] != "that")
                )
            ]
            end, thing = max(known, key=lambda one: one[0], default=(at + 1, None))
            if thing is not None:
                found.append((at, end, thing))
            at = end
        return found

    def side(self, words: tuple[str, ...]) -> str:
        """The side of a hand that the words name; "" for none."""
        sentence = patterns.Sentence(words)
        ends = (sentence.ends(self._hand, at) for at in range(len(words)))
        found = (one for of in ends for match in of.values() for one in match.found)
        return next((one.value for one in found if isinstance(one, _Found)), "")

    def _beginning(self, word: str) -> list[tuple[str, str, patterns.Part]]:
        """The forms that may begin with a word, in the order of the catalogue."""
        key = word if word in self.words else ""
        if key not in self._by_first:
            forms = [(row, row[2].first) for row in self._forms]
            self._by_first[key] = [row for row, of in forms if of is None or key in of]
        return self._by_first[key]

    def _behind_joining(self, sentence: patterns.Sentence, at: int) -> set[int]:
        """Where the next wish may begin: behind a comma, a joining word, or both."""
        comma = sentence.words[at] == ","
        behind = {at + 1} if comma else set()
        for end in sentence.ends(self._joining, at + comma):
            behind |= {end, end + (sentence.words[end : end + 1] == (",",))}
        return behind

    def _clause_ends(self, sentence: patterns.Sentence, at: int, known: Known) -> Wishes:
        """The wishes that begin at a word, the first one of the catalogue for each length."""
        rest = sentence.words[at:]
        if rest in known:
            return known[rest]
        ends = known[rest] = Wishes()
        if not rest:
            return ends
        for does, how, form in self._beginning(sentence.words[at]):
            for end, (found, strange) in sentence.ends(form, at).items():
                count = end - at
                if count not in ends or strange < ends[count][0]:
                    ends[count] = strange, _clause(does, found, how)
        return ends


def _named_object(said: str, found: tuple[Any, ...]) -> NamedObject:
    of = dict(found)
    kinds, doubt = of.get("name", ((), ""))
    quality = " ".join(one.value for one in found if one.what == "quality")
    number = of.get("number", 0)
    if "number" in of and not number:
        doubt = "none"
    said = of.get("strange", said)
    return NamedObject(said, kinds, number, quality, of.get("ref", ""), doubt)


def _clause(does: str, found: tuple[Any, ...], how: str) -> Clause:
    things = tuple(one for one in found if isinstance(one, NamedObject))
    of = dict(one for one in found if isinstance(one, _Found))
    unsure = how if how != LACKS else ""
    return Clause(does, things, of.get("side", ""), of.get("task", ""), how == LACKS, unsure)


_OF = {language: _Language(language) for language in LANGUAGES}
VOCABULARY = frozenset[str]().union(*(one.words for one in _OF.values()))


# --- reading --------------------------------------------------------------------------------------


def understand(sentence: str) -> Meaning:
    """Return the meaning of a sentence; never raises."""
    if len(sentence) > MOST_CHARACTERS:
        return Meaning(why="long")
    words = _split(sentence)
    if len(words) > MOST_WORDS:
        return Meaning(why="long")
    words, when = split_time(words)
    language = _language_of(words, sentence)
    found = _read(words, language)
    if any(itertools.starmap(_adds_to, itertools.pairwise(found.clauses))):
        found = replace(found, guessed=True)
    if found.guessed or not found.clauses or any(map(_unclear, found.clauses)):
        found = replace(found, hints=_hints(words, found.language))
    return replace(found, when=when)


def _language_of(words: tuple[str, ...], sentence: str) -> str:
    """The language of most words; Polish letters decide for Polish where no English word is known
    for each of them.
    """
    polish = sum(not _POLISH_LETTERS.isdisjoint(one) for one in sentence.lower().split())
    known = {one: _known(words, one) for one in LANGUAGES}
    return "pl" if known["pl"] + polish > known["en"] else "en"


def _hints(words: tuple[str, ...], language: str) -> Hints:
    """The hints in the words, else in those with the likeliest known ones for the unknown."""
    of = _OF[language]
    found = hints(words, language, of.named(words))
    if found == Hints():
        words = next(iter(_corrected(words, language)), words)
        found = hints(words, language, of.named(words))
    return replace(found, side=of.side(words))


def _read(words: tuple[str, ...], language: str) -> Meaning:
    """The meaning of words without those that say when: of all of them, else with words that are
    written or sound alike in place of unknown ones, else of those parts that are understood.
    """
    separators = sum(word == "," or word in _JOINING for word in _polite(words, language))
    if separators > MOST_SEPARATORS:
        return Meaning(language, why="many")
    known = _known(words, language) - SURE_BY
    likely = [one for one in LANGUAGES if one == language or _known(words, one) >= known]
    readings = {one: _readings(words, one) for one in sorted(likely, key=language.__ne__)}
    seen = {of: Known() for of in readings}
    parsed = [_OF[of].meaning(one, seen[of]) for of in readings for one in readings[of]]
    found = min(filter(None, parsed), key=_doubtful, default=None)
    if found is not None and _strange(found) and found.language != language:
        found = None
    if found is not None and not _strange(found):
        return found
    corrected = {
        of: [one for near in readings[of] for one in _corrected(near, of)] for of in readings
    }
    guesses = (_OF[of].meaning(one, seen[of]) for of in readings for one in corrected[of])
    guess = next((one for one in guesses if one is not None and not _strange(one)), None)
    named = found is not None and all(clause.does == "the" for clause in found.clauses)
    if guess is None and (found is None or named):
        wide = {of: (*readings[of], *corrected[of][:MOST_ALIKE]) for of in readings}
        tried = ((of, light) for light in (False, True) for of in wide)
        guess = next(
            filter(None, (_parts(wide[of], of, seen[of], light) for of, light in tried)), None
        )
    if guess is not None:
        return replace(guess, guessed=True)
    if found is not None:
        return found
    strange = next(filter(_OF[language].unknown, words), "")
    why = "many" if separators > MOST_WISHES else "sorry"
    return Meaning(language, why=why, strange=strange, near=_nearest(words, language))


def _readings(words: tuple[str, ...], language: str) -> tuple[tuple[str, ...], ...]:
    """The words as they are, without polite ones, without commas too (Polish has some within a
    wish), and without a word that says again what was said.
    """
    polite = _polite(words, language)
    run = _polite(tuple(word for word in words if word != ","), language)
    once = _commas(tuple(word for word in polite if word not in _ONCE_MORE))
    return tuple(one for one in dict.fromkeys((_commas(words), polite, run, once)) if one)


def _nearest(words: tuple[str, ...], language: str) -> str:
    """The wish for a task whose example is most like the words; "" where none is like them."""
    examples = {one: fold(wish.example[language]) for one, wish in TASKS.items()}
    said = " ".join(words)
    found = process.extractOne(said, examples, scorer=fuzz.ratio, score_cutoff=ALIKE)
    return found[2] if found else ""


def _doubtful(meaning: Meaning) -> tuple[bool, bool]:
    """Of two readings the one that is less so is meant: nothing is strange, nothing is left out."""
    return _strange(meaning), any(clause.lacks for clause in meaning.clauses)


def _unclear(clause: Clause) -> bool:
    """Whether a clause may come to nothing by itself."""
    if clause.does not in TASKS:
        return clause.does in ("the", "rather")
    return any(
        one.doubt or one.quality or not any(use in THINGS[kind].can for kind in one.kinds)
        for one, use in zip(clause.things, TASKS[clause.does].uses, strict=False)
        if not one.ref
    )


def _adds_to(name: Clause, wish: Clause) -> bool:
    """Whether a name before a wish is one more thing that it is about: "the jar and the bowl into
    the cabinet".
    """
    kinds = [set(one.kinds) for one in wish.things]
    return bool(
        name.does == "the"
        and name.things[0].kinds
        and wish.does in TASKS
        and kinds
        and not wish.things[0].ref
        and all(kinds_of.isdisjoint(name.things[0].kinds) for kinds_of in kinds)
    )


def _strange(meaning: Meaning) -> bool:
    """Whether a thing is called by a word that nobody knows."""
    things = (thing for clause in meaning.clauses for thing in clause.things)
    return any(not (thing.kinds or thing.ref) for thing in things)


def _split(sentence: str) -> tuple[str, ...]:
    """The words, and a comma for every mark that parts them; short spellings at length."""
    found = ("," if one in ",.;:!?" else one for one in _WORDS.findall(fold(sentence)))
    return tuple(word for one in found for word in _SPELLED.get(one, (one,)))


def _commas(words: tuple[str, ...]) -> tuple[str, ...]:
    """The words with no comma first, last or twice."""
    pairs = zip(words, (",", *words), strict=False)
    kept = [one for one, before in pairs if {one, before} != {","}]
    return tuple(kept[:-1] if kept[-1:] == [","] else kept)


def _polite(words: tuple[str, ...], language: str) -> tuple[str, ...]:
    """The words without polite ones: some are left out wherever they stand, some at the beginning
    of a wish; but not all words.
    """
    anywhere = _commas(_without(words, _ANYWHERE[language], opening=False)) or words
    return _commas(_without(anywhere, _OPENING[language], opening=True))


def _without(words: tuple[str, ...], polite: patterns.Part, *, opening: bool) -> tuple[str, ...]:
    sentence, kept, begins = patterns.Sentence(words), list[str](), True
    at = 0
    while at < len(words):
        end = max(sentence.ends(polite, at), default=at) if begins or not opening else at
        if at < end < len(words) + (not opening):
            at = end
            continue
        begins = words[at] == "," or words[at] in _JOINING
        kept.append(words[at])
        at += 1
    return tuple(kept)


def _parts(
    readings: Iterable[tuple[str, ...]], language: str, known: Known, light: bool
) -> Meaning | None:
    """The wishes within the words, in the reading in which they have most of the words; None where
    there are none, and where a word left over may turn them into something else.
    """
    best, most = None, 0.0
    for words in readings:
        covered, clauses, left = _OF[language].parts(words, known, light=light)
        if covered > most and not _TURNING.intersection(left):
            best, most = Meaning(language, clauses[:MOST_WISHES], partly=True), covered
    return best


def _corrected(words: tuple[str, ...], language: str) -> Iterator[tuple[str, ...]]:
    """Yield the words with known ones in place of those that nobody knows, the likeliest first."""
    of = _OF[language]
    choices = [_alike(word, language) if of.unknown(word) else (word,) for word in words]
    found = itertools.islice(itertools.product(*choices), MOST_GUESSES)
    return (one for one in found if one != words)


@lru_cache(maxsize=1024)  # words (estimate)
def _alike(word: str, language: str) -> tuple[str, ...]:
    """The known words that sound like this one, or are written like it; itself where none is."""
    if word in _HEARD[language]:
        return _HEARD[language][word]
    if len(word) < SHORT:
        return (word,)
    slips = 2 if len(word) >= LONG else 1
    near = process.extract(
        word, _LONG[language], scorer=OSA.distance, score_cutoff=slips, limit=MOST_ALIKE
    )
    # a short word with a letter wrong is too often another word: cup, cap
    longer = len(word) + (len(word) <= SHORT)
    fit = (one for one, _, _ in near if len(one) >= longer or sorted(one) == sorted(word))
    return tuple(fit) or (word,)


def _known(words: tuple[str, ...], language: str) -> int:
    """How many of the words are of a language."""
    return sum(word in _OF[language].words or word in _COMMON[language] for word in words)


def _by_form(rows: dict[str, str]) -> dict[str, tuple[str, ...]]:
    """Turn rows of words, each with its other forms, round: the words of each form."""
    found: dict[str, tuple[str, ...]] = {}
    for words, forms in rows.items():
        for form in fold(forms).split("|"):
            found[form] = (*found.get(form, ()), *fold(words).split("|"))
    return found


_POLISH_LETTERS = frozenset("ąćęłńóśźż")
_LONG = {
    one: tuple(sorted(word for word in of.words if len(word) >= SHORT)) for one, of in _OF.items()
}
_COURTESIES = patterns.Patterns({})
_ANYWHERE = {one: _COURTESIES.part(text) for one, text in CATALOGUE.anywhere.items()}
_OPENING = {one: _COURTESIES.part(text) for one, text in CATALOGUE.opening.items()}
_COMMON = {one: frozenset(fold(CATALOGUE.common[one]).split("|")) for one in LANGUAGES}
_TURNING, _DENYING, _ONCE_MORE = (
    frozenset(word for words in rows.values() for word in fold(words).split("|"))
    for rows in (CATALOGUE.turning, CATALOGUE.denying, CATALOGUE.once_more)
)
_HEARD = {one: _by_form(CATALOGUE.heard[one]) for one in LANGUAGES}
_SPELLED = {form: tuple(words[0].split()) for form, words in _by_form(CATALOGUE.spelled).items()}
_JOINING = frozenset(
    one[0] for language in LANGUAGES for one in phrases(CATALOGUE.joining[language])
)
