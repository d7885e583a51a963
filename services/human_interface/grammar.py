"""From the words of a sentence to its meaning, by the catalogue: an Earley parser over words.

A sentence has at most MOST_CHARACTERS, MOST_WORDS and MOST_WISHES, so that the time of a parse is
bounded; it is for the thread that listens to people, never of the agent's step. Must not know:
HTTP, tasks, what was said before.
"""

import difflib
import re
import threading
from collections.abc import Iterator
from functools import cache, lru_cache
from typing import Any

from lark import Lark, Token, Tree
from lark.exceptions import LarkError
from lark.lexer import Lexer
from msgspec.structs import replace

from companion.stop_words import fold
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
_PART = re.compile(r"[()|\[\]]|[^\W\d]+")


class _Groups:
    """Patterns of a language as lark writes them; each choice is a rule of its own, which keeps the
    grammar small.
    """

    def __init__(self, language: str) -> None:
        self._language = language
        self._names: dict[str, str] = {}

    def pattern(self, text: str) -> str:
        """Return a pattern of the catalogue."""
        parts = [[""]]
        for part in _PART.findall(text):
            if part in "([":
                parts.append([""])
            elif part in ")]":
                group = " | ".join(parts.pop())
                parts[-1][-1] += f" {self._named(group)}{'?' if part == ']' else ''}"
            elif part == "|":
                parts[-1].append("")
            else:
                parts[-1][-1] += f" {_symbol(part, self._language)}"
        (whole,) = parts
        return " | ".join(whole)

    def _named(self, group: str) -> str:
        return self._names.setdefault(group, f"group_{self._language}_{len(self._names)}")

    def rules(self) -> Iterator[str]:
        """The rules of the choices."""
        return (f"{name}: {group}" for group, name in self._names.items())


def _symbol(part: str, language: str) -> str:
    if part in "()[]|" or part == "TASK":
        return part
    return f"{part.lower()}_{language}" if part.isupper() else _terminal(fold(part))


def _terminal(word: str) -> str:
    return f"T_{word.upper()}"


def _alternatives(text: str) -> str:
    return " | ".join(" ".join(map(_terminal, words)) for words in phrases(text))


def _rules(language: str) -> Iterator[str]:
    """The rules of a language."""
    groups = _Groups(language)
    wishes = {f"wish_{language}_{at}": getattr(row, language) for at, row in enumerate(WISHES)}
    lacking = {
        f"lack_{language}_{at}": row.lacking[language]
        for at, row in enumerate(WISHES)
        if row.lacking
    }
    for wish, texts in (wishes | lacking).items():
        patterns = {f"form_{wish}_{n}": one for n, one in enumerate(texts)}
        yield f"{wish}: {' | '.join(patterns)}"
        yield from (f"{name}: {groups.pattern(one)}" for name, one in patterns.items())
    yield f"clause_{language}: {' | '.join(wishes | lacking)}"
    yield f"joining_{language}: {_alternatives(CATALOGUE.joining[language])}"
    yield f"sep_{language}: COMMA | COMMA? joining_{language} COMMA?"
    # one more than are taken is told, further ones cost time alone
    more = f"(sep_{language} clause_{language})"
    yield f"all_{language}: clause_{language} {more}~0..{MOST_WISHES}"
    for name, text in RULES[language].items():
        yield f"{name.lower()}_{language}: {groups.pattern(text)}"
    for side, words in CATALOGUE.side.items():
        yield f"{side}_{language}: {_alternatives(words[language])}"
    yield f"side_{language}: {' | '.join(f'{side}_{language}' for side in CATALOGUE.side)}"
    for thing in CATALOGUE.thing:
        yield f"n_{thing.name}_{language}: {_alternatives('|'.join(getattr(thing, language)))}"
    yield (
        f"noun_{language}: {' | '.join(f'n_{thing.name}_{language}' for thing in CATALOGUE.thing)}"
    )
    this = f"det_{language}? quality_{language}*"
    yield f"named_{language}: {this} noun_{language} NUMBER? place_{language}?"
    yield f"strange_{language}: WORD WORD? WORD?"
    yield f"unknown_{language}: {this} strange_{language} place_{language}?"
    ref = " | ".join(f"{one}_{language} noun_{language}?" for one in ("it", "other", "both"))
    yield f"thing_{language}: named_{language} | {ref} | unknown_{language}"
    yield from groups.rules()


def _text(language: str) -> str:
    rules = list(_rules(language))
    words = sorted({word for rule in rules for word in re.findall(r"T_[A-Z]+", rule)})
    return "\n".join(
        (f"start: all_{language}", *rules, f"%declare WORD NUMBER COMMA TASK {' '.join(words)}")
    )


class _WordLexer(Lexer):
    """The words of a list as terminals: each word of the catalogue has its own."""

    def __init__(self, conf: Any) -> None:
        self._known = {terminal.name for terminal in conf.terminals}

    def lex(self, words: Any) -> Iterator[Token]:  # type: ignore[override]
        """Yield a token for each word."""
        for word in words:
            yield Token(kind_of(word), word)


def kind_of(word: str) -> str:
    """Return the terminal of a word."""
    if word == ",":
        return "COMMA"
    if _TASK.fullmatch(word):
        return "TASK"
    if word.isdecimal():
        return "NUMBER"
    return _terminal(word) if word in VOCABULARY else "WORD"


_TEXTS = {language: _text(language) for language in LANGUAGES}
_WORDS_OF = {
    language: frozenset(word.lower() for word in re.findall(r"T_([A-Z]+)", text))
    for language, text in _TEXTS.items()
}
VOCABULARY = frozenset[str]().union(*_WORDS_OF.values())


_MAKING = threading.Lock()  # a sentence waits for a parser that another thread makes


def _parser(language: str) -> Lark:
    """Return the parser of a language; it is made when it is first needed."""
    with _MAKING:
        return _made(language)


@cache
def _made(language: str) -> Lark:
    return Lark(_TEXTS[language], parser="earley", lexer=_WordLexer, maybe_placeholders=False)


def prepare() -> None:
    """Make all parsers, which takes some tenths of a second, so that no sentence need wait for
    them.
    """
    for language in LANGUAGES:
        _parser(language)


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
    strange = next((word for word in words if kind_of(word) == "WORD"), "")
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
    if sum(kind_of(word) == "WORD" for word in words) > MOST_STRANGE:
        return None
    ours = VOCABULARY.intersection(words)
    possible = (language for language in LANGUAGES if ours <= _WORDS_OF[language])
    parsed = (_parsed_in(language, words) for language in possible)
    return next((found for found in parsed if found is not None), None)


# estimate; what is said is often said again, and a parse takes 17 to 41 ms (measured)
@lru_cache(maxsize=256)
def _parsed_in(language: str, words: tuple[str, ...]) -> Meaning | None:
    try:
        tree = _parser(language).parse(words)
    except LarkError:
        return None
    whole: Any = tree.children[0]
    clauses = tuple(_clause(one) for one in whole.children if one.data == f"clause_{language}")
    if len(clauses) > MOST_WISHES:
        return Meaning(language, why="many")
    return Meaning(language, clauses)


def _clause(tree: Tree[Token]) -> Clause:
    wish: Any = tree.children[0]
    row = WISHES[int(str(wish.data).rpartition("_")[2])]
    things, side, task = [], "", ""
    for part in _parts(wish):
        if isinstance(part, Token):
            task = str(part) if part.type == "TASK" else task
        elif part.data.startswith("thing_"):
            things.append(_named_object(part))
        elif part.data.startswith("side_"):
            side = str(part.children[0].data).partition("_")[0]
    return Clause(row.does, tuple(things), side, task, lacks=wish.data.startswith("lack_"))


def _parts(tree: Any) -> Iterator[Any]:
    """Things, sides and words below a tree, in order."""
    for child in tree.children:
        if isinstance(child, Token) or child.data.startswith(("thing_", "side_")):
            yield child
        else:
            yield from _parts(child)


def _named_object(tree: Any) -> NamedObject:
    said = " ".join(str(token) for token in tree.scan_values(lambda _: True))
    first = tree.children[0]
    ref = str(first.data).rpartition("_")[0]
    if ref in ("it", "other", "both"):
        kinds = _kinds(tree.children[1]) if len(tree.children) > 1 else ()
        return NamedObject(said, kinds, ref=ref)
    parts = [one for one in first.children if not isinstance(one, Token)]
    quality = " ".join(_spoken(one) for one in parts if one.data[:-3] in ("quality", "place"))
    number = next((int(one[:3]) for one in first.children if isinstance(one, Token)), 0)
    noun = next((one for one in parts if one.data.startswith("noun_")), None)
    if noun is None:
        strange = next(_spoken(one) for one in parts if one.data.startswith("strange_"))
        return NamedObject(strange, quality=quality)
    return NamedObject(said, _kinds(noun), number, quality)


def _kinds(noun: Any) -> tuple[str, ...]:
    name = str(noun.children[0].data)[2:-3]
    return next(thing.covers or (name,) for thing in CATALOGUE.thing if thing.name == name)


def _spoken(tree: Any) -> str:
    return " ".join(str(token) for token in tree.scan_values(lambda _: True))


def _corrected(words: tuple[str, ...]) -> tuple[str, ...]:
    """The words, those that nobody knows replaced by known ones that are written alike, where they
    are few.
    """
    if sum(kind_of(word) == "WORD" for word in words) > MOST_STRANGE:
        return words
    unknown = {word for word in words if kind_of(word) == "WORD" and len(word) >= SHORT}
    return tuple(_near(word) if word in unknown else word for word in words)


def _near(word: str) -> str:
    found = difflib.get_close_matches(word, _LONG, n=1, cutoff=NEAR)
    return found[0] if found else word


def _language(words: tuple[str, ...]) -> str:
    """The language that most of the words are of; English if in doubt."""
    counts = {one: sum(word in _WORDS_OF[one] for word in words) for one in LANGUAGES}
    return max(LANGUAGES, key=lambda one: counts[one])


_LONG = tuple(sorted(word for word in VOCABULARY if len(word) >= SHORT))
_ANYWHERE = tuple(one for language in LANGUAGES for one in phrases(CATALOGUE.anywhere[language]))
_OPENING = tuple(
    sorted((one for x in LANGUAGES for one in phrases(CATALOGUE.opening[x])), key=len, reverse=True)
)
_JOINING = frozenset(
    one[0] for language in LANGUAGES for one in phrases(CATALOGUE.joining[language])
)
