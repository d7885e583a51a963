"""Sentences: of facts, in the operator's words, and all that a person reads who knows no robots, in English and Polish.

Three catalogues, operator.toml, en.toml and pl.toml, have a row for each general kind of fact; the latter two have the
sentences of hi and the page, too. Rows of a task's own kinds are in its file sentences.toml, in tables with the name of
the catalogue. No program reads a sentence.
"""

import re
from collections.abc import Iterable, Iterator
from enum import StrEnum
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable

import msgspec

from companion import tasks
from companion.languages.evidence import AnyClaim
from companion.languages.facts import Fact, Facts, Kind, fact, with_reasons
from companion.languages.hfsm import Place, Step
from companion.languages.values import Side


class Reader(StrEnum):
    """Who reads the sentences."""

    OPERATOR = "operator"
    ENGLISH = "en"
    POLISH = "pl"


class Unit(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A unit: its size in that of the fact, and its name behind a number of each class that the language has (those of
    Unicode's CLDR), the accusative first, then the genitive; () as `other`, which in Polish is that of fractions.
    """

    size: float
    other: tuple[str, ...]
    one: tuple[str, ...] = ()
    few: tuple[str, ...] = ()
    many: tuple[str, ...] = ()


class Catalogue(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A catalogue. `fact`: a template for each kind; `side`, `thing`: their forms, for one without a number and, in
    English, for one with a number; `unit`: of a number, of a count too; the others: words for the words in facts.
    A process may be named by its agent. `step`: what a part of a plan does, with its things in braces, {a} and {b},
    and its hand, {side}; `leaf`: what an act in it does, by its class. For a person, `hi` and `page`: their sentences;
    `please`: what a person is asked to do during an act, by its class, with the things of its step. For the operator,
    `event`: what happened in a run.
    """

    fact: dict[str, str]
    claim: dict[str, str]
    sensor: dict[str, str]
    fault: dict[str, str]
    part: dict[str, str]
    agent: dict[str, str]
    task: dict[str, str]
    step: dict[str, str]
    leaf: dict[str, str]
    side: dict[Side, tuple[str, ...]]
    thing: dict[str, tuple[str, ...]]
    unit: dict[str, Unit]
    furniture: dict[str, str] = {}
    event: dict[str, str] = {}
    state: dict[str, str] = {}
    please: dict[str, str] = {}
    hi: dict[str, str] = {}
    page: dict[str, str] = {}
    process: dict[str, str] = {}
    joined: dict[str, str] = msgspec.field(name="and", default_factory=dict)


class _Forms(str):
    """A word with its forms: {a} is the first, {a:1} the second one."""

    __slots__ = ("forms",)
    forms: tuple[str, ...]

    def __format__(self, form: str) -> str:
        return self.forms[min(int(form or 0), len(self.forms) - 1)]


@cache
def catalogue(reader: Reader) -> Catalogue:
    """Return the catalogue of a reader, with the rows of the tasks. Raises ValueError if two have the same one."""
    rows = msgspec.toml.decode(resources.files(__package__).joinpath(f"{reader}.toml").read_bytes())
    for name in tasks.NAMES:
        file = resources.files(tasks).joinpath(name, "sentences.toml")
        if file.is_file():
            for table, more in msgspec.toml.decode(file.read_bytes()).get(reader, {}).items():
                rows[table] = _joined(rows.get(table, {}), more, file)
    return msgspec.convert(rows, Catalogue)


def _joined(rows: dict[str, object], more: dict[str, object], file: Traversable) -> dict[str, object]:
    if twice := sorted(set(rows) & set(more)):
        raise ValueError(f"{file}: another catalogue has {', '.join(twice)} already")
    return rows | more


def operator(facts: Iterable[Fact]) -> str:
    """Return facts in the operator's words, with semicolons between them; "" for none."""
    return "; ".join(dict.fromkeys(_with_reasons(one) for one in facts))


def person(facts: Iterable[Fact], language: str) -> str:
    """Return facts as sentences for a person, in "en" or "pl"; "" for none."""
    return " ".join(dict.fromkeys(_sentences(facts, Reader(language))))


def failure(why: Facts, language: str) -> str:
    """Return the sentences for a person of why a task failed; where none asks for anything, the last asks for help."""
    asks = any(one.kind.asks for one in with_reasons(why))
    return person(why if asks or not why else (*why, fact(Kind.PERSON_NEEDED)), language)


def claimed(claim: AnyClaim, of: str) -> str:
    """Return a claim about a thing in the operator's words."""
    return catalogue(Reader.OPERATOR).claim[claim].format(a=_thing(of, Reader.OPERATOR))


def state(name: str, language: str) -> str:
    """Return the state of a task for a person, in "en" or "pl"; one that is not known as it is."""
    return catalogue(Reader(language)).state.get(name, name)


def step(one: Step, reader: Reader) -> str:
    """Return a step of a plan in words; one that this version does not know by its names."""
    things = [_thing(name, reader) for name in one.things]
    side = _forms(catalogue(reader).side[one.side] if one.side else ("",) * 5)
    says = catalogue(reader).step.get(one.does)
    if says is None:
        return " ".join(map(str, filter(None, (one.does.replace("-", " "), *things, side))))
    return says.format(side=side, **dict(zip("ab", (*things, *(_forms(("",) * 5),) * 2), strict=False)))


def place(at: Place, reader: Reader) -> str:
    """Return where a plan is in words: its step, and what is done in it; "" where it is in no step."""
    act = catalogue(reader).leaf.get(at.act) or _HUMP.sub(" ", at.act).lower()
    if at.step is None:
        return act
    return f"{step(at.step, reader)}{f' ({act})' if act else ''}"


def please(at: Place, reader: Reader) -> str:
    """Return what a person is asked to do where a plan is; "" for nothing."""
    says = catalogue(reader).please.get(at.act, "")
    things = [_thing(name, reader) for name in at.step.things] if at.step is not None else []
    return says.format(**dict(zip("ab", (*things, *(_forms(("",) * 5),) * 2), strict=False)))


def happened(name: str, of: tuple[str, ...]) -> str:
    """Return an event of a run in the operator's words; one that is in no list by its names."""
    words = [thing(one, Reader.OPERATOR) if _ID.fullmatch(one) else _HUMP.sub(" ", one) for one in of]
    says = catalogue(Reader.OPERATOR).event.get(name, name.replace("-", " "))
    used = sum(f"{{{number}}}" in says for number in range(len(words)))
    rest = " ".join(words[used:])
    return f"{says.format(*words, *('',) * 2)}{f': {rest.lower()}' if rest else ''}"


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
    for one in facts:
        said = catalogue(reader).fact[one.kind].format(**_parts(one, reader))
        if said:
            yield said[:1].upper() + said[1:]
        yield from _sentences(one.because, reader)


def _parts(fact: Fact, reader: Reader) -> dict[str, object]:
    """Return the parts of a fact in words, by their names in the kind."""
    rows, found = catalogue(reader), dict[str, object]()
    things, numbers, words = iter(fact.things), iter(fact.numbers), iter(fact.words)
    for part in fact.kind.parts:
        name, _, of = part.partition(":")
        if name == "things":
            found[name] = _listed([_thing(one, reader) for one in things], rows)
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


def _listed(words: list[_Forms], rows: Catalogue) -> _Forms:
    """Return a list of things in all forms that each of them has."""
    forms = zip(*(word.forms for word in words), strict=False)
    return _forms(tuple(_joint(form, rows) for form in forms) or ("",))


def _joint(words: tuple[str, ...], rows: Catalogue) -> str:
    *first, last = words
    return f"{rows.joined['many'].join(first)}{rows.joined['two']}{last}" if first else last


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
    """Return a number with its unit, to three digits, for a person to two; some counts have none."""
    units, digits = catalogue(reader).unit, 3 if reader is Reader.OPERATOR else 2
    if unit not in units:
        return _plain(value, 0)
    if unit == "s" and value >= 120.0 and reader is not Reader.OPERATOR:
        unit, value = "min", float(f"{value / 60.0:.0f}")
    row = units[unit]
    text = _plain(float(f"{value * row.size:.{digits}g}"), 6)
    names = getattr(row, _plural(text, reader)) or row.other
    text = text.replace(".", ",") if reader is Reader.POLISH else text
    return _forms(tuple(f"{text} {name}" for name in names))


def _plural(text: str, reader: Reader) -> str:
    """Return the class of a number for the forms of nouns behind it: one, few, many or other (Unicode's CLDR)."""
    if text == "1":
        return "one"
    if reader is not Reader.POLISH or not text.lstrip("-").isdecimal():
        return "other"
    few = text[-1] in "234" and text[-2:-1] != "1"
    return "few" if few else "many"


def _plain(value: float, decimals: int) -> str:
    """Return a number without an exponent, without zeros at its end, and without the sign of a zero."""
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text == "-0" else text
