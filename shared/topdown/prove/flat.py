"""A model as tables of numbers, for the explorers in C and with numpy, and the C explorer itself.

A state is a row of small numbers, one for each slot. A `Site` reads some slots; what they hold
leads to a `Row`: whether the state is wrong, and the moves that may happen. A move is a list of
steps. What a number in a slot becomes, and whether something holds of it, is a function of that
number alone. Rows and values of functions are worked out when an explorer meets them first.
Must not know: what a model is about.
"""

import ctypes
from array import array
from collections.abc import Callable, Hashable, Iterable
from enum import IntEnum, IntFlag
from typing import Any, NamedTuple, Protocol, runtime_checkable

from topdown.prove.compiled import library

NOTHING = 0xFFFF
"""In slot 0: a state that is wrong, whose text slot 1 has. In the slot of faults: any number."""
KEYS = 3
"""Slots that a site reads at most."""


class Has(IntFlag):
    """Properties of a move. `IF_FAULTS`: only while faults may come. `IF_CHANGED`: not where the
    state stays. `IF_ROOM`: not where a function has a text. `PAYS`: one fault less may come.
    """

    FAIR = 1
    FAULT = 2
    IF_FAULTS = 4
    IF_CHANGED = 8
    IF_ROOM = 16
    PAYS = 32


class Reads(IntFlag):
    """Properties of a site. `IF_FILLED`: only where its first slot is not 0. `IF_FAULTS`: only
    while faults may come. `MAY_BE_WRONG`: its rows may say that a state is wrong.
    """

    ALWAYS = 0
    IF_FILLED = 1
    IF_FAULTS = 2
    MAY_BE_WRONG = 4


class Do(IntEnum):
    """Kinds of steps."""

    TAKEN = 0
    SET = 1
    COPY = 2
    MAP = 3
    ONLY_IF = 4
    IS_BAD = 5
    NEVER = 6


class Step(NamedTuple):
    """`what` to do: TAKEN number, SET slot value, COPY slot slot, MAP slot function, ONLY_IF slot
    function (these first), IS_BAD text; NEVER text count, then as many conditions on the state
    that the steps before it make.
    """

    what: int
    one: int = 0
    other: int = 0


class If(NamedTuple):
    """Whether a function of a slot is not 0. `begins` a condition; those after it with False are
    its alternatives.
    """

    begins: bool
    slot: int
    function: int


class Move(NamedTuple):
    """A move."""

    has: Has
    steps: tuple[Step | If, ...]


class Row(NamedTuple):
    """What may happen. `wrong`: a text's number, or -1."""

    moves: tuple[Move, ...] = ()
    wrong: int = -1


class Site(NamedTuple):
    """`row` of the values in its slots."""

    slots: tuple[int, ...]
    row: Callable[..., Row]
    reads: Reads = Reads.ALWAYS


class Case(NamedTuple):
    """All of the conditions hold; `text` is what is wrong then."""

    all: tuple[If, ...]
    text: int = 0


class Numbered:
    """Values and their numbers, in the order they were met."""

    def __init__(self, *first: Any) -> None:
        self.values: list[Any] = []
        self.numbers: dict[Any, int] = {}
        for value in first:
            self(value)

    def __call__(self, value: Any) -> int:
        number = self.numbers.get(value)
        if number is None:
            number = self.numbers[value] = len(self.values)
            self.values.append(value)
        return number


class Tables:
    """A model. `faults`: the slot of faults, or -1. `rest`, `wrong`: alternatives. `taken`: how
    many numbers TAKEN steps have.
    """

    def __init__(self, start: tuple[int, ...], faults: int = -1, taken: int = 0) -> None:
        self.start, self.faults, self.taken = start, faults, taken
        self.sites: list[Site] = []
        self.rest: list[Case] = []
        self.wrong: list[Case] = []
        self.functions: list[Callable[[int], int]] = []
        self.texts, self._names = Numbered(), Numbered()

    def text(self, words: str) -> int:
        """The number of a text."""
        return self.texts(words)

    def function(self, name: Hashable, call: Callable[[int], int]) -> int:
        """The number of a function, which `name` stands for; its values are `bad` for a text."""
        number = self._names(name)
        if number == len(self.functions):
            self.functions.append(call)
        return number

    def condition(self, slot: int, name: Hashable, call: Callable[[int], int]) -> If:
        """A function of a slot is not 0."""
        return If(True, slot, self.function(name, call))

    def bad(self, words: str) -> int:
        """The value of a function for a state that is wrong."""
        return -self.text(words) - 1


@runtime_checkable
class Tabled(Protocol):
    """A model that has tables as well."""

    def tables(self) -> Tables:
        """The same states and moves, in the same order."""

    def state_of(self, numbers: tuple[int, ...]) -> Any:
        """The state that these numbers stand for."""

    def wrong_state(self, text: str) -> Any:
        """The state that IS_BAD, or a function's text, leads to."""

    def note_taken(self, numbers: Iterable[int]) -> None:
        """These TAKEN steps were done."""


def model_state(model: Tabled, tables: Tables, numbers: tuple[int, ...]) -> Any:
    """The state of a model that a row of numbers stands for."""
    if numbers[0] == NOTHING:
        return model.wrong_state(tables.texts.values[numbers[1]])
    return model.state_of(numbers)


# --- The explorer in C ----------------------------------------------------------------------------


class Status(IntEnum):
    """Why a run returned."""

    DONE = 0
    PAUSE = 1
    NEED_ROW = 2
    NEED_NUMBER = 3
    FOUND = 4
    NO_MEMORY = 5


class TooLarge(Exception):
    """A slot has more different values, or a search more states, than the tables have room for."""


class _Shared(ctypes.Structure):
    """The beginning of `explorer` in explore.c."""

    _fields_ = (
        ("states", ctypes.c_int64),
        ("looked", ctypes.c_int64),
        ("edges", ctypes.c_int64),
        ("number", ctypes.c_int64),
        ("site", ctypes.c_int32),
        ("function", ctypes.c_int32),
        ("kind", ctypes.c_int32),
        ("text", ctypes.c_int32),
        ("key", ctypes.c_int32 * KEYS),
        ("width", ctypes.c_int32),
        ("pitch", ctypes.c_int32),
        ("padding", ctypes.c_int32),
        ("state", ctypes.POINTER(ctypes.c_uint16)),
        ("parent", ctypes.POINTER(ctypes.c_uint32)),
        ("taken", ctypes.POINTER(ctypes.c_uint8)),
    )


class Explorer:
    """One search, to be closed. Raises TooLarge."""

    def __init__(self, loop: ctypes.CDLL, model: Tabled) -> None:
        self.model, self._loop = model, loop
        self.tables = tables = model.tables()
        new = loop.explorer_new
        new.restype, loop.explorer_stuck.restype = ctypes.POINTER(_Shared), ctypes.c_int64
        sites = array("i")
        for site in tables.sites:
            slots = (*site.slots, 0, 0, 0)[:KEYS]
            sites.extend((len(site.slots), *slots, site.reads))
        start, rest, wrong = array("H", tables.start), _cases(tables.rest), _cases(tables.wrong)
        self._made = new(
            len(start),
            _at(start),
            tables.faults,
            len(tables.sites),
            _at(sites),
            _at(rest),
            len(rest),
            _at(wrong),
            len(wrong),
            tables.taken,
        )
        if not self._made:
            raise TooLarge
        self.now: _Shared = self._made.contents

    def close(self) -> None:
        """Say what was taken, and give the memory back."""
        done = ctypes.string_at(self.now.taken, self.tables.taken)
        self.model.note_taken(number for number, taken in enumerate(done) if taken)
        self._loop.explorer_end(self._made)

    def run(self) -> Status:
        """DONE, FOUND (see `now.kind`, `now.text`, `now.number`) or PAUSE, to look at the clock."""
        while True:
            self._given(self._loop.explorer_functions(self._made, len(self.tables.functions)))
            status = Status(self._loop.explorer_run(self._made))
            match status:
                case Status.NEED_ROW:
                    self._give_row()
                case Status.NEED_NUMBER:
                    self._give_number()
                case Status.NO_MEMORY:
                    raise TooLarge
                case _:
                    return status

    def stuck(self) -> int:
        """The first state from which rest is out of reach; -1 where there is none."""
        return int(self._loop.explorer_stuck(self._made))

    def state(self, number: int) -> Any:
        """A state of the model."""
        first = number * self.now.pitch
        numbers = tuple(self.now.state[first : first + self.now.width])
        return model_state(self.model, self.tables, numbers)

    def parent(self, number: int) -> int:
        """The state from which a state was found."""
        return int(self.now.parent[number])

    def met(self, slot: int) -> frozenset[int]:
        """All that was in a slot in any state."""
        size = self.now.states * self.now.pitch
        place = ctypes.addressof(self.now.state.contents)
        values = memoryview((ctypes.c_uint16 * size).from_address(place)).cast("B").cast("H")
        return frozenset(values[slot :: self.now.pitch])

    def _give_row(self) -> None:
        site = self.tables.sites[self.now.site]
        values = tuple(self.now.key[: len(site.slots)])
        row = site.row(*values)
        code = array("i", (row.wrong, len(row.moves)))
        for move in row.moves:
            check_numbers(step[2] for step in move.steps if step[0] is Do.SET)
            code.extend((move.has, len(move.steps)))
            for step in move.steps:
                code.extend(map(int, step))
        # a run may need the functions that this row has
        self._given(self._loop.explorer_functions(self._made, len(self.tables.functions)))
        key = array("i", (*values, 0, 0, 0))
        size = ctypes.c_int64(len(code))
        self._given(self._loop.explorer_row(self._made, self.now.site, _at(key), _at(code), size))

    def _give_number(self) -> None:
        value = self.now.key[0]
        result = self.tables.functions[self.now.function](value)
        check_numbers((result if result >= 0 else -result,))
        self._given(self._loop.explorer_number(self._made, self.now.function, value, result))

    @staticmethod
    def _given(whole: int) -> None:
        if not whole:
            raise TooLarge


def explorer(model: object) -> Explorer | None:
    """The search of a model that has tables, where the library is."""
    loop = library()
    return None if loop is None or not isinstance(model, Tabled) else Explorer(loop, model)


def check_numbers(values: Iterable[int]) -> None:
    """Raise TooLarge if one does not fit into a slot."""
    if any(value >= NOTHING for value in values):
        raise TooLarge


def _cases(cases: list[Case]) -> "array[int]":
    code = array("i", (len(cases),))
    for case in cases:
        code.extend((case.text, len(case.all)))
        for condition in case.all:
            code.extend(map(int, condition))
    return code


def _at(values: "array[int]") -> ctypes.c_void_p:
    return ctypes.c_void_p(values.buffer_info()[0])
