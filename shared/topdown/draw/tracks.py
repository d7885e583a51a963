"""Lines that run beside each other: each gets a track in which it meets no other."""

from collections.abc import Sequence

Span = tuple[float, float]


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
