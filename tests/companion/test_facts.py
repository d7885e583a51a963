"""Facts and their sentences: each kind has its parts and its three rows, and no sentence has a word of the program."""

import ast
import importlib
import inspect
import itertools
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion import languages, sentences
from companion.design import AgentName
from companion.languages import facts, hfsm, rc, wm
from companion.languages.evidence import Claim
from companion.languages.facts import Fact, Kind, fact
from companion.languages.values import Side
from companion.sentences import Reader, catalogue

pytestmark = pytest.mark.timeout(120)
ROOT = Path(facts.__file__).parents[3]
PERSONS = (Reader.ENGLISH, Reader.POLISH)
ID = re.compile(r"[a-z]+_\d+|[a-z]+-\d+-\d+")
NUMBER = re.compile(r"\d+(?:[.,]\d+)?")
EXPONENT = re.compile(r"\de[+-]?\d")
INTERNAL = ("move-joint", "replan", "Terminating", "NotDone", "HFSM")
AGENTS = "|".join(AgentName)
BADLY_SET = re.compile(r"^\s|\s$|\s\s|\s[;,:.)]|^[;,:.]|[;:,]$")


def _classes() -> Iterator[str]:
    for found in pkgutil.walk_packages(languages.__path__, "companion.languages."):
        for name, one in inspect.getmembers(importlib.import_module(found.name), inspect.isclass):
            if one.__module__.startswith("companion.languages"):
                yield name


CALLED = {kind.capitalize() for kind in catalogue(Reader.ENGLISH).thing}
"""Things at the begin of a sentence: a Box is a shape, too."""
CLASSES = re.compile(rf"\b({'|'.join(sorted(set(_classes()) - CALLED))})\b")

# --- facts as hypothesis draws them -----------------------------------------------------------------------------------

THINGS = st.sampled_from([f"{kind}_{n}" for kind in ("jar", "bowl", "box", "door", "table", "cabinet") for n in (1, 2)])
NUMBERS = st.floats(-1e3, 1e3)
LISTS: dict[str, list[str]] = {
    "claim": list(Claim),
    "sensor": list(rc.Sensor),
    "fault": list(rc.Fault),
    "part": list(catalogue(Reader.OPERATOR).part),
    "agent": list(AgentName),
    "task": list(hfsm.TaskName),
    "furniture": list(catalogue(Reader.ENGLISH).furniture),
    "process": [*catalogue(Reader.OPERATOR).process, *AgentName],
    "asked": [wm.Holds.__name__, wm.ListObjects.__name__, "jar_1"],
    "body": ["right_HandPalmLink", "torso_link", "jar_1", "bowl_2"],
}
OTHER_WORDS = ["path", "stopped", "left_{hand}"]


def drawn(kind: Kind, because: st.SearchStrategy[tuple[Fact, ...]]) -> st.SearchStrategy[Fact]:
    """Facts of a kind."""
    parts = [_part(part, kind.parts[:n], because) for n, part in enumerate(kind.parts)]
    return st.tuples(*parts).map(lambda found: fact(kind, *itertools.chain(*found)))


def _part(part: str, before: tuple[str, ...], because: st.SearchStrategy[tuple[Fact, ...]]) -> st.SearchStrategy[Any]:
    name, _, of = part.partition(":")
    match name:
        case "things":
            return st.lists(THINGS, min_size=0 if before else 1, max_size=3)
        case "because":
            return because
        case "a" | "b":
            return st.tuples(THINGS)
        case "side":
            return st.tuples(st.sampled_from(Side))
        case "x" | "y":
            return st.tuples(NUMBERS)
        case _:
            return st.tuples(st.sampled_from(LISTS.get(of, OTHER_WORDS)))


REASONS = st.lists(st.sampled_from(Kind).flatmap(lambda kind: drawn(kind, st.just(()))), max_size=2).map(tuple)
FACTS = st.sampled_from(Kind).flatmap(lambda kind: drawn(kind, REASONS))
few = settings(max_examples=40, deadline=None)

# --- rows -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("reader", Reader)
def test_a_catalogue_has_a_row_for_each_kind_and_word(reader: Reader) -> None:
    """And no other rows."""
    rows = catalogue(reader)
    assert set(rows.fact) == set(Kind)
    assert set(rows.claim) == set(Claim)
    assert set(rows.sensor) == set(rc.Sensor)
    assert set(rows.fault) == set(rc.Fault)
    assert set(rows.task) == set(hfsm.TaskName)
    assert set(rows.agent) == set(AgentName)
    assert set(rows.side) == set(Side)
    assert set(rows.part) == set(catalogue(Reader.OPERATOR).part)


def test_both_persons_have_words_for_the_same() -> None:
    """Things, furniture and units; what one is told the other is told, too."""
    english, polish = map(catalogue, PERSONS)
    assert set(english.thing) == set(polish.thing)
    assert set(english.furniture) == set(polish.furniture)
    assert set(english.unit) == set(polish.unit) == set(catalogue(Reader.OPERATOR).unit)
    assert [kind for kind in Kind if not english.fact[kind]] == [kind for kind in Kind if not polish.fact[kind]]


# --- sentences --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", Kind)
@few
@given(data=st.data())
def test_a_sentence_has_no_word_of_the_program(kind: Kind, data: st.DataObject) -> None:
    """No id, no name of a class or an agent, and no more digits than a person reads."""
    one = data.draw(drawn(kind, REASONS))
    told = {Reader.OPERATOR: sentences.operator((one,))}
    told |= {reader: sentences.person((one,), reader) for reader in PERSONS}
    for reader, text in told.items():
        wrong = [*ID.findall(text), *CLASSES.findall(text), *EXPONENT.findall(text)]
        wrong += [word for word in INTERNAL if word in text]
        wrong += [number for number in NUMBER.findall(text) if len(re.sub("[.,]", "", number).strip("0")) > 3]
        wrong += re.findall(rf"\ba_({AGENTS})\b" if reader is Reader.POLISH else rf"\b(a_)?({AGENTS})\b", text)
        wrong += BADLY_SET.findall(text)
        assert not wrong, (reader, text)
        assert not re.search(r"[{}]", text.replace("left {hand}", "")), (reader, text)
    assert told[Reader.OPERATOR]
    for reader in PERSONS:
        rows = catalogue(reader).fact
        if not (text := told[reader]):
            assert not rows[kind]
            continue
        assert text.endswith("."), text
        assert all(said[:1].isupper() for said in re.split(r"(?<=\.) ", text)), text


@pytest.mark.parametrize("sense", rc.Sensor)
def test_an_operator_reads_which_fault_a_sensor_has(sense: rc.Sensor) -> None:
    """Each has its own sentence; the number is in that of an offset."""
    told = {fault: sentences.operator((fact(Kind.ILL, sense, fault, 0.05),)) for fault in rc.Fault}
    assert len(set(told.values())) == len(rc.Fault)
    assert [fault for fault, text in told.items() if "0.05 rad" in text] == [rc.Fault.OFF]


@pytest.mark.parametrize("reader", Reader)
@given(
    one=st.builds(
        Fact,
        st.sampled_from(Kind),
        things=st.lists(st.from_regex(r"\A[!-~]{0,9}\Z"), max_size=3).map(tuple),
        side=st.none() | st.sampled_from(Side),
        numbers=st.lists(st.floats(), max_size=3).map(tuple),
        words=st.lists(st.from_regex(r"\A[!-~]{0,9}\Z"), max_size=3).map(tuple),
    )
)
@few
def test_a_fact_with_other_parts_than_those_of_its_kind_is_told_all_the_same(reader: Reader, one: Fact) -> None:
    """A peer of another version may send one: nobody ends by it."""
    sentences.operator((one,)) if reader is Reader.OPERATOR else sentences.person((one,), reader)


@pytest.mark.parametrize(
    ("seconds", "english", "operator"),
    [(45.3, "45 seconds", "45.3 s"), (119.0, "120 seconds", "119 s"), (187.3, "3 minutes", "187 s")],
)
def test_a_person_is_told_long_times_in_minutes(seconds: float, english: str, operator: str) -> None:
    """An operator in seconds, as the logs have them."""
    begins = (fact(Kind.BEGINS_IN, seconds),)
    assert sentences.operator(begins) == f"it begins in {operator}"
    assert sentences.person(begins, "en") == f"I begin in {english}."


def test_numbers_as_a_person_writes_them() -> None:
    """With a comma in Polish; never with an exponent, nor a zero with a sign."""
    assert [sentences.person((fact(Kind.MOVED, "jar_1", 0.015),), one) for one in PERSONS] == [
        "The jar was moved by 1.5 cm.",
        "Ktoś przesunął słoik o 1,5 cm.",
    ]
    assert sentences.operator((fact(Kind.ARRIVED, "bowl_1", 2e3),)) == "seen: about 2000000 g in bowl"
    assert sentences.operator((fact(Kind.FEELS_LITTLE, Side.LEFT, -0.0),)) == "the left hand feels 0 g: lost"


def test_who_reads_of_two_tasks_knows_which_one_is_meant() -> None:
    """A task that names no thing leaves no gap."""
    first = fact(Kind.COMES_BEFORE, hfsm.TaskName.LOOK_AROUND, fact(Kind.MORE_URGENT))
    place = (fact(Kind.TASKS_BEFORE, 1, first),)
    assert sentences.operator(place) == "tasks that come before it: 1: look around: it is more urgent"
    assert sentences.person(place, "en") == "Tasks that come before it: 1. Another task comes first. It is more urgent."


# --- facts ------------------------------------------------------------------------------------------------------------

NEEDY = [kind for kind in Kind if any(part not in ("things", "because") for part in kind.parts)]


@pytest.mark.parametrize("kind", NEEDY)
def test_a_fact_without_its_parts_is_none(kind: Kind) -> None:
    """Also where one is missing."""
    with pytest.raises(ValueError, match=f"{kind} needs"):
        fact(kind)


@pytest.mark.parametrize("kind", Kind)
@settings(max_examples=5, deadline=None)
@given(data=st.data())
def test_a_fact_with_too_many_parts_is_none(kind: Kind, data: st.DataObject) -> None:
    """Or with a reason that is no fact."""
    parts = data.draw(st.tuples(*(_part(part, kind.parts[:n], REASONS) for n, part in enumerate(kind.parts))))
    with pytest.raises(ValueError, match=f"{kind} takes"):
        fact(kind, *itertools.chain(*parts), 7.0)


@pytest.mark.parametrize(("kind", "parts"), [(Kind.HOLDS, ("jar_1", Side.LEFT)), (Kind.MOVED, (0.1, "jar_1"))])
def test_parts_in_another_order_are_none(kind: Kind, parts: tuple[Any, ...]) -> None:
    """What is no hand is no hand, and what is no number is no number."""
    with pytest.raises(ValueError):  # noqa: PT011 -- of Side and of float, which say it in their own words
        fact(kind, *parts)


@given(FACTS)
def test_a_fact_survives_the_wire(one: Fact) -> None:
    """With its reasons."""
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(one), type=Fact) == one


@given(st.lists(FACTS, max_size=4).map(tuple), st.integers(0, 400))
def test_facts_are_cut_to_the_room_for_them(told: tuple[Fact, ...], room: int) -> None:
    """The first of them, whole; the last of these may have fewer reasons. More room never says less."""
    kept = facts.fitting(told, room)
    assert sum(len(msgspec.msgpack.encode(one)) for one in kept) <= room
    assert kept[:-1] == told[: len(kept)][:-1]
    for one, whole in zip(kept[-1:], told[len(kept) - 1 :], strict=False):
        assert msgspec.structs.replace(one, because=()) == msgspec.structs.replace(whole, because=())
        assert len(one.because) <= len(whole.because)
    assert facts.fitting(told, 100_000) == told
    assert len(facts.fitting(told, room + 50)) >= len(kept)


# --- the programs -----------------------------------------------------------------------------------------------------


def _made(tree: ast.AST) -> Iterator[tuple[ast.Call, str]]:
    """Calls of fact() with the names of their kinds."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("fact", "facts.fact") and node.args:
            kinds = node.args[0]
            for one in (kinds.body, kinds.orelse) if isinstance(kinds, ast.IfExp) else (kinds,):
                if isinstance(one, ast.Attribute) and ast.unparse(one.value) in ("Kind", "facts.Kind"):
                    yield node, one.attr


def _fits(name: str, given: int) -> bool:
    if name not in Kind.__members__:
        return False
    parts = Kind[name].parts
    needed = sum(part not in ("things", "because") for part in parts)
    return given >= needed if len(parts) > needed else given == needed


def _programs() -> list[Path]:
    return [one for folder in ("services", "shared/companion") for one in (ROOT / folder).rglob("*.py")]


def test_each_kind_is_said_by_a_program() -> None:
    """Else its sentences are for nothing."""
    trees = [ast.parse(path.read_text()) for path in _programs()]
    nodes = [node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Attribute)]
    named = {node.attr for node in nodes if ast.unparse(node.value) in ("Kind", "facts.Kind")}
    assert set(Kind.__members__) <= named


def test_each_fact_is_made_with_the_parts_of_its_kind() -> None:
    """Wherever a program makes one without a star."""
    files = _programs()
    calls = [(path, call, name) for path in files for call, name in _made(ast.parse(path.read_text()))]
    wrong = [
        f"{path.relative_to(ROOT)}:{call.lineno}: {ast.unparse(call)}"
        for path, call, name in calls
        if not any(isinstance(part, ast.Starred) for part in call.args)
        and (call.keywords or not _fits(name, len(call.args) - 1))
    ]
    assert not wrong
    assert len(calls) > 40
