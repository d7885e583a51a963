"""Sentences of facts: in the operator's words, and in English and Polish for a person who knows no robots.

Three catalogues, operator.toml, en.toml and pl.toml, have a row for each kind of fact. No program reads a sentence.
"""

import re
from collections.abc import Iterable, Iterator
from enum import StrEnum
from functools import cache
from importlib import resources

import msgspec

from companion.languages.evidence import Claim
from companion.languages.facts import Fact
from companion.languages.values import Side


class Reader(StrEnum):
    """Who reads the sentences."""

    OPERATOR = "operator"
    ENGLISH = "en"
    POLISH = "pl"


class Catalogue(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A catalogue. `fact`: a template for each kind; `side`, `thing`: their forms, for one without a number and, in
    English, for one with a number; `unit`: its name and its size in it; the others: words for the words in facts.
    A process may be named by its agent.
    """

    fact: dict[str, str]
    claim: dict[str, str]
    sensor: dict[str, str]
    fault: dict[str, str]
    part: dict[str, str]
    agent: dict[str, str]
    task: dict[str, str]
    side: dict[Side, tuple[str, ...]]
    thing: dict[str, tuple[str, ...]]
    unit: dict[str, tuple[str, float]]
    furniture: dict[str, str] = {}
    state: dict[str, str] = {}
    process: dict[str, str] = {}
    joined: dict[str, str] = msgspec.field(name="and", default_factory=dict)


class _Forms(str):
    """A word with its forms: {a} is the first, {a:1} the second one."""

    __slots__ = ("forms",)
    forms: tuple[str, ...]

    def __format__(self, form: str) -> str:
        return self.forms[int(form or 0)]


@cache
def catalogue(reader: Reader) -> Catalogue:
    """Return the catalogue of a reader."""
    file = resources.files(__package__).joinpath(f"{reader}.toml")
    return msgspec.toml.decode(file.read_bytes(), type=Catalogue)


def operator(facts: Iterable[Fact]) -> str:
    """Return facts in the operator's words, with semicolons between them; "" for none."""
    return "; ".join(dict.fromkeys(_with_reasons(one) for one in facts))


def person(facts: Iterable[Fact], language: str) -> str:
    """Return facts as sentences for a person, in "en" or "pl"; "" for none."""
    return " ".join(dict.fromkeys(_sentences(facts, Reader(language))))


def claimed(claim: Claim, of: str) -> str:
    """Return a claim about a thing in the operator's words."""
    return catalogue(Reader.OPERATOR).claim[claim].format(a=_thing(of, Reader.OPERATOR))


def state(name: str, language: str) -> str:
    """Return the state of a task for a person, in "en" or "pl"; one that is not known as it is."""
    return catalogue(Reader(language)).state.get(name, name)


def thing(name: str, reader: Reader) -> str:
    """Return what a thing is called: jar_1 is the jar, table_2 is table 2."""
    return format(_thing(name, reader))


def _with_reasons(fact: Fact) -> str:
    template, because = catalogue(Reader.OPERATOR).fact[fact.kind], operator(fact.because)
    said = _GAP.sub("", template.format(because=because, **_parts(fact, Reader.OPERATOR)))
    if "{because}" in template or not because:
        return said.strip("; ")
    return f"{said}: {because}"


def _sentences(facts: Iterable[Fact], reader: Reader) -> Iterator[str]:
    for fact in facts:
        said = catalogue(reader).fact[fact.kind].format(**_parts(fact, reader))
        if said:
            yield said[:1].upper() + said[1:]
        yield from _sentences(fact.because, reader)


def _parts(fact: Fact, reader: Reader) -> dict[str, object]:
    """Return the parts of a fact in words, by their names in the kind."""
    rows, found = catalogue(reader), dict[str, object]()
    things, numbers, words = iter(fact.things), iter(fact.numbers), iter(fact.words)
    for part in fact.kind.parts:
        name, _, of = part.partition(":")
        if name == "things":
            found[name] = _listed([thing(one, reader) for one in things], rows)
        elif name == "side":
            found[name] = _forms(rows.side[fact.side] if fact.side else ("",) * 5)
        elif name in ("a", "b"):
            found[name] = _thing(next(things, ""), reader)
        elif name in ("x", "y"):
            found[name] = _number(next(numbers, 0.0), of, reader)
        elif name in ("w", "v"):
            found[name] = _word(next(words, ""), of, reader)
    if "a" not in found:
        found["a"] = ""
    for name in ("w", "v"):  # a claim names its thing, a fault its number
        if name in found:
            found[name] = str(found[name]).format(**found)
    return found


def _listed(words: list[str], rows: Catalogue) -> str:
    if len(words) < 2:
        return "".join(words)
    return f"{rows.joined['many'].join(words[:-1])}{rows.joined['two']}{words[-1]}"


def _word(word: str, of: str, reader: Reader) -> str:
    """Return a word of a list in words, which may name parts of the fact; one that is in no list as it is read."""
    rows = catalogue(reader)
    for known in (getattr(rows, of, {}), rows.process, rows.agent):
        if word in known:
            return str(known[word])
    plain = str(_thing(word, reader)) if _ID.fullmatch(word) else _HUMP.sub(" ", word.replace("_", " ")).lower()
    return plain.replace("{", "{{").replace("}", "}}")


_ID = re.compile(r"[a-z]+_\d+")
_HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])")
_GAP = re.compile(r" +(?=[;,:)]|$)")
"""Where a part is empty."""


def _thing(name: str, reader: Reader) -> _Forms:
    kind, _, number = name.partition("_")
    forms = catalogue(reader).thing.get(kind, (kind,) * 5)
    if number in ("", "1"):
        return _forms(forms)
    if reader is Reader.ENGLISH:
        forms = forms[1:] or forms
    return _forms(tuple(f"{form} {number}" for form in forms))


def _forms(forms: tuple[str, ...]) -> _Forms:
    word = _Forms(forms[0])
    word.forms = forms
    return word


def _number(value: float, unit: str, reader: Reader) -> str:
    """Return a number with its unit, to three digits, for a person to two; a count has no unit."""
    units, digits = catalogue(reader).unit, 3 if reader is Reader.OPERATOR else 2
    if unit not in units:
        return _plain(value, 0)
    if unit == "s" and value >= 120.0 and reader is not Reader.OPERATOR:
        unit, value = "min", float(f"{value / 60.0:.0f}")
    name, size = units[unit]
    text = _plain(float(f"{value * size:.{digits}g}"), 6)
    return f"{text.replace('.', ',') if reader is Reader.POLISH else text} {name}"


def _plain(value: float, decimals: int) -> str:
    """Return a number without an exponent, without zeros at its end, and without the sign of a zero."""
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text == "-0" else text
