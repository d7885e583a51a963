"""A sequence diagram says what the tables allow when nothing crosses: no message more, none less,
for any table.
"""

from collections.abc import Iterable, Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fipa_codec import protocols
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Role, Row, Table
from topdown.draw import sequence
from topdown.draw.protocols import (
    Frame,
    Part,
    Place,
    Remark,
    Sending,
    diagram,
    exchange,
    meet,
    name_of,
)

FIPA = [value for value in vars(protocols).values() if isinstance(value, Protocol)]
Word = tuple[Role, str]


class Reader:
    """Reads a diagram as people do, into a machine: states, steps without a word, steps with one,
    and named places.
    """

    def __init__(self, parts: tuple[Part, ...]) -> None:
        self.silent: dict[int, list[int]] = {}
        self.spoken: dict[int, list[tuple[Word, int]]] = {}
        self.places: dict[str, int] = {}
        self.jumps: list[tuple[int, str]] = []
        self.final: set[int] = set()
        self.options = [part for part in parts if isinstance(part, Frame) and part.title]
        main = tuple(part for part in parts if part not in self.options)
        self.entry = self.read(main, self.state())
        self.entries = [
            (option, self.read(option.branches[0], self.state())) for option in self.options
        ]
        for state, name in self.jumps:
            self.silent[state].append(self.places[name])

    def state(self) -> int:
        """A new state."""
        number = len(self.silent)
        self.silent[number], self.spoken[number] = [], []
        return number

    def read(self, parts: tuple[Part, ...], after: int) -> int:
        """The state before these parts, if this one is behind them."""
        for part in reversed(parts):
            here = self.state()
            if isinstance(part, Sending):
                self.spoken[here] = [((part.sender, word), after) for word in part.words]
            elif isinstance(part, Remark):
                self.remark(part.text, here, after)
            elif part.kind == "loop":
                self.silent[here] = [after, self.read(part.branches[0], here)]
            else:
                ways = [self.read(branch, after) for branch in part.branches]
                self.silent[here] = [*ways, *([after] if part.kind == "opt" else [])]
            after = here
        return after

    def remark(self, text: str, here: int, after: int) -> None:
        """A named place is passed; elsewhere the reader goes on at one, or stops."""
        if text.startswith("("):
            self.places[text] = here
            self.silent[here] = [after]
        elif text.startswith(("ends: ", "may stay: ")):
            self.final.add(here)
        elif text.startswith("goes on as at "):
            self.jumps.append((here, text.removeprefix("goes on as at ")))

    def closed(self, states: frozenset[int]) -> frozenset[int]:
        """All states that are reached without a word."""
        found, ahead = set(states), list(states)
        while ahead:
            for there in self.silent[ahead.pop()]:
                if there not in found:
                    found.add(there)
                    ahead.append(there)
        return frozenset(found)

    def may_stop(self, states: frozenset[int]) -> bool:
        """Whether the conversation may be over, or rest, here."""
        return bool(self.closed(states) & self.final)

    def words(self, states: frozenset[int]) -> dict[Word, frozenset[int]]:
        """The words that may be said, each with the states it leads to."""
        found: dict[Word, frozenset[int]] = {}
        for state in self.closed(states):
            for word, there in self.spoken[state]:
                found[word] = found.get(word, frozenset()) | {there}
        return found


def rests(protocol: Protocol, place: Place) -> bool:
    """Whether both roles have ended, or may stay as they are."""
    tables = (protocol.tables[role] for role in (Role.INITIATOR, Role.PARTICIPANT))
    return all(
        state in table.ended | table.resting for state, table in zip(place, tables, strict=True)
    )


def compare(protocol: Protocol) -> None:
    """Walk tables and diagram together: in every pair of places the same may be said."""
    meeting = meet(protocol)
    main = {
        place: {e.said: e.to for e in edges if not e.interrupts} for place, edges in meeting.items()
    }
    reader = Reader(exchange(protocol).parts)
    waiting: list[tuple[frozenset[int], Place]] = [(frozenset({reader.entry}), (START, START))]
    optional: set[tuple[str, Word]] = set()
    for option, entry in reader.entries:
        for while_ in option.title.removeprefix("while ").split(" or "):
            place = next(place for place in meeting if name_of(place) == while_)
            interrupts = {e.said: e.to for e in meeting[place] if e.interrupts}
            for word, there in reader.words(frozenset({entry})).items():
                optional.add((while_, word))
                waiting.append((there, interrupts[word]))
            assert f"({while_})" in reader.places
    assert optional == {
        (name_of(place), e.said) for place, es in meeting.items() for e in es if e.interrupts
    }
    seen = set(waiting)
    while waiting:
        states, place = waiting.pop()
        sayable = reader.words(states)
        assert set(sayable) == set(main[place]), (protocol, place)
        assert reader.may_stop(states) == rests(protocol, place)
        new = {(there, main[place][word]) for word, there in sayable.items()} - seen
        seen |= new
        waiting += new


@pytest.mark.parametrize("protocol", FIPA, ids=lambda protocol: protocol.name)
def test_a_diagram_says_what_the_tables_allow(protocol: Protocol) -> None:
    """For each of FIPA's protocols."""
    compare(protocol)


def mirrored(*rows: tuple[str, Role, P, Kind, str], resting: Iterable[str] = ()) -> Protocol:
    """A protocol whose roles are always in the same state."""
    ended = {row[-1] for row in rows} - {row[0] for row in rows}
    sides = {
        role.value: Table(
            [
                Row(state, SEND if role is speaker else RECEIVE, act, kind, to)
                for state, speaker, act, kind, to in rows
            ],
            ended=ended,
            resting=resting,
        )
        for role in Role
    }
    return Protocol("mirrored", **sides)


@st.composite
def tables(draw: st.DrawFn) -> Protocol:
    """Any two tables that mirror each other, with loops, choices and cancels."""
    states = st.sampled_from(["a", "b", "c", "d"])
    rows: dict[tuple[str, P, Kind], tuple[str, Role, P, Kind, str]] = {}
    for number in range(draw(st.integers(2, 9))):
        state = draw(states) if number else START
        act = draw(st.sampled_from([P.REQUEST, P.INFORM, P.AGREE, P.REFUSE, P.CANCEL]))
        kind = draw(st.sampled_from([Kind.PLAIN, Kind.FINAL]))
        role = draw(st.sampled_from(list(Role))) if number else Role.INITIATOR
        rows.setdefault((state, act, kind), (state, role, act, kind, draw(states)))
    resting = {row[-1] for row in rows.values()} & draw(st.sets(states))
    return mirrored(*rows.values(), resting=resting)


@given(tables())
def test_any_diagram_says_what_its_tables_allow(protocol: Protocol) -> None:
    """For tables nobody thought of."""
    compare(protocol)


def frames(parts: tuple[Part, ...]) -> Iterator[tuple[str, ...]]:
    """The kinds of frames around each other, for each innermost one."""
    for part in parts:
        if isinstance(part, Frame):
            inner = [kinds for branch in part.branches for kinds in frames(branch)]
            yield from ((part.kind, *kinds) for kinds in inner or [()])


def test_a_loop_in_a_loop_is_drawn_as_such() -> None:
    """Without any reference to another place."""
    one, other = Role.INITIATOR, Role.PARTICIPANT
    rows = (
        (START, one, P.REQUEST, "outer"),
        ("outer", one, P.CFP, "inner"),
        ("inner", other, P.PROPOSE, "inner"),
        ("inner", one, P.CONFIRM, "outer"),
        ("outer", other, P.INFORM, "done"),
    )
    parts = exchange(mirrored(*((*row[:3], Kind.PLAIN, row[3]) for row in rows))).parts
    assert list(frames(parts)) == [("loop", "loop")]
    assert [part.text for part in parts if isinstance(part, Remark)] == ["ends: done"]


def test_a_role_that_owes_a_word_takes_nothing() -> None:
    """In an urgent state the peer's words wait, so they are not drawn there."""
    rows = [Row(START, SEND, P.REQUEST, Kind.PLAIN, "a"), Row("a", SEND, P.INFORM, Kind.PLAIN, "a")]
    takes = [row._replace(way=RECEIVE) for row in rows]
    one, other = Table(rows, ended=["a"]), Table(takes, ended=[], urgent=["a"])
    drawn = exchange(Protocol("any", initiator=one, participant=other)).parts
    assert set(said(drawn)) == {"request"}


def said(parts: tuple[Part, ...]) -> Iterator[str]:
    """Every word in a diagram."""
    for part in parts:
        if isinstance(part, Sending):
            yield from part.words
        elif isinstance(part, Frame):
            for branch in part.branches:
                yield from said(branch)


def test_an_act_the_design_does_not_use_is_not_drawn() -> None:
    """Of the query protocol only query-ref, inform-ref and refuse are used here."""
    used = {Role.INITIATOR: {P.QUERY_REF}, Role.PARTICIPANT: {P.INFORM_REF, P.REFUSE}}
    drawn = set(said(exchange(protocols.QUERY, used).parts))
    assert drawn == {"query-ref", "inform-ref", "refuse"}


def test_rows_that_only_crossing_messages_need_are_told_apart() -> None:
    """A request's participant takes a cancel in `done` only if it crossed the result."""
    crossing = [row for _, row in exchange(protocols.REQUEST).crossing]
    cancels = {row.state for row in crossing if row.performative is P.CANCEL}
    assert cancels >= {"done", "failed", "refused"}
    assert all(row.state not in ("asked", "agreed") for row in crossing)


@given(tables(), st.integers(40, 120))
def test_the_text_keeps_to_its_width(protocol: Protocol, width: int) -> None:
    """Lifelines stand below each other in every line, inside the width."""
    carried = {(Role.INITIATOR, P.REQUEST): (("L", ("Word",)),)}
    shown = diagram(exchange(protocol), "any", ("one", "other"), carried)
    lines = sequence.plain(shown, width).splitlines()[1:]
    assert all(len(line) <= width for line in lines)
    assert len({len(line) for line in lines}) == 1
    assert all(line[-1] in "│┤" for line in lines)


@given(tables())
def test_frames_and_messages_do_not_run_into_each_other(protocol: Protocol) -> None:
    """In the drawing no two words overlap."""
    labels = sequence.draw(diagram(exchange(protocol), "any")).labels
    assert not [(a, b) for i, a in enumerate(labels) for b in labels[:i] if a.meets(b)]
