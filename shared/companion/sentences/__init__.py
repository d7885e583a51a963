"""Sentences: of facts, in the operator's words, and all that a person reads who knows no robots, in
English and Polish.

Three catalogues, operator.toml, en.toml and pl.toml, have a row for each general kind of fact; the
latter two have the sentences of hi and the page, too. Rows of a task's own kinds are in its file
sentences.toml, in tables with the name of the catalogue. No program reads a sentence.
"""

import math
import re
from collections.abc import Iterable, Iterator
from enum import StrEnum
from functools import cache
from importlib import resources

import msgspec

from companion import tasks
from companion.languages import cmd, hfsm, sw
from companion.languages.evidence import AnyClaim, Evidence
from companion.languages.facts import Fact, Facts, Kind, fact, with_reasons
from companion.languages.hfsm import Place, Step
from companion.languages.values import Side
from fipa_codec.languages import Reason


class Reader(StrEnum):
    """Who reads the sentences."""

    OPERATOR = "operator"
    ENGLISH = "en"
    POLISH = "pl"


class Unit(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A unit: its size in that of the fact, and its name behind a number of each class that the
    language has (those of Unicode's CLDR), the accusative first, then the genitive; () as `other`,
    which in Polish is that of fractions.
    """

    size: float
    other: tuple[str, ...]
    one: tuple[str, ...] = ()
    few: tuple[str, ...] = ()
    many: tuple[str, ...] = ()


class Catalogue(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A catalogue. `fact`: a template for each kind; `side`, `thing`: their forms, for one without
    a number and, in English, for one with a number; `unit`: of a number, of a count too; the
    others: words for the words in facts. A process may be named by its agent. `step`: what a part
    of a plan does, with its things in braces, {a} and {b}, and its hand, {side}; `leaf`: what an
    act in it does, by its class. For a person, `hi` and `page`: their sentences; `please`: what a
    person is asked to do during an act, by its class, with the things of its step; `place`: how
    something is put on or into a thing of a kind, {a}. For the operator, `event`: what happened in
    a run.
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
    place: dict[str, str] = {}
    event: dict[str, str] = {}
    state: dict[str, str] = {}
    please: dict[str, str] = {}
    hi: dict[str, str] = {}
    page: dict[str, str] = {}
    process: dict[str, str] = {}
    joined: dict[str, str] = msgspec.field(name="and", default_factory=dict)


_ID = re.compile(r"\b([a-z]+)_(\d+)\b")
_HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])")
_GAP = re.compile(r" +(?=[;,:.)]|$)")
"""Where a part is empty."""


class _Forms(str):
    """A word with its forms: {a} is the first, {a:1} the second one."""

    __slots__ = ("forms",)
    forms: tuple[str, ...]

    def __format__(self, form: str) -> str:
        return self.forms[min(int(form or 0), len(self.forms) - 1)]


@cache
def catalogue(reader: Reader) -> Catalogue:
    """The catalogue of a reader, with the rows of the tasks. Raises ValueError if two have the same
    one.
    """
    rows = msgspec.toml.decode(resources.files(__package__).joinpath(f"{reader}.toml").read_bytes())
    for name in tasks.NAMES:
        file = resources.files(tasks).joinpath(name, "sentences.toml")
        if file.is_file():
            for table, more in msgspec.toml.decode(file.read_bytes()).get(reader, {}).items():
                known = rows.setdefault(table, {})
                if twice := sorted(set(known) & set(more)):
                    raise ValueError(f"{file}: another catalogue has {', '.join(twice)} already")
                known |= more
    return msgspec.convert(rows, Catalogue)


def operator(facts: Iterable[Fact]) -> str:
    """Facts in the operator's words, with semicolons between them; "" for none."""
    found: dict[str, None] = {}  # each sentence once, in order
    for one in facts:
        template, because = catalogue(Reader.OPERATOR).fact[one.kind], operator(one.because)
        sentence = _GAP.sub("", template.format(because=because, **_parts(one, Reader.OPERATOR)))
        if "{because}" in template or not because:
            found[sentence.strip("; ")] = None
        else:
            found[f"{sentence}: {because}"] = None
    return "; ".join(found)


def person(facts: Iterable[Fact], language: str) -> str:
    """Facts as sentences for a person, in "en" or "pl"; "" for none."""
    return " ".join(dict.fromkeys(_sentences(facts, Reader(language))))


def failure(why: Facts, language: str) -> str:
    """The sentences for a person of why a task failed; where none asks for anything, the last asks
    for help.
    """
    asks = any(one.kind.asks for one in with_reasons(why))
    return person(why if asks or not why else (*why, fact(Kind.PERSON_NEEDED)), language)


def claimed(claim: AnyClaim, of: str) -> str:
    """A claim about a thing in the operator's words."""
    return catalogue(Reader.OPERATOR).claim[claim].format(a=_object_forms(of, Reader.OPERATOR))


def state(name: str, language: str) -> str:
    """The state of a task for a person, in "en" or "pl"; one that is not known as it is."""
    return catalogue(Reader(language)).state.get(name, name)


def step(one: Step, reader: Reader) -> str:
    """A step of a plan in words; one that this version does not know by its names."""
    things = [_object_forms(name, reader) for name in one.things]
    side = _forms(catalogue(reader).side[one.side] if one.side else ("",) * 5)
    says = catalogue(reader).step.get(one.does)
    if says is None:
        return " ".join(map(str, filter(None, (one.does.replace("-", " "), *things, side))))
    return says.format(side=side, **_blanks(things))


def place(at: Place, reader: Reader) -> str:
    """Where a plan is in words: its step, and what is done in it; "" where it is in no step."""
    act = catalogue(reader).leaf.get(at.act) or spaced(at.act)
    if at.step is None:
        return act
    return f"{step(at.step, reader)}{f' ({act})' if act else ''}"


def please(at: Place, reader: Reader) -> str:
    """What a person is asked to do where a plan is; "" for nothing."""
    says = catalogue(reader).please.get(at.act, "")
    things = at.step.things if at.step is not None else ()
    return says.format(**_blanks([_object_forms(name, reader) for name in things]))


def _blanks(things: list[_Forms]) -> dict[str, _Forms]:
    """The things of a step by their names in a sentence; empty where there are none."""
    return dict(zip("ab", (*things, *(_forms(("",) * 5),) * 2), strict=False))


def happened(name: str, of: tuple[str, ...]) -> str:
    """An event of a run in the operator's words; one that is in no list by its names."""
    words = [
        object_text(one, Reader.OPERATOR) if _ID.fullmatch(one) else _HUMP.sub(" ", one)
        for one in of
    ]
    says = catalogue(Reader.OPERATOR).event.get(name, name.replace("-", " "))
    used = sum(f"{{{number}}}" in says for number in range(len(words)))
    rest = " ".join(words[used:])
    return f"{says.format(*words, *('',) * 2)}{f': {rest.lower()}' if rest else ''}"


def noun(name: str, reader: Reader) -> str:
    """The noun of a thing in all forms, with its number: jar is jar, jar_1 is jar 1."""
    kind, _, number = name.partition("_")
    forms = catalogue(reader).thing.get(kind, (kind,))
    if reader is Reader.ENGLISH:
        forms = forms[1:] or forms  # those without an article
    return _forms(tuple(f"{form} {number}".rstrip() for form in forms))


def hand(side: str, reader: Reader) -> str:
    """The word for a hand in all forms; "" for none."""
    return _forms(catalogue(reader).side[Side(side)] if side else ("",))


def where(name: str, reader: Reader) -> str:
    """Where something is put: on the table, into the cabinet."""
    says = catalogue(reader).place.get(name.partition("_")[0], "{a}")
    return says.format(a=noun(name, reader))


def object_text(name: str, reader: Reader) -> str:
    """What a thing is called: jar_1 is the jar, table_2 is table 2."""
    return format(_object_forms(name, reader))


def _sentences(facts: Iterable[Fact], reader: Reader) -> Iterator[str]:
    for one in facts:
        sentence = catalogue(reader).fact[one.kind].format(**_parts(one, reader))
        sentence = _GAP.sub("", sentence)
        if sentence:
            yield sentence[:1].upper() + sentence[1:]
        yield from _sentences(one.because, reader)


def _parts(fact: Fact, reader: Reader) -> dict[str, object]:
    """The parts of a fact in words, by their names in the kind."""
    rows, found = catalogue(reader), dict[str, object]()
    things, numbers, words = iter(fact.things), iter(fact.numbers), iter(fact.words)
    for part in fact.kind.parts:
        name, _, of = part.partition(":")
        if name == "things":
            found[name] = _listed([_object_forms(one, reader) for one in things], rows)
        elif name == "side":
            found[name] = _forms(rows.side[fact.side] if fact.side else ("",) * 5)
        elif name in ("a", "b"):
            found[name] = _object_forms(next(things, ""), reader)
        elif name in ("x", "y"):
            found[name] = amount(next(numbers, 0.0), of, reader)
        elif name in ("w", "v"):
            found[name] = _listed_text(next(words, ""), of, reader)
    if "a" not in found:
        found["a"] = ""
    for name in ("w", "v"):  # a claim names its thing, a fault its number
        if name in found:
            found[name] = str(found[name]).format(**found)
    return found


def _listed(words: list[_Forms], rows: Catalogue) -> _Forms:
    """A list of things in all forms that each of them has."""
    forms = zip(*(word.forms for word in words), strict=False)
    return _forms(tuple(_joint(form, rows) for form in forms) or ("",))


def _joint(words: tuple[str, ...], rows: Catalogue) -> str:
    *first, last = words
    return f"{rows.joined['many'].join(first)}{rows.joined['two']}{last}" if first else last


def _listed_text(word: str, of: str, reader: Reader) -> str:
    """A word of a list in words, which may name parts of the fact; one that is in no list as it is
    read.
    """
    rows = catalogue(reader)
    for known in (getattr(rows, of, {}), rows.process, rows.agent):
        if word in known:
            return str(known[word])
    plain = (
        str(_object_forms(word, reader)) if _ID.fullmatch(word) else spaced(word.replace("_", " "))
    )
    return plain.replace("{", "{{").replace("}", "}}")


def _object_forms(name: str, reader: Reader) -> _Forms:
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


def amount(value: float, unit: str, reader: Reader) -> str:
    """A number with its unit, to three digits, for a person to two; some counts have none."""
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


def span(seconds: float, language: str) -> str:
    """A length of time [s] as a person says it: to ten seconds, from two minutes on to a minute."""
    return amount(max(10.0, 10.0 * round(seconds / 10.0)), "s", Reader(language))


def _plural(text: str, reader: Reader) -> str:
    """The class of a number for the forms of nouns behind it: one, few, many or other (Unicode's
    CLDR).
    """
    if text == "1":
        return "one"
    if reader is not Reader.POLISH or not text.lstrip("-").isdecimal():
        return "other"
    few = text[-1] in "234" and text[-2:-1] != "1"
    return "few" if few else "many"


def _plain(value: float, decimals: int) -> str:
    """A number without an exponent, without zeros at its end, and without the sign of a zero."""
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text == "-0" else text


# --- Ids, names and contents in the operator's words: on a terminal, in a report. No agent decides
# by them


_TELLING = ("name", "object", "relation", "subject", "source", "destination", "side", "state")


def plain(text: str) -> str:
    """A text with its ids as people say them: jar_1 is the jar, table_2 is table 2."""
    return _ID.sub(lambda found: found[1] if found[2] == "1" else f"{found[1]} {found[2]}", text)


def spaced(name: str) -> str:
    """A name of a class in words: SeenObject is a seen object."""
    return _HUMP.sub(" ", name).lower()


def about(content: object) -> str:
    """A content in a few words: what it is and what it is about; of a report only the latter."""
    if content is None or isinstance(content, Reason):
        return ""
    if isinstance(content, cmd.TaskReport | sw.Report):
        return " ".join(filter(None, (content.state, at(content.at))))
    told = [
        one for name in _TELLING if (one := getattr(content, name, "")) and isinstance(one, str)
    ]
    return plain(" ".join((spaced(type(content).__name__), *told)))


def at(leaf: Place | None) -> str:
    """Where a plan is; "" for nowhere."""
    return "" if leaf is None else place(leaf, Reader.OPERATOR)


def does(state: hfsm.State) -> str:
    """What a state of a plan does; of its end the outcome."""
    if (whole := hfsm.step_of(state)) is not None:
        return step(whole, Reader.OPERATOR)
    match state:
        case hfsm.ActState(command=command):
            return at(Place((), act=type(command).__name__))
        case hfsm.EndState(outcome=outcome):
            return outcome
    return plain(state.name)


def why(content: object) -> str:
    """The reason that a content gives; "" for none."""
    return content.text if isinstance(content, Reason) else operator(getattr(content, "why", ()))


def evidence(one: Evidence) -> str:
    """What is true, and which senses told; or that it was not checked."""
    words = claimed(one.claim, one.of)
    if not one.by:
        return f"not checked: whether {words}"
    near = f", to {math.ceil(one.within * 1000)} mm" if one.within else ""
    return f"{words}, by {' and '.join(one.by)}{near}"
