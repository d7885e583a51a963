"""The search of explore.c with numpy, many states at a time: for machines without a C compiler.

It finds the same states in the same order, the same edges and the same findings. All states of a
batch are looked at together: for each row of the tables, its moves are carried out in all states
that the row applies to. A batch ends before the states that it finds.
"""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from topdown.prove.flat import (
    NOTHING,
    Case,
    Do,
    Has,
    If,
    Move,
    Reads,
    Row,
    Site,
    Status,
    Tabled,
    TooLarge,
    check_numbers,
    model_state,
)

Ints = NDArray[Any]

LARGEST = 1 << 16
"""States of a batch, whose places fit into 16 bits (faster to sort)."""
UNKNOWN = np.iinfo(np.int32).min
NONE = -1
MOST_MOVES = 1 << 12
"""Of a row (estimate: the largest of `execute_command` has 199); more are explored in Python."""
MULTIPLIER = 0xD6E8FEB86659FD93
"""Of the hash in explore.c."""


def batched(model: object, first: bool, pause: int) -> "Batches | None":
    """The search of a model that has tables."""
    return Batches(model, first, pause) if isinstance(model, Tabled) else None


@dataclass
class Now:
    """How far the search is; the names are those of `explorer` in explore.c."""

    states: int = 1
    looked: int = 0
    edges: int = 0
    number: int = 0
    text: int = NONE


class _Plan(NamedTuple):
    """A move: the conditions that come first, then the rest of its steps. `has`: looked up faster
    than a flag is taken apart.
    """

    has: frozenset[Has]
    only_if: tuple[tuple[int, int], ...]
    steps: tuple[tuple[Any, ...], ...]


class _Candidates:
    """Successors of a batch: `row` of each, its parent (place in the batch), the number of its move
    and whether the move is fair.
    """

    def __init__(self, pitch: int) -> None:
        self.count, self.move = 0, 0
        self.row = np.zeros((1024, pitch), np.uint16)
        self.parent = np.zeros(1024, np.int32)
        self.order = np.zeros(1024, np.int32)
        self.fair = np.zeros(1024, bool)

    def room(self, more: int) -> Ints:
        """Rows to fill; `take` keeps them."""
        end = self.count + more
        self.row, self.parent = _grown(self.row, end), _grown(self.parent, end)
        self.order, self.fair = _grown(self.order, end), _grown(self.fair, end)
        return self.row[self.count : end]

    def take(self, parent: Ints, fair: bool) -> None:
        """The next rows are successors of these."""
        end = self.count + len(parent)
        self.parent[self.count : end] = parent
        self.order[self.count : end] = self.move
        self.fair[self.count : end] = fair
        self.count = end


class _Batch(NamedTuple):
    """States that are looked at together: `faulty`, faults may come there; `alone`, nothing else
    can happen; `taken`: numbers of TAKEN steps, each with the first place where it was done.
    """

    here: Ints
    faulty: Ints
    found: _Candidates
    alone: Ints
    taken: list[tuple[int, int]]


class _Pairs:
    """Numbers of pairs of small numbers, in the order met."""

    def __init__(self) -> None:
        self.table: Ints = np.full((1, 64), NONE, np.int32)
        self.used = 0

    def numbers(self, ones: Ints, others: Ints) -> tuple[Ints, Ints]:
        """The number of each pair; and where each pair stands that is met first, in order."""
        tall, wide = (
            _room(room, int(some.max()) + 1)
            for room, some in zip(self.table.shape, (ones, others), strict=True)
        )
        if (tall, wide) != self.table.shape:
            new = np.full((tall, wide), NONE, np.int32)
            new[: self.table.shape[0], : self.table.shape[1]] = self.table
            self.table = new
        found: Ints = self.table[ones, others]
        missing = np.flatnonzero(found == NONE)
        if len(missing):
            pairs = ones[missing].astype(np.int64) * wide + others[missing]
            missing = missing[np.sort(np.unique(pairs, return_index=True)[1])]
            count = len(missing)
            self.table[ones[missing], others[missing]] = np.arange(self.used, self.used + count)
            self.used += count
            found = self.table[ones, others]
        return found, missing


@dataclass
class _Lookup:
    """The row of each combination of values in a site's slots; `tables`: of each slot's value and
    the number of those in the slots before it; `number`: of its first move.
    """

    site: Site
    number: int
    tables: list[_Pairs] = field(default_factory=list)
    plans: list[tuple[_Plan, ...]] = field(default_factory=list)
    wrong: list[int] = field(default_factory=list)


class Batches:
    """One search, to be closed. Raises TooLarge. `first`: it ends at the first finding. `pause`: it
    looks at the clock once in as many states.
    """

    def __init__(self, model: Tabled, first: bool, pause: int) -> None:
        self.model, self.first = model, first
        self.tables = tables = model.tables()
        self.now = Now()
        self.width = len(tables.start)
        self.pitch = (self.width + 3) // 4 * 4
        self.pause = min(pause, LARGEST)
        self._taken: set[int] = set()
        self._states = np.zeros((1024, self.pitch), np.uint16)
        self._states[0, : self.width] = tables.start
        self._hashes, self._parents = np.zeros(1024, np.uint64), np.zeros(1024, np.uint32)
        self._fairs, self._good = np.zeros(1024, np.uint16), np.zeros(1024, np.uint8)
        self._fair, self._fair_used = np.zeros(1024, np.uint32), 0
        self._places = np.zeros(4096, np.int32)  # number of a state + 1, by its hash
        self._hashes[:1] = _hashed(_words(self._states[:1]))
        self._insert(0, 1)
        self._maps: list[Ints] = []
        self._lookups = [
            _Lookup(site, number * MOST_MOVES) for number, site in enumerate(tables.sites)
        ]
        self._candidates = _Candidates(self.pitch)  # its room is used again
        self._found: deque[tuple[int, int]] = deque()
        self._paused = -1

    def close(self) -> None:
        """Say which rows were taken."""
        self.model.note_taken(self._taken)

    def parent(self, number: int) -> int:
        """The state from which a state was found."""
        return int(self._parents[number])

    def run(self) -> Status:
        """DONE, FOUND (see `now.text` and `now.number`) or PAUSE, to look at the clock."""
        while True:
            if self._found:
                self.now.number, self.now.text = self._found.popleft()
                return Status.FOUND
            if self.now.looked >= self.now.states:
                return Status.DONE
            looked, states = self.now.looked, self.now.states
            if looked % self.pause == 0 and self._paused != looked:
                self._paused = looked
                return Status.PAUSE
            self._look(min(self.pause - looked % self.pause, states - looked))

    def state(self, number: int) -> Any:
        """A state of the model."""
        numbers = tuple(map(int, self._states[number, : self.width]))
        return model_state(self.model, self.tables, numbers)

    def met(self, slot: int) -> frozenset[int]:
        """All that was in a slot in any state."""
        return frozenset(np.unique(self._states[: self.now.states, slot]).tolist())

    # --- a batch ----------------------------------------------------------------------------------

    def _look(self, count: int) -> None:
        """Look at the next states."""
        start = self.now.looked
        here = self._states[start : start + count].copy()
        text = self._texts(here)
        alive = np.flatnonzero(text == NONE)
        rests = np.zeros(count, bool)
        rests[alive] = self._holds(here[alive], self.tables.rest) != NONE
        faults = self.tables.faults
        faulty = here[:, faults] != 0 if faults >= 0 else np.zeros(count, bool)
        self._candidates.count = 0
        batch = _Batch(here, faulty, self._candidates, np.ones(count, bool), [])
        for lookup in self._lookups:
            self._carry_out(lookup, batch, alive)
        dead = batch.alone & ~rests
        dead[text != NONE] = False
        ends = np.flatnonzero(dead | (text != NONE))
        looked = count
        if self.first and len(ends):
            looked = int(ends[0]) + 1
        self._taken.update(number for number, parent in batch.taken if parent < looked)
        self._found += [(start + int(end), int(text[end])) for end in ends if end < looked]
        good = rests | (text != NONE)
        self._good[start : start + looked] = good[:looked] + 2 * dead[:looked]
        self._note(batch.found, start, looked, dead)
        self.now.looked = start + looked

    def _texts(self, here: Ints) -> Ints:
        """What is wrong with each state, or NONE."""
        text = np.where(here[:, 0] == NOTHING, here[:, 1].astype(np.int32), NONE)
        left = np.flatnonzero(text == NONE)
        text[left] = self._holds(here[left], self.tables.wrong)
        for lookup in self._lookups:
            if lookup.site.reads & Reads.MAY_BE_WRONG:
                left = np.flatnonzero((text == NONE) & (here[:, lookup.site.slots[0]] != 0))
                if len(left):
                    rows = self._rows(lookup, here, left)
                    text[left] = np.array(lookup.wrong, np.int32)[rows]
        return text

    def _holds(self, here: Ints, cases: list[Case]) -> Ints:
        """The text of the first case that holds in each state, or NONE."""
        text = np.full(len(here), NONE, np.int32)
        for case in cases:
            left = np.flatnonzero(text == NONE)
            text[left[self.all_hold(here, left, case.all)]] = case.text
        return text

    def all_hold(self, here: Ints, left: Ints, conditions: tuple[If, ...]) -> Ints:
        """Places in `left` of the states in which all conditions hold."""
        all_hold = np.arange(len(left))
        number = 0
        while number < len(conditions) and len(all_hold):
            any_holds = np.zeros(len(all_hold), bool)
            while True:
                open_ones = np.flatnonzero(~any_holds)
                _, slot, function = conditions[number]
                values = here[left[all_hold[open_ones]], slot]
                any_holds[open_ones] = self.numbers(function, values) != 0
                number += 1
                if number == len(conditions) or conditions[number].begins:
                    break
            all_hold = all_hold[any_holds]
        return all_hold

    def _carry_out(self, lookup: _Lookup, batch: _Batch, alive: Ints) -> None:
        """All moves of a site."""
        places, reads = alive, lookup.site.reads
        if reads & Reads.IF_FAULTS:
            places = places[batch.faulty[places]]
        if reads & Reads.IF_FILLED:
            places = places[batch.here[places, lookup.site.slots[0]] != 0]
        if not len(places):
            return
        for row, at in _groups(self._rows(lookup, batch.here, places)):
            for number, plan in enumerate(lookup.plans[row]):
                batch.found.move = lookup.number + number
                self._move(plan, batch, places[at])

    def _move(self, plan: _Plan, batch: _Batch, places: Ints) -> None:
        """Carry out a move in the states at `places`."""
        has = plan.has
        if Has.IF_FAULTS in has:
            places = places[batch.faulty[places]]
        for slot, function in plan.only_if:
            if not len(places):
                return
            places = places[self.numbers(function, batch.here[places, slot]) != 0]
        if not len(places):
            return
        moving = _Moving(self, batch, places, Has.IF_ROOM in has)
        for what, one, other in plan.steps:
            if not len(moving.places):
                break
            STEPS[what](moving, one, other)
        if Has.IF_CHANGED in has:
            moving.leave((moving.there == batch.here[moving.places]).all(axis=1))
        if Has.PAYS in has:
            faults = moving.there[:, self.tables.faults]
            faults -= (faults != 0) & (faults != NOTHING)
        fair = Has.FAIR in has and Has.FAULT not in has
        batch.found.take(moving.places, fair)
        for parents, texts in moving.bad:
            rows = batch.found.room(len(parents))
            rows[:], rows[:, 0], rows[:, 1] = 0, NOTHING, texts
            batch.found.take(parents, fair)
            moving.places = np.concatenate((moving.places, parents))
        if Has.FAULT not in has:
            batch.alone[moving.places] = False

    # --- tables that the model fills --------------------------------------------------------------

    def _rows(self, lookup: _Lookup, here: Ints, places: Ints) -> Ints:
        """The number of the row of each state."""
        slots = lookup.site.slots
        columns = [here[places, slot] for slot in slots] or [np.zeros(len(places), np.uint16)]
        rows, new = np.zeros(len(places), np.int32), np.zeros(0, np.intp)
        for depth, values in enumerate(columns):
            if depth == len(lookup.tables):
                lookup.tables.append(_Pairs())
            rows, new = lookup.tables[depth].numbers(rows, values)
        for place in new.tolist():
            self._fill(lookup, *(int(here[places[place], slot]) for slot in slots))
        return rows

    def _fill(self, lookup: _Lookup, *values: int) -> None:
        row: Row = lookup.site.row(*values)
        lookup.wrong.append(row.wrong)
        lookup.plans.append(tuple(map(_plan, row.moves)))
        if len(row.moves) > MOST_MOVES:
            raise TooLarge

    def numbers(self, function: int, values: Ints) -> Ints:
        """What a function makes of each value."""
        while function >= len(self._maps):
            self._maps.append(np.full(64, UNKNOWN, np.int32))
        table = self._maps[function]
        if not len(values):
            return np.zeros(0, np.int32)
        most = int(values.max()) + 1
        if most > len(table):
            new = np.full(_room(len(table), most), UNKNOWN, np.int32)
            new[: len(table)] = table
            table = self._maps[function] = new
        result = table[values]
        missing = result == UNKNOWN
        if missing.any():
            for value in np.unique(values[missing]).tolist():
                number = int(self.tables.functions[function](value))
                check_numbers((number if number >= 0 else -number,))
                table[value] = number
            result = table[values]
        return result

    # --- states -----------------------------------------------------------------------------------

    def _note(self, found: _Candidates, start: int, looked: int, dead: Ints) -> None:
        """Number the successors of the first `looked` states of the batch, but not of dead ones."""
        row, parent = found.row[: found.count], found.parent[: found.count]
        order, fair = found.order[: found.count], found.fair[: found.count]
        if dead.any() or looked < len(dead):
            keep = (parent < looked) & ~dead[parent]
            row, parent, order, fair = row[keep], parent[keep], order[keep], fair[keep]
        words = _words(row)
        hashes = _hashed(words)
        numbers = self._known(words, hashes)
        new = np.flatnonzero(numbers == NONE)
        if len(new):
            new = new[np.lexsort((order[new], parent[new]))]
            numbers[new] = self._new(words[new], hashes[new], start + parent[new])
        self.now.edges += len(parent)
        fair_ones = np.flatnonzero(fair)
        by_parent = fair_ones[np.argsort(parent[fair_ones].astype(np.uint16), kind="stable")]
        end = self._fair_used + len(by_parent)
        self._fair = _grown(self._fair, end)
        self._fair[self._fair_used : end] = numbers[by_parent]
        self._fair_used = end
        counts = np.bincount(parent[by_parent], minlength=looked)
        self._fairs[start : start + looked] = counts[:looked]

    def _known(self, words: Ints, hashes: Ints) -> Ints:
        """The number of each state, or NONE where it is new."""
        numbers = np.full(len(hashes), NONE, np.int32)
        mask = np.uint64(len(self._places) - 1)
        states = _words(self._states)
        left, place = np.arange(len(hashes)), hashes & mask
        while len(left):
            number = self._places[place] - 1
            there = number >= 0
            left, place, number = left[there], place[there], number[there]
            same = self._hashes[number] == hashes[left]
            alike = np.flatnonzero(same)
            differ = (states[number[alike]] != words[left[alike]]).any(axis=1)
            same[alike[differ]] = False
            numbers[left[same]] = number[same]
            left, place = left[~same], (place[~same] + np.uint64(1)) & mask
        return numbers

    def _new(self, words: Ints, hashes: Ints, parents: Ints) -> Ints:
        """The numbers of new states, of which several may be the same; in the order given."""
        _, first, which = np.unique(hashes, return_index=True, return_inverse=True)
        if (words[first[which]] != words).any():  # two states have the same hash
            _, first, which = np.unique(words, axis=0, return_index=True, return_inverse=True)
        rank = np.empty(len(first), np.int32)
        by_first = np.argsort(first)
        rank[by_first] = np.arange(len(first))
        before = self.now.states
        end = before + len(first)
        if end >= NOTHING << 15:
            raise TooLarge
        self._states, self._hashes = _grown(self._states, end), _grown(self._hashes, end)
        self._parents, self._fairs = _grown(self._parents, end), _grown(self._fairs, end)
        self._good = _grown(self._good, end)
        kept = first[by_first]
        _words(self._states)[before:end] = words[kept]
        self._hashes[before:end], self._parents[before:end] = hashes[kept], parents[kept]
        self.now.states = end
        if 2 * end > len(self._places):
            self._places = np.zeros(_room(len(self._places), 4 * end), np.int32)
            before, kept = 0, np.arange(end)
        self._insert(before, end)
        return (rank + (end - len(first)))[which]

    def _insert(self, start: int, end: int) -> None:
        """Enter states into the table of places."""
        mask = np.uint64(len(self._places) - 1)
        number = np.arange(start + 1, end + 1, dtype=np.int32)
        place = self._hashes[start:end] & mask
        while len(number):
            free = self._places[place] == 0
            self._places[place[free]] = number[free]  # of several, one stays
            lost = self._places[place] != number
            number, place = number[lost], (place[lost] + np.uint64(1)) & mask

    # --- backwards --------------------------------------------------------------------------------

    def stuck(self) -> int:
        """The first state from which rest is out of reach; -1 where there is none."""
        looked = self.now.looked
        good = self._good[: self.now.states] & 1 != 0
        good[looked:] = True
        ends = np.concatenate(([0], np.cumsum(self._fairs[:looked], dtype=np.int64)))
        blocks = [(at, min(at + LARGEST, looked)) for at in range(0, looked, LARGEST)]
        changed = True
        while changed:
            changed = False
            for at, end in reversed(blocks):
                while self._spread(good, ends, at, end):
                    changed = True
        bad = np.flatnonzero(~good[:looked] & (self._good[:looked] & 2 == 0))
        return int(bad[0]) if len(bad) else NONE

    def _spread(self, good: Ints, ends: Ints, at: int, end: int) -> bool:
        """A state is good if a fair move leads to a good one."""
        if good[at:end].all():
            return False
        first = int(ends[at])
        hits = np.concatenate(([0], np.cumsum(good[self._fair[first : int(ends[end])]])))
        now = good[at:end] | (np.diff(hits[ends[at : end + 1] - first]) > 0)
        changed = bool((now != good[at:end]).any())
        good[at:end] = now
        return changed


class _Moving:
    """A move that is carried out in some states: `places` in the batch, `there` what they become,
    `bad` those that went wrong, with the number of the text.
    """

    def __init__(self, search: Batches, batch: _Batch, places: Ints, if_room: bool) -> None:
        self.search, self.batch, self.places, self.if_room = search, batch, places, if_room
        self.bad: list[tuple[Ints, Ints]] = []
        self.there = batch.found.room(len(places))
        np.take(batch.here, places, axis=0, out=self.there, mode="clip")

    def leave(self, gone: Ints, texts: Ints | None = None) -> None:
        """The move does not happen in some states, or goes wrong there."""
        if not gone.any():
            return
        if texts is not None:
            self.bad.append((self.places[gone], texts))
        self.places, rest = self.places[~gone], self.there[~gone]
        self.there = self.batch.found.room(len(rest))
        self.there[:] = rest

    def set(self, slot: int, value: int) -> None:
        """SET."""
        self.there[:, slot] = value

    def copy(self, slot: int, other: int) -> None:
        """COPY."""
        self.there[:, slot] = self.there[:, other]

    def map(self, slot: int, function: int) -> None:
        """MAP."""
        numbers = self.search.numbers(function, self.there[:, slot])
        gone = numbers < 0
        if gone.any():
            self.leave(gone, None if self.if_room else -numbers[gone] - 1)
            numbers = numbers[~gone]
        self.there[:, slot] = numbers

    def take(self, number: int, _: int) -> None:
        """TAKEN."""
        self.batch.taken.append((number, int(self.places[0])))

    def is_bad(self, text: int, _: int) -> None:
        """IS_BAD."""
        self.leave(np.ones(len(self.places), bool), np.full(len(self.places), text))

    def never(self, text: int, conditions: tuple[If, ...]) -> None:
        """NEVER."""
        gone = np.zeros(len(self.places), bool)
        gone[self.search.all_hold(self.there, np.arange(len(gone)), conditions)] = True
        self.leave(gone, np.full(np.count_nonzero(gone), text))


STEPS: dict[int, Callable[[_Moving, Any, Any], None]] = {
    Do.SET: _Moving.set,
    Do.COPY: _Moving.copy,
    Do.MAP: _Moving.map,
    Do.TAKEN: _Moving.take,
    Do.IS_BAD: _Moving.is_bad,
    Do.NEVER: _Moving.never,
}


def _plan(move: Move) -> _Plan:
    """The steps of a move, each as what it does and two parameters."""
    only_if, steps = [], []
    left: Iterator[Any] = iter(move.steps)
    for step in left:
        if isinstance(step, If):
            raise AssertionError(step)
        what, one, other = step
        if what == Do.ONLY_IF:
            only_if.append((one, other))
        elif what == Do.NEVER:
            steps.append((what, one, tuple(next(left) for _ in range(other))))
        else:
            if what == Do.SET:
                check_numbers((other,))
            steps.append((int(what), one, other))
    return _Plan(frozenset(move.has), tuple(only_if), tuple(steps))


def _groups(rows: Ints) -> Iterator[tuple[int, Ints]]:
    """Each row and the places, in order, where it stands."""
    if len(rows) == 1:
        yield int(rows[0]), np.zeros(1, np.intp)
        return
    order = np.argsort(rows.astype(np.uint16) if rows.max() < NOTHING else rows, kind="stable")
    sorted_rows = rows[order]
    cuts = np.flatnonzero(np.diff(sorted_rows)) + 1
    for start, end in zip([0, *cuts.tolist()], [*cuts.tolist(), len(rows)], strict=True):
        yield int(sorted_rows[start]), order[start:end]


def _words(states: Ints) -> Ints:
    """The same memory, four slots in a word."""
    return states.view(np.uint64)


def _hashed(words: Ints) -> Ints:
    result = np.full(len(words), 0x9E3779B97F4A7C15, np.uint64)
    for column in range(words.shape[1]):
        result ^= words[:, column]
        result *= np.uint64(MULTIPLIER)
        result ^= result >> np.uint64(32)
    return result


def _room(now: int, need: int) -> int:
    while now < need:
        now *= 2
    return now


def _grown(array: Ints, need: int) -> Ints:
    """The array with room for `need` rows."""
    if need <= len(array):
        return array
    new = np.zeros((_room(len(array), need), *array.shape[1:]), array.dtype)
    new[: len(array)] = array
    return new
