"""Rate limit for reports of one kind, so that a sender of many wrong messages fills no disk: pure, without a clock.

The first of a kind are told one by one. What comes beyond them within a window is counted, and told as one number when
the window is over.
"""

import math
from collections.abc import Hashable
from typing import Generic, TypeVar

K = TypeVar("K", bound=Hashable)

SINGLY = 20
"""Reports of a kind in a window that are told one by one; estimate: a person reads no more of them."""
WINDOW_S = 10.0
KINDS = 1024
"""Kinds in a window; what is of further ones is not told singly, and counted together. Estimate: there are dozens."""


class Repeats(Generic[K]):
    """Of one log; `look_at`: when `over` has something to tell [s]."""

    def __init__(self, others: K) -> None:
        """`others`: the kind under which those beyond KINDS are counted."""
        self._others = others
        self._seen: dict[K, int] = {}
        self._until = -math.inf
        self.look_at = math.inf

    def told(self, kind: K, now: float) -> bool:
        """Note a report at `now` [s]; whether it is to be told. Call `over` before."""
        if not self._seen:
            self._until = now + WINDOW_S
        if kind not in self._seen and len(self._seen) >= KINDS:
            kind = self._others
            self._seen.setdefault(kind, SINGLY)
        count = self._seen[kind] = self._seen.get(kind, 0) + 1
        if count > SINGLY:
            self.look_at = self._until
        return count <= SINGLY

    def over(self, now: float) -> list[tuple[K, int]]:
        """Return how many of which kind were not told in the window that is over by `now` [s], which is forgotten."""
        if now < self._until:
            return []
        withheld = [(kind, count - SINGLY) for kind, count in self._seen.items() if count > SINGLY]
        self._seen, self.look_at = {}, math.inf
        return withheld
