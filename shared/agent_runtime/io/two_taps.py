"""Listening at both of two linked routers, so that nothing is missed while one of them is away.

A tap that goes from a router that died to the other one comes there some milliseconds after the agents, and misses what
they say first. So a recorder has a tap at each. Every sample comes twice then; the first of the two is handed on, and
its twin is dropped. Each tap keeps the order of a sender, so the first ones are in order, too.
"""

import threading
import time
from collections.abc import Callable

import msgspec

from agent_runtime.core.peers import LINKED_GRACE_S
from agent_runtime.io.options import Options
from agent_runtime.io.tap import Sample, Tap, open_tap

TWIN_S = 3.0
"""Longest wait for a sample's twin; a router that hangs is noticed after 2 s, the lease (estimate: a little more)."""
LOOK_S = 0.01
Name = tuple[str, bytes]


class Twins:
    """One stream of samples out of those of two taps, 0 and 1; safe for threads."""

    def __init__(self, on_sample: Callable[[Sample], None]) -> None:
        self._on_sample, self._lock = on_sample, threading.Lock()
        self._up = [False, False]
        self._ahead: tuple[dict[Name, tuple[int, float]], ...] = ({}, {})
        self._tokens: tuple[set[str], ...] = (set(), set())
        self._told: set[str] = set()
        self._doubted: dict[str, Sample] = {}
        self._deaf_since = 0.0

    @property
    def up(self) -> bool:
        """Whether one of the taps has its router."""
        return any(self._up)

    def heard(self, which: int, sample: Sample) -> None:
        """Hand a sample of a tap on, unless the other tap's twin was."""
        with self._lock:
            if sample.token:
                self._token(which, sample)
            elif not self._taken(self._ahead[1 - which], (sample.key, sample.data)):
                if self._up[1 - which]:
                    self._note(self._ahead[which], (sample.key, sample.data), sample.at)
                self._on_sample(sample)

    def router(self, which: int, up: bool, now: float) -> None:
        """A tap has its router, or lost it; while both have none nothing is heard."""
        with self._lock:
            deaf = not any(self._up)
            self._up[which] = up
            if not up:
                self._ahead[1 - which].clear()  # their twins will not come
            if deaf and up and self._deaf_since:
                self._on_sample(Sample("", b"", now, deaf_since=self._deaf_since))
                self._deaf_since = 0.0
            elif not any(self._up):
                self._deaf_since = self._deaf_since or now

    def _token(self, which: int, sample: Sample) -> None:
        """Tell of a token that one tap sees; and that it vanished once neither has seen it for the grace."""
        if not sample.gone:
            self._tokens[which].add(sample.key)
            if sample.key not in self._told:
                self._told.add(sample.key)
                self._on_sample(sample)
            return
        self._tokens[which].discard(sample.key)
        if sample.key in self._told and sample.key not in self._tokens[1 - which]:
            if not self._doubted:
                self._look_after(LINKED_GRACE_S)
            self._doubted[sample.key] = sample

    def _look_after(self, seconds: float) -> None:
        """One timer for all doubts, however many there are."""
        timer = threading.Timer(seconds, self._look)
        timer.daemon = True
        timer.start()

    def _look(self) -> None:
        """Tell of tokens that vanished long enough ago and are not back."""
        with self._lock:
            now = time.time()
            for key, sample in list(self._doubted.items()):
                back = any(key in tokens for tokens in self._tokens)
                if back or sample.at + LINKED_GRACE_S <= now:
                    del self._doubted[key]
                if not back and key not in self._doubted:
                    self._told.discard(key)
                    self._on_sample(msgspec.structs.replace(sample, at=now))
            if self._doubted:
                self._look_after(LINKED_GRACE_S)

    @staticmethod
    def _taken(ahead: dict[Name, tuple[int, float]], name: Name) -> bool:
        """Whether this is the twin of one that was handed on; then that one has none any more."""
        if name not in ahead:
            return False
        count, at = ahead.pop(name)
        if count > 1:
            ahead[name] = (count - 1, at)
        return True

    @staticmethod
    def _note(ahead: dict[Name, tuple[int, float]], name: Name, at: float) -> None:
        count, _ = ahead.pop(name, (0, 0.0))
        ahead[name] = (count + 1, at)  # the dictionary is in the order of time
        while ahead[first := next(iter(ahead))][1] < at - TWIN_S:
            del ahead[first]


class TwoTaps:
    """The taps at both routers; each comes when its router is there."""

    def __init__(self, options: Options, on_sample: Callable[[Sample], None], told: Callable[[str], None]) -> None:
        self._twins, self._ended = Twins(on_sample), threading.Event()
        self._taps: list[Tap] = []
        self._lock = threading.Lock()
        self._opening = [
            threading.Thread(target=self._open, args=(which, options, address, told), name=f"tap {which}", daemon=True)
            for which, address in enumerate(options.connect.split(","))
        ]
        for thread in self._opening:
            thread.start()

    @property
    def up(self) -> bool:
        """Whether something can be heard."""
        return self._twins.up

    def _open(self, which: int, options: Options, address: str, told: Callable[[str], None]) -> None:
        tap = open_tap(
            msgspec.structs.replace(options, connect=address),
            lambda sample: self._twins.heard(which, sample),
            self._ended.is_set,
            told=told,
            router=lambda up, now: self._twins.router(which, up, now),
        )
        with self._lock:
            if tap is not None:
                self._taps.append(tap)

    def close(self) -> None:
        """Hear no more."""
        self._ended.set()
        for thread in self._opening:
            thread.join()
        for tap in self._taps:
            tap.close()


def open_taps(
    options: Options,
    on_sample: Callable[[Sample], None],
    give_up: Callable[[], bool],
    told: Callable[[str], None],
) -> Tap | TwoTaps | None:
    """A tap of the recorder at each router that `connect` names, as soon as one is there; None when `give_up` says so
    first. `told` gets the reason where a router is not reached.
    """
    if not options.linked:
        return open_tap(options, on_sample, give_up, told=told)
    taps = TwoTaps(options, on_sample, told)
    while not taps.up:
        if give_up():
            taps.close()
            return None
        time.sleep(LOOK_S)
    return taps
