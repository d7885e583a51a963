"""Layout of figures: cells for the agents of a system, tracks for lines that run beside each other.

Agents stand in two rows of cells, so that channels are short and cross little. Between the rows is a corridor that no
box reaches into, so a line from one row to the other meets no box; lines inside a row run between neighbours or outside
around. The search is a descent from several starts, the same every time.
"""

from collections.abc import Sequence
from itertools import combinations

Pair = tuple[str, str]
Span = tuple[float, float]
Cell = tuple[int, int]
"""Row (0 above, 1 below) and column."""


def placed(names: Sequence[str], pairs: Sequence[Pair]) -> dict[str, Cell]:
    """A cell for each name."""
    columns = max(1, (len(names) + 1) // 2)
    seats: list[str] = [*names, *[""] * (2 * columns - len(names))]
    starts = (seats[turn:] + seats[:turn] for turn in range(len(seats)))
    found = [turned for start in starts for turned in _turned(_descended(start, pairs), columns)]
    best = min(found, key=lambda seating: _judged(seating, names, pairs))
    return {name: cell for name, cell in _cells(best).items() if name}


def _descended(seats: list[str], pairs: Sequence[Pair]) -> list[str]:
    """Swap two seats as long as that is better."""
    here, cost = seats, _cost(seats, pairs)
    while True:
        swapped = [_swapped(here, i, j) for i, j in combinations(range(len(here)), 2)]
        best = min(swapped, key=lambda seating: _cost(seating, pairs), default=here)
        if _cost(best, pairs) >= cost:
            return here
        here, cost = best, _cost(best, pairs)


def _turned(seats: list[str], columns: int) -> list[list[str]]:
    """The same picture, also upside down, in a mirror, and both."""
    above, below = seats[:columns], seats[columns:]
    mirrored = above[::-1], below[::-1]
    return [seats, below + above, mirrored[0] + mirrored[1], mirrored[1] + mirrored[0]]


def _judged(seats: list[str], names: Sequence[str], pairs: Sequence[Pair]) -> tuple[int, list[int]]:
    """The cost; of equals, the first names should stand first."""
    return _cost(seats, pairs), [seats.index(name) for name in names]


def _swapped(seats: list[str], i: int, j: int) -> list[str]:
    other = list(seats)
    other[i], other[j] = other[j], other[i]
    return other


def _cells(seats: Sequence[str]) -> dict[str, Cell]:
    columns = len(seats) // 2
    return {name: divmod(index, columns) for index, name in enumerate(seats)}


def _cost(seats: Sequence[str], pairs: Sequence[Pair]) -> int:
    """Lengths and crossings; round outside is worst. The weights are estimates, judged by the look of the result."""
    cells = _cells(seats)
    ends = [(cells[a], cells[b]) for a, b in pairs]
    across = [(a[1], b[1]) if a[0] == 0 else (b[1], a[1]) for a, b in ends if a[0] != b[0]]
    crossings = sum((a - c) * (b - d) < 0 for (a, b), (c, d) in combinations(across, 2))
    return 40 * crossings + sum(_length(a, b) for a, b in ends)


def _length(one: Cell, other: Cell) -> int:
    distance = abs(one[1] - other[1])
    if one[0] != other[0]:
        return 10 + 15 * distance
    return 11 if distance == 1 else 40 + 20 * distance


def tracks(spans: Sequence[Span], gap: float = 8.0) -> list[int]:
    """A track (0: the innermost) for each span, short ones inside; spans in one track are `gap` apart."""
    taken: list[list[Span]] = []
    found = [0] * len(spans)
    for index in sorted(range(len(spans)), key=lambda i: (abs(spans[i][1] - spans[i][0]), i)):
        low, high = sorted(spans[index])
        track = 0
        while track < len(taken) and any(low < b + gap and a < high + gap for a, b in taken[track]):
            track += 1
        if track == len(taken):
            taken.append([])
        taken[track].append((low, high))
        found[index] = track
    return found


def spread(count: int, low: float, high: float) -> list[float]:
    """Return `count` positions between two ends, at equal distances."""
    return [low + (high - low) * (number + 1) / (count + 1) for number in range(count)]
