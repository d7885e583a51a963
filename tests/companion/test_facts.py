"""Facts and their sentences: each kind has its parts and its three rows, and no sentence has a word
of the program.
"""

import ast
import importlib
import inspect
import itertools
import pkgutil
import re
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from companion import languages, sentences, tasks
from companion.acts import ACTS, SHOWN
from companion.design import AgentName
from companion.languages import facts, hfsm, rc, wm
from companion.languages.evidence import AnyClaim, members
from companion.languages.facts import AnyKind, Fact, Kind, fact
from companion.languages.values import Side
from companion.planning import registry
from companion.sentences import Reader, catalogue
from companion.tools.report import events

pytestmark = pytest.mark.timeout(120)
ROOT = Path(facts.__file__).parents[3]
KINDS, CLAIMS = list(members(AnyKind).values()), list(members(AnyClaim).values())
TABLES = {table.__name__: table for table in AnyKind.__subclasses__()}
"""The general kinds, and those of each task."""
PERSONS = (Reader.ENGLISH, Reader.POLISH)
ID = re.compile(r"[a-z]+_\d+|[a-z]+-\d+-\d+")
NUMBER = re.compile(r"\d+(?:[.,]\d+)?")
BRACES = re.compile("[{}]")
EXPONENT = re.compile(r"\de[+-]?\d")
INTERNAL = ("move-joint", "replan", "Terminating", "NotDone", "HFSM")
AGENTS = "|".join(AgentName)
BADLY_SET = re.compile(r"^\s|\s$|\s\s|\s[;,:.)]|^[;,:.]|[;:,]$")


def _classes():
    for found in pkgutil.walk_packages(languages.__path__, "companion.languages."):
        for name, one in inspect.getmembers(importlib.import_module(found.name), inspect.isclass):
            if one.__module__.startswith("companion.languages"):
                yield name
    yield from (act.__name__ for act in ACTS)


CALLED = {kind.capitalize() for kind in catalogue(Reader.ENGLISH).thing}
"""Things at the begin of a sentence: a Box is a shape, too."""
CLASSES = re.compile(rf"\b({'|'.join(sorted(set(_classes()) - CALLED))})\b")


def test_of_a_failed_task_a_person_is_told_what_to_do():
    """By one of the facts or their reasons, else by a call for help at the end; once."""
    floor, path = fact(Kind.ON_THE_FLOOR, "jar_1"), fact(Kind.NO_WAY_HOME, Side.LEFT)
    assert sentences.failure((path,), "en").endswith("finds no way back. Please help me.")
    assert sentences.failure((fact(Kind.GIVEN_UP, 6, floor),), "en").endswith("please pick it up.")
    assert sentences.failure((fact(Kind.GIVEN_UP, 6, path),), "pl").count("Proszę") == 1
    assert sentences.failure((), "en") == ""


# --- facts as hypothesis draws them ---------------------------------------------------------------

THINGS = st.sampled_from(
    [f"{kind}_{n}" for kind in ("jar", "bowl", "box", "door", "table", "cabinet") for n in (1, 2)]
)
NUMBERS = st.floats(-1e3, 1e3)
LISTS = {
    "claim": CLAIMS,
    "sensor": list(rc.Sensor),
    "fault": list(rc.Fault),
    "part": list(catalogue(Reader.OPERATOR).part),
    "agent": list(AgentName),
    "task": list(registry.tasks()),
    "furniture": list(catalogue(Reader.ENGLISH).furniture),
    "process": [*catalogue(Reader.OPERATOR).process, *AgentName],
    "asked": [wm.Holds.__name__, wm.ListObjects.__name__, "jar_1"],
    "body": ["right_HandPalmLink", "torso_link", "jar_1", "bowl_2"],
}
OTHER_WORDS = ["path", "stopped", "left_{hand}"]


def drawn(kind, because):
    """Facts of a kind."""
    parts = [_part(part, kind.parts[:n], because) for n, part in enumerate(kind.parts)]
    return st.tuples(*parts).map(lambda found: fact(kind, *itertools.chain(*found)))


def _part(part, before, because):
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


REASONS = st.lists(
    st.sampled_from(KINDS).flatmap(lambda kind: drawn(kind, st.just(()))), max_size=2
).map(tuple)
FACTS = st.sampled_from(KINDS).flatmap(lambda kind: drawn(kind, REASONS))


def few(examples):
    """So many examples, of each row of a table."""
    return settings(max_examples=examples, deadline=None)


# --- rows -----------------------------------------------------------------------------------------


def test_each_catalogue_has_a_row_for_each_word_and_no_other_one():
    """Kinds, claims, sensors, tasks, steps and acts of plans; a sentence that asks for something
    says please.
    """
    of_operator, steps = catalogue(Reader.OPERATOR), _steps_of_plans()
    for reader in Reader:
        rows = catalogue(reader)
        known, named = registry.tasks().keys(), rows.task.keys()
        lacking, unknown = known - named, named - known
        where = f"sentences.toml in companion/tasks/TASK: [{reader}.task]"
        assert not lacking, f"{where} lacks {lacking}"
        assert not unknown, f"[{reader}.task] names {unknown}, which no plan.py has in `tasks`"
        general = (rows.fact, rows.claim, rows.sensor, rows.fault, rows.agent, rows.side)
        found = (*general, rows.part, rows.step, rows.leaf)
        words = (KINDS, CLAIMS, rc.Sensor, rc.Fault, AgentName, Side, of_operator.part, steps)
        wanted = (*words, {act.__name__ for act in ACTS})
        for table, words in zip(found, wanted, strict=True):
            assert set(table) == set(words), reader
    for reader, word in ((Reader.ENGLISH, "please"), (Reader.POLISH, "proszę")):
        rows = catalogue(reader)
        assert [kind for kind in KINDS if (word in rows.fact[kind].lower()) != kind.asks] == []


def test_the_operator_has_words_for_each_event():
    """The general ones and those of the tasks; each names all that it is of."""
    own = {row.event: row.of for row in SHOWN.values() if row.event}
    rows = catalogue(Reader.OPERATOR).event
    assert set(rows) == {*events.Kind, *own}
    for name, of in own.items():
        assert all(f"{{{number}}}" in rows[name] for number in range(len(of)))


def test_both_persons_have_words_for_the_same():
    """Things, furniture and units; what one is told the other is told, too."""
    english, polish = map(catalogue, PERSONS)
    assert set(english.thing) == set(polish.thing)
    assert set(english.furniture) == set(polish.furniture)
    assert set(english.unit) == set(polish.unit) >= set(catalogue(Reader.OPERATOR).unit)
    silent = [[kind for kind in KINDS if not rows.fact[kind]] for rows in (english, polish)]
    assert silent[0] == silent[1]


# --- steps of plans -------------------------------------------------------------------------------


def _steps_of_plans():
    """Return what steps of plans can do, read off each call of hfsm.Step in the code that makes
    them.
    """
    found = set()
    for file in ROOT.glob("shared/companion/**/*.py"):
        for call in ast.walk(ast.parse(file.read_text())):
            if (
                isinstance(call, ast.Call)
                and ast.unparse(call.func) in ("hfsm.Step", "Step")
                and call.args
            ):
                does = call.args[0]
                if isinstance(does, ast.Constant):
                    found.add(does.value)
                elif ast.unparse(call.func) == "hfsm.Step":
                    where = f"{file}: line {call.lineno}"
                    raise AssertionError(f"{where}: what a step does is to be written there")
    return found


@few(200)
@given(
    does=st.sampled_from(sorted(catalogue(Reader.OPERATOR).step)),
    things=st.lists(THINGS, min_size=2, max_size=2),
    side=st.sampled_from(Side),
    act=st.sampled_from(list(ACTS)),
)
def test_a_place_in_a_plan_is_said_in_words(does, things, side, act):
    """With its things and its hand, and no word of the program."""
    step = hfsm.Step(does, tuple(things), side)
    for reader in Reader:
        row = catalogue(reader).step[does]
        text = sentences.place(hfsm.Place(("x", "y"), step, act.__name__, side), reader)
        assert text == f"{sentences.step(step, reader)} ({catalogue(reader).leaf[act.__name__]})"
        assert row.count("{") == catalogue(Reader.OPERATOR).step[does].count("{")
        wrong = [found for sign in (ID, CLASSES, BADLY_SET, BRACES) for found in sign.findall(text)]
        assert not wrong, (reader, text)


def test_what_this_version_does_not_know_is_said_by_its_name():
    """A planner or an executor of another version may be more able."""
    place = hfsm.Place(("x", "y"), hfsm.Step("wave-at", ("vase_1",), Side.LEFT), "WaveHand")
    for reader in Reader:
        text = sentences.place(place, reader)
        assert text == f"wave at vase {catalogue(reader).side[Side.LEFT][0]} (wave hand)"
        assert sentences.place(hfsm.Place(("x",)), reader) == ""


# --- sentences ------------------------------------------------------------------------------------


def test_a_sentence_has_no_word_of_the_program():
    """No id, no name of a class or an agent, and no more digits than a person reads."""
    for kind in KINDS:
        few(8)(given(one=drawn(kind, REASONS))(_has_no_word_of_the_program))()


def _has_no_word_of_the_program(one):
    texts = {Reader.OPERATOR: sentences.operator((one,))}
    texts |= {reader: sentences.person((one,), reader) for reader in PERSONS}
    for reader, text in texts.items():
        wrong = [*ID.findall(text), *CLASSES.findall(text), *EXPONENT.findall(text)]
        wrong += [word for word in INTERNAL if word in text]
        digits = (re.sub("[.,]", "", number).strip("0") for number in NUMBER.findall(text))
        wrong += [number for number in digits if len(number) > 3]
        wrong += re.findall(
            rf"\ba_({AGENTS})\b" if reader is Reader.POLISH else rf"\b(a_)?({AGENTS})\b", text
        )
        wrong += BADLY_SET.findall(text)
        assert not wrong, (reader, text)
        assert not re.search(r"[{}]", text.replace("left {hand}", "")), (reader, text)
    assert texts[Reader.OPERATOR]
    for reader in PERSONS:
        if not (text := texts[reader]):
            assert not catalogue(reader).fact[one.kind]
            continue
        assert text.endswith("."), text
        assert all(sentence[:1].isupper() for sentence in re.split(r"(?<=\.) ", text)), text


def test_an_operator_reads_which_fault_a_sensor_has():
    """Each has its own sentence; the number is in that of an offset."""
    for sense in rc.Sensor:
        texts = {one: sentences.operator((fact(Kind.ILL, sense, one, 0.05),)) for one in rc.Fault}
        assert len(set(texts.values())) == len(rc.Fault)
        assert [fault for fault, text in texts.items() if "0.05 rad" in text] == [rc.Fault.OFF]


@given(
    one=st.builds(
        Fact,
        st.sampled_from(KINDS),
        things=st.lists(st.from_regex(r"\A[!-~]{0,9}\Z"), max_size=3).map(tuple),
        side=st.none() | st.sampled_from(Side),
        numbers=st.lists(st.floats(), max_size=3).map(tuple),
        words=st.lists(st.from_regex(r"\A[!-~]{0,9}\Z"), max_size=3).map(tuple),
    )
)
@few(100)
def test_a_fact_with_other_parts_than_those_of_its_kind_is_told_all_the_same(one):
    """A peer of another version may send one: nobody ends by it."""
    sentences.operator((one,))
    for reader in PERSONS:
        sentences.person((one,), reader)


def test_numbers_stand_as_a_person_writes_them():
    """Long times in minutes, an operator's in seconds; the form of a unit that its number asks for,
    of which Polish has four, each in two cases; a comma in Polish; never an exponent, nor a zero
    with a sign.
    """
    for seconds, english, of_operator in ((45.3, "45 seconds", "45.3 s"),
                                          (119.0, "120 seconds", "119 s"),
                                          (187.3, "3 minutes", "187 s")):  # fmt: skip
        begins = (fact(Kind.BEGINS_IN, seconds),)
        assert sentences.operator(begins) == f"it begins in {of_operator}"
        assert sentences.person(begins, "en") == f"I begin in {english}."
    for count, english, polish in ((1, "1 minute", "1 minutę"), (2, "2 minutes", "2 minuty"),
                                   (5, "5 minutes", "5 minut"), (12, "12 minutes", "12 minut"),
                                   (22, "22 minutes", "22 minuty"),
                                   (1.5, "1.5 minutes", "1,5 minuty")):  # fmt: skip
        why = (fact(Kind.NOBODY_CAME, count),)
        waited = f"I waited for you for {english}, then stopped waiting."
        assert sentences.person(why, "en") == waited
        assert sentences.person(why, "pl") == f"Czekałam {polish} i przestałam czekać."
    for seconds, polish in ((1.0, "1 sekundy"), (3.0, "3 sekund"), (30.0, "30 sekund")):
        takes = sentences.person((fact(Kind.PLAN_TAKES, 1, seconds),), "pl")
        assert takes == f"To potrwa około {polish}."
    moved = (fact(Kind.MOVED, "jar_1", 0.015),)
    assert sentences.person(moved, "en") == "The jar was moved by 1.5 cm."
    assert sentences.person(moved, "pl") == "Ktoś przesunął słoik o 1,5 cm."
    assert (
        sentences.operator((fact(Kind.MOVED, "bowl_1", 2e6),)) == "bowl was moved by 2000000000 mm"
    )
    light = sentences.operator((fact(Kind.FEELS_LITTLE, Side.LEFT, -0.0),))
    assert light == "the left hand feels 0 g: lost"


def test_polish_things_stand_in_the_case_of_their_sentence():
    """A list of things, too."""
    polish = sentences.person((fact(Kind.SEEN, "jar_1", "bowl_1", "box_2"),), "pl")
    assert polish == "Widzę słoik, miskę i pudełko 2."
    english = sentences.person((fact(Kind.SEEN, "jar_1", "bowl_1"),), "en")
    assert english == "I see the jar and the bowl."


def test_who_reads_of_two_tasks_knows_which_one_is_meant():
    """A task that names no thing leaves no gap."""
    first = fact(Kind.COMES_BEFORE, "look_around", fact(Kind.MORE_URGENT))
    place = (fact(Kind.TASKS_BEFORE, 1, first),)
    text = "tasks that come before it: 1: look around: it is more urgent"
    assert sentences.operator(place) == text
    text = "Before this one: 1 task. First comes: look around. It is more urgent."
    assert sentences.person(place, "en") == text


# --- facts ----------------------------------------------------------------------------------------


@few(300)
@given(st.sampled_from(KINDS), st.data())
def test_a_fact_has_the_parts_of_its_kind(kind, data):
    """Without a part, with one too many, or with a reason that is no fact it is none."""
    strategies = (_part(part, kind.parts[:n], REASONS) for n, part in enumerate(kind.parts))
    parts = data.draw(st.tuples(*strategies))
    with pytest.raises(ValueError, match=f"{kind} takes"):
        fact(kind, *itertools.chain(*parts), 7.0)
    if any(part not in ("things", "because") for part in kind.parts):
        with pytest.raises(ValueError, match=f"{kind} needs"):
            fact(kind)


@pytest.mark.parametrize(
    ("kind", "parts"), [(Kind.HOLDS, ("jar_1", Side.LEFT)), (Kind.MOVED, (0.1, "jar_1"))]
)
def test_parts_in_another_order_are_none(kind, parts):
    """What is no hand is no hand, and what is no number is no number."""
    with pytest.raises(ValueError):  # noqa: PT011 -- of Side and of float, which say it in their own words
        fact(kind, *parts)


@given(FACTS)
def test_a_fact_survives_the_wire(one):
    """With its reasons."""
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(one), type=Fact) == one


def test_a_kind_is_its_name_on_the_wire():
    """And the same member for who reads it, whether all tasks say it or one."""
    for kind in KINDS:
        data = msgspec.msgpack.encode({"kind": kind.value})
        assert msgspec.msgpack.decode(data, type=Fact).kind is kind
        assert msgspec.msgpack.decode(msgspec.msgpack.encode(Fact(kind))) == {"kind": kind.value}


def test_an_unknown_kind_is_refused():
    """Wherever it stands: as a reason, too."""
    for wrong in ({"kind": "flies"}, {"kind": "not-begun", "because": [{"kind": "flies"}]}):
        with pytest.raises(msgspec.ValidationError, match="unknown AnyKind 'flies'"):
            msgspec.msgpack.decode(msgspec.msgpack.encode(wrong), type=Fact)


def test_a_kind_of_a_task_has_its_sentences_in_the_task():
    """Each table of kinds is the general one or in the part `done` of a task, and so are its
    rows.
    """
    for table in AnyKind.__subclasses__():
        if table is Kind:
            continue
        room, _, part = table.__module__.rpartition(".")
        assert (room.rpartition(".")[0], part) == (tasks.__name__, "done")
        folder = str(importlib.import_module(room).__path__[0])
        rows = msgspec.toml.decode(Path(folder, "sentences.toml").read_bytes())
        assert all(set(rows[reader]["fact"]) == set(table) for reader in Reader)


@given(st.lists(FACTS, max_size=4).map(tuple), st.integers(0, 400))
def test_facts_are_cut_to_the_room_for_them(told, room):
    """The first of them, whole; the last of these may have fewer reasons. More room never says
    less.
    """
    kept = facts.fitting(told, room)
    assert sum(len(msgspec.msgpack.encode(one)) for one in kept) <= room
    assert kept[:-1] == told[: len(kept)][:-1]
    for one, whole in zip(kept[-1:], told[len(kept) - 1 :], strict=False):
        first, second = (replace(fact, because=()) for fact in (one, whole))
        assert first == second
        assert len(one.because) <= len(whole.because)
    assert facts.fitting(told, 100_000) == told
    assert len(facts.fitting(told, room + 50)) >= len(kept)


# --- the programs ---------------------------------------------------------------------------------


def _named(node):
    """The table and the name of a kind, where a program names one."""
    if isinstance(node, ast.Attribute):
        table = ast.unparse(node.value).removeprefix("facts.")
        return (table, node.attr) if table in TABLES else None
    return None


def _made(tree):
    """Calls of fact() with the names of their kinds."""
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Call)
            and ast.unparse(node.func) in ("fact", "facts.fact")
            and node.args
        ):
            kinds = node.args[0]
            for one in (kinds.body, kinds.orelse) if isinstance(kinds, ast.IfExp) else (kinds,):
                if name := _named(one):
                    yield node, name


def _fits(table, name, given):
    if name not in TABLES[table].__members__:
        return False
    parts = TABLES[table][name].parts
    needed = sum(part not in ("things", "because") for part in parts)
    return given >= needed if len(parts) > needed else given == needed


def _programs():
    folders = (ROOT / "services", ROOT / "shared/companion")
    return [one for folder in folders for one in folder.rglob("*.py")]


def test_each_kind_is_said_by_a_program():
    """Else its sentences are for nothing."""
    trees = [ast.parse(path.read_text()) for path in _programs()]
    named = {_named(node) for tree in trees for node in ast.walk(tree)}
    assert {(name, one.name) for name, table in TABLES.items() for one in table} <= named


def test_each_fact_is_made_with_the_parts_of_its_kind():
    """Wherever a program makes one without a star."""
    files = _programs()
    calls = [(path, *made) for path in files for made in _made(ast.parse(path.read_text()))]
    wrong = [
        f"{path.relative_to(ROOT)}:{call.lineno}: {ast.unparse(call)}"
        for path, call, name in calls
        if not any(isinstance(part, ast.Starred) for part in call.args)
        and (call.keywords or not _fits(*name, len(call.args) - 1))
    ]
    assert not wrong
    assert len(calls) > 40
