"""The words that stop the robot, in English and Polish: looked for before any grammar, in whatever
else is said.

stop_words.toml has the rows and their reasons. They err towards stopping: a robot that stood still
for nothing is let go by `roco release`, one that went on is not made good. Must not know: the
robot, HTTP, which tasks there are.

Here is, too, the form of a text's letters in which sentences are compared (fold).
"""

import itertools
import re
import string
import unicodedata
from collections.abc import Iterable, Iterator
from functools import cache, lru_cache
from importlib import resources
from typing import Literal, NamedTuple

import msgspec

APOSTROPHES = "'`´ʹʻʼʽʾˈˊˋ˴\u0374΄՚՝ᑊᛌ᾽᾿\u1fef\u1ffd῾‘’‛′‵ꞌ＇｀𖽑𖽒"
"""Signs that keyboards, printers and speech recognisers write for one, and that look like one (a
test compares).
"""
INVISIBLE = "\u115f\u1160\u3164\uffa0"
"""Letters that show nothing (fillers of Hangul). Others are found by their category: format,
control, mark.
"""
_NAMED = re.compile(
    r"\b(?:LATIN\b.*|REGIONAL INDICATOR SYMBOL) LETTER (?:SMALL CAPITAL )?([A-Z])(?: WITH .*)?$"
)


def fold(text: str) -> str:
    """The text in small letters without accents and invisible characters; a look-alike as the
    letter it shows.

    A letter that looks like l and like i is "1". Never raises.
    """
    return text.translate({ord(sign): _folded(sign) for sign in set(text)})


@lru_cache(maxsize=4096)  # signs; estimate: more than people write with
def _folded(sign: str) -> str:
    form = _once_folded(sign)
    return form if form.isascii() or form == sign else fold(form)


def _once_folded(sign: str) -> str:
    if sign in APOSTROPHES:
        return "'"
    if sign.isspace():
        return " "
    if sign in INVISIBLE or unicodedata.category(sign) in ("Cc", "Cf", "Mn", "Me"):
        return ""
    base = "".join(
        one for one in unicodedata.normalize("NFKD", sign) if not unicodedata.combining(one)
    )
    if base.isascii():
        return base.lower()
    # letters that Unicode does not take apart, such as ł
    if named := _NAMED.search(unicodedata.name(sign, "")):
        return named[1].lower()
    return (_look_alike(sign) if sign.isalnum() else "") or base.casefold()


def _look_alike(sign: str) -> str:
    """The letter or digit of ASCII that a letter of another alphabet looks like; "" where there is
    none.
    """
    # takes 50 ms and 18 MB, which few sentences need
    from confusable_homoglyphs.confusables import confusables_data

    cases = (sign, sign.lower(), sign.upper())
    shapes = (row["c"].lower() for one in cases for row in confusables_data.get(one, ()))
    found = next((shape for shape in shapes if shape.isascii() and shape.isalnum()), "")
    return "1" if found in ("i", "l") else found


LANGUAGES = ("en", "pl")
AT_ONCE_S = 1.0
"""A "no" waits so long for hi to say that it answers a question; then it stops the robot (estimate:
hi takes ms).
"""
MOST_PARTS = 50  # of a sentence between marks (estimate: people say fewer)
LONGEST = 10_000  # characters that are looked through (estimate: hi takes bodies of 4096 bytes)


class Harmless(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A group of rows that do not stop the robot."""

    reason: str
    en: str
    pl: str


class Group(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A group of rows that stop the robot. `where` they count; `helps`: what can be said is shown,
    too.
    """

    reason: str
    en: str
    pl: str
    where: Literal["anywhere", "opening", "alone", "answer"] = "anywhere"
    helps: bool = False


class Time(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Regular expressions of the parts of a span of time."""

    before: str
    number: str
    half: str
    unit: str
    behind: str


class Aside(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a clause beside a wish must have so that its `soft` rows do not stop the robot: rows of
    both languages.
    """

    cuts: str
    unwished: str
    verbs: str
    nouns: str
    stands: str
    bound: str
    denied: str
    first: str
    among: str
    reasons: str
    second: str
    soft: str
    cautions: str
    asking: str
    asked: str
    alarmed: str


class Rows(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole file."""

    fillers: str
    near: str
    beside: str
    not_near: str
    harmless: tuple[Harmless, ...]
    aside: Aside
    time: Time
    stop: tuple[Group, ...]


ROWS = msgspec.toml.decode(
    resources.files(__package__).joinpath("stop_words.toml").read_bytes(), type=Rows
)
_ASIDE = ROWS.aside
_NOT = (
    "do",
    "does",
    "did",
    "is",
    "are",
    "was",
    "were",
    "could",
    "would",
    "should",
    "must",
    "have",
    "has",
    "had",
    "need",
)
_IS = (
    "it",
    "that",
    "there",
    "here",
    "what",
    "who",
    "he",
    "she",
    "somebody",
    "someone",
    "something",
)
_SHORT = (
    {"can't": "can not", "cannot": "can not", "won't": "will not", "ain't": "is not", "i'm": "i am"}
    | {f"{one}n't": f"{one} not" for one in _NOT}
    | {f"{one}'ve": f"{one} have" for one in ("i", "you", "we", "they")}
    | {f"{one}'re": f"{one} are" for one in ("you", "we", "they")}
    | {f"{one}'ll": f"{one} will" for one in ("i", "you", "we", "they", "it", "that", "he", "she")}
    | {f"{one}'s": f"{one} is" for one in _IS}
)
"""Short forms, written with an apostrophe; a blank may stand in its place, or nothing."""
_OTHERWISE = frozenset({"ill", "well", "hell", "shell", "were"})
"""Words of their own that short forms without an apostrophe would be."""


def stop_words(sentence: str, answers: Iterable[str] = ()) -> str:
    """The words of a sentence that stop the robot; "" where it has none, or is one of the answers
    to a question.

    Never raises.
    """
    words = _as_in_rows(sentence)
    if any(words == _as_in_rows(one) for one in answers):
        return ""
    table = _table()
    calm = _with_calm_asides(sentence)
    if calm != sentence:
        sentence, words = calm, _as_in_rows(calm)
    few = len(words) <= 2 or len(set(words) - table.beside) == 1
    near = (word for word in words if few and word in table.near)
    text = f" {' '.join(words)} "
    longer = (row for row in table.longer if row in text)
    rest = _without_harmless(words)
    apart = _apart(sentence, text) if rest != text else ()
    found = (_in(rest), apart, longer, near)
    return next((row.strip() for rows in found for row in rows), "")


def _in(text: str) -> Iterator[str]:
    """The rows in a text without harmless ones."""
    table = _table()
    inner = table.leading.sub(" ", text)
    yield from (row for row in table.anywhere if row in text)
    yield from (row for row in table.opening if inner.startswith(row))
    yield from (row for row in table.alone if row in (text, inner, table.trailing.sub(" ", inner)))


def _apart(sentence: str, whole: str) -> Iterator[str]:
    """The rows where no harmless one reaches over a mark: "Don't! Forget it"; with too many marks
    those of the whole.
    """
    text = fold(sentence[:LONGEST])[:LONGEST]
    parts = _MARK.split(text)
    if len(parts) > MOST_PARTS:
        yield from _in(whole)
        return
    for one in parts if len(parts) > 1 else ():
        without = _without_harmless(_as_in_rows(one))
        yield from (row for row in _table().anywhere if row in without)
    parts = _END.split(text)
    if len(parts) > 1:
        kept = (word for one in parts for word in _without_harmless(_as_in_rows(one)).split())
        yield from _in(f" {' '.join(kept)} ")


def _with_calm_asides(sentence: str) -> str:
    """The sentence without the rows that do not count in an aside, behind a wish or in a question.

    A mark stays where it was, so that no row reaches over it that did not before.
    """
    parts = re.split(f"({_MARK.pattern})", fold(sentence[:LONGEST])[:LONGEST])
    clauses = [list(_clauses(_as_in_rows(one))) for one in parts[::2]]
    named = any(_has(one, _ASIDE.nouns) for row in clauses for one in row)
    wished = named and any(_is_wish(one) for row in clauses for one in row)
    if not wished and not any(_asks(one) for row in clauses for one in row):
        return sentence
    calm, before = list[str](), list[str]()
    for row in clauses:
        kept = list[str]()
        for one in row:
            kept.append(_calm(one, before, wished=wished))
            before = one
        calm.append(" ".join(kept))
    # a comma is a mark only before a blank
    return " ".join(f"{part}{mark}" for part, mark in zip(calm, [*parts[1::2], ""], strict=True))


def _calm(clause: list[str], before: list[str], *, wished: bool) -> str:
    """A clause without the rows that do not count there; `before`: the clause before it."""
    text = f" {' '.join(clause)} "
    if _asks(clause):
        text = _any_of(_ASIDE.asked).sub(" ", text)
    if wished and _is_aside(clause):
        text = _any_of(_ASIDE.soft).sub(" ", text)
    if wished and _is_wish(before):
        text = _any_of(_ASIDE.cautions).sub(" ", text)
    return text.strip()


def _asks(words: list[str]) -> bool:
    """Whether a clause asks what became of a thing, not of a person."""
    asking = _any_of(_ASIDE.asking).match(f" {' '.join(words)} ")
    return asking is not None and not _has(words, _ASIDE.alarmed)


def _clauses(words: list[str]) -> Iterator[list[str]]:
    """The words between marks, cut before words that join clauses and before the verb of a wish."""
    begin = 0
    for at in range(1, len(words)):
        joins = _has((words[at], " ".join(words[at : at + 2])), _ASIDE.cuts)
        if joins or _is_verb(words, at):
            yield words[begin:at]
            begin = at
    yield words[begin:]


def _is_verb(words: list[str], at: int) -> bool:
    """Whether a word can be the verb of a wish: "take", but not "my hand" or "I put"."""
    before = words[at - 1] if at else ""
    told = before == "to" and words[at - 2 : at - 1] == ["you"]  # "I would like you to take"
    return words[at] in _words(_ASIDE.verbs) and (told or before not in _words(_ASIDE.bound))


def _is_wish(words: list[str]) -> bool:
    if _has(words[:1], _ASIDE.unwished) or _has(words, _ASIDE.denied):
        return False
    verb = next((at for at in range(len(words)) if _is_verb(words, at)), len(words))
    return _has(words[verb:], _ASIDE.nouns) or _has(words[verb:], _ASIDE.stands)


def _is_aside(words: list[str]) -> bool:
    if _has(words, _ASIDE.second) or any(map(_SECOND.search, words)):
        return False
    if _any_of(_ASIDE.reasons).match(f" {' '.join(words)} "):
        return True
    begun = list(itertools.dropwhile(_joining().__contains__, words))
    own = _has(begun[:5], _ASIDE.among) or any(map(_FIRST.search, begun))
    return own or _has(begun[:1], _ASIDE.first)


def may_answer(sentence: str) -> bool:
    """Whether a sentence that stops the robot can be the answer to a question; then it stops unless
    one was asked.
    """
    return f" {' '.join(_as_in_rows(sentence))} " in _table().answer


def calls_for_help(sentence: str) -> str:
    """The language in which a sentence calls for help; "" where it does not."""
    text = _without_harmless(_as_in_rows(sentence))
    return next((language for row, language in _table().helps.items() if row in text), "")


def forms(rows: str) -> Iterator[str]:
    """Yield what rows stand for: each choice, and what may be left out with and without it."""
    for row in re.split(r"[,\n]", rows):
        yield from _forms(row) if row.strip() else ()


def _forms(row: str) -> Iterator[str]:
    group = re.search(r"[(\[]([^()\[\]]*)[)\]]", row)
    if group is None:
        yield " ".join(row.split())
        return
    for choice in (*group[1].split("|"), *([""] if group[0].startswith("[") else ())):
        yield from _forms(row[: group.start()] + choice + row[group.end() :])


# --- words ----------------------------------------------------------------------------------------


def _as_in_rows(sentence: str) -> list[str]:
    """The words as rows have them; loose letters, and words with digits, as the word of a row that
    they look like.
    """
    # loose letters are the word that they are, such as h e l p, if they are one
    shapes = _table().shapes
    text = _LOOSE.sub(
        lambda at: shapes.get(_shape(at[0].replace(" ", "")), at[0]), _plain(sentence)
    )
    return [_known(word) for word in _at_length(text).split()]


def _plain(text: str) -> str:
    """The words without case, accents and marks; a letter that is repeated counts once."""
    text = re.sub("[łŁ]+", "ł", text[:LONGEST])  # "ałł" is "ał", a cry; folded it would be "all"
    return _once(" ".join(_WORD.findall(fold(text)[:LONGEST])))


def _once(text: str) -> str:
    """The text with repeated letters once; "off", "too" and "all" stay, unlike "of", "to", "ał"."""
    return re.sub(
        r"\b(o+ff+)\b|\b(t+oo+)\b|\b(a+ll+)\b|([^\W\d])\4+",
        lambda at: at[4] or ("off" if at[1] else "too" if at[2] else "all"),
        text,
    )


def _at_length(text: str) -> str:
    """The words with short forms at length."""
    return _LONG_FORM.sub(lambda short: _LONG[short[0]], text)


def _known(word: str) -> str:
    """The word of a row that a word with digits in it looks like, such as st0p."""
    if word.isalpha() or word.isdecimal():
        return word
    shape = _shape(word)
    fitting = (one for looks, one in _table().stems.items() if shape.startswith(looks))
    stem = max(fitting, key=len, default=word)
    return _table().shapes.get(shape, stem)


def _shape(word: str) -> str:
    """The word with one sign for letters and digits that look alike."""
    return _once(word.translate(_ALIKE))


def _without_harmless(words: list[str]) -> str:
    """The words, each between blanks, without times and harmless rows."""
    text = _table().time.sub("", f" {' '.join(words)} ")
    for row in _table().harmless:
        text = text.replace(row, " ")
    return text


_EMOJI = "".join(sorted({sign for group in ROWS.stop for sign in group.en if not sign.isascii()}))
_WORD = re.compile(rf"[^\W_]+|[{_EMOJI}]")
_END = re.compile(r"[.:]+(?=\s)|[!?;\u2026]+")
_MARK = re.compile(rf"{_END.pattern}|,(?=\s)|\s[-\u2013\u2014]+\s")
_LOOSE = re.compile(r"(?<!\S)\w(?: \w){2,}(?!\S)")
_ALIKE = str.maketrans("01i", "oll")
_LONG = {
    _once(one.replace("'", gap)): _once(long)
    for one, long in _SHORT.items()
    for gap in ("", " ")
    if gap or one.replace("'", "") not in _OTHERWISE
}
# ends of folded Polish verbs of the first person: oparzyłam
_FIRST = re.compile(r"(?:l[ae]m|labym|lbym)$")
# of the second person: ściskasz, but not nasz, wasz
_SECOND = re.compile(r"(?<!^n)(?<!^w)(?:asz|esz|isz|ysz|las|les)$")
_LONG_FORM = re.compile(rf"(?<!\S)(?:{'|'.join(_LONG)})(?!\S)")


# --- the rows as they are looked for --------------------------------------------------------------


class _Table(NamedTuple):
    """Rows with a blank before them, and one behind them where they do not end otherwise.

    `shapes`, `stems`: the words of rows, and those that may end otherwise, by what they look like.
    `near`: slips of stop words, `beside`: what counts for nothing beside one; `longer`: rows with a
    harmless one in them.
    """

    anywhere: tuple[str, ...]
    opening: tuple[str, ...]
    alone: tuple[str, ...]
    answer: frozenset[str]
    helps: dict[str, str]
    harmless: tuple[str, ...]
    shapes: dict[str, str]
    stems: dict[str, str]
    near: frozenset[str]
    beside: frozenset[str]
    longer: tuple[str, ...]
    time: re.Pattern[str]
    leading: re.Pattern[str]
    trailing: re.Pattern[str]


@cache
def _table() -> _Table:
    """The rows, made when they are first needed."""
    at = {where: _rows(*(one for one in ROWS.stop if one.where == where)) for where in _WHERE}
    stops = [row for where in _WHERE for row in at[where]]
    helps = [one for one in ROWS.stop if one.helps]
    fillers = "|".join(
        sorted((row.strip() for row in _bounded(ROWS.fillers)), key=len, reverse=True)
    )
    part = {
        name: _once(fold(getattr(ROWS.time, name).replace("\n", "")))
        for name in Time.__struct_fields__
    }
    half = rf"(?: (?:{part['half']}))?"
    span = rf"(?:(?:{part['number']}|\d+(?: \d+)?){half} )?(?:{part['unit']}){half}"
    time = (
        rf" (?:(?:{part['before']}) {span}(?: (?:{part['behind']}))?|{span}"
        rf" (?:{part['behind']}))(?= )"
    )
    plain = {row.strip() for row in _bounded(ROWS.near)}
    near = {slip for word in plain for slip in _slips(word)}
    beside = {word for row in _bounded(f"{ROWS.fillers}, {ROWS.beside}") for word in row.split()}
    near |= {
        _once(one) for word in plain for of in {*beside, *plain} for one in (word + of, of + word)
    }
    harmless = _rows(*ROWS.harmless)
    return _Table(
        anywhere=at["anywhere"],
        opening=at["opening"],
        alone=(*at["alone"], *at["answer"]),
        answer=frozenset(at["answer"]),
        helps={
            row: language
            for one in helps
            for language in LANGUAGES
            for row in _bounded(getattr(one, language))
        },
        harmless=harmless,
        shapes={_shape(word): word for row in stops for word in row.split()},
        stems={_shape(row.split()[-1]): row.split()[-1] for row in stops if not row.endswith(" ")},
        near=frozenset(near) - {row.strip() for row in _bounded(ROWS.not_near)},
        beside=frozenset(beside),
        longer=tuple(row for row in at["anywhere"] if any(one in row for one in harmless)),
        time=re.compile(time),
        leading=re.compile(rf"^ (?:(?:{fillers}) )+"),
        trailing=re.compile(rf" (?:(?:{fillers}) )+$"),
    )


@cache
def _words(rows: str) -> frozenset[str]:
    """These rows, each as the words that are compared."""
    return frozenset(row.strip() for row in _bounded(rows))


def _has(words: Iterable[str], rows: str) -> bool:
    """Whether one of the words is one of these rows."""
    return not _words(rows).isdisjoint(words)


@cache
def _any_of(rows: str) -> re.Pattern[str]:
    """An expression for any of these rows, the longest first, behind a blank."""
    found = sorted(_bounded(rows), key=len, reverse=True)
    ways = (one[1:-1] if one.endswith(" ") else rf"{one[1:]}\w*" for one in found)
    return re.compile(f" (?:{'|'.join(ways)})(?= )")


@cache
def _joining() -> frozenset[str]:
    """The words that may stand in front of a clause: cuts and fillers."""
    fillers = {word for row in _bounded(ROWS.fillers) for word in row.split()}
    # "i" is "and" and "I"
    return (_words(_ASIDE.cuts) | fillers) - _words(_ASIDE.first)


_WHERE = ("anywhere", "opening", "alone", "answer")


def _rows(*groups: Harmless | Group) -> tuple[str, ...]:
    """What the rows of groups stand for, the longest first."""
    found = {
        row for one in groups for language in LANGUAGES for row in _bounded(getattr(one, language))
    }
    return tuple(sorted(found, key=len, reverse=True))


def _bounded(rows: str) -> Iterator[str]:
    for form in forms(rows):
        yield f" {_at_length(_plain(form))}{'' if form.endswith('*') else ' '}"


def _slips(word: str) -> Iterator[str]:
    """Words with a letter wrong, missing or too much, or two in the other order."""
    for at in range(len(word) + 1):
        yield word[:at] + word[at + 1 :]
        yield word[:at] + word[at + 1 : at + 2] + word[at : at + 1] + word[at + 2 :]
        for letter in string.ascii_lowercase:
            yield word[:at] + letter + word[at:]
            yield word[:at] + letter + word[at + 1 :]
