"""Saying samples again, on time: the clock, the times inside communicates, how it went, and what
differs then.
"""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from agent_runtime.impersonation import Stage
from agent_runtime.io.tap import Sample
from console.traffic.listen import heard_message
from fipa_codec.communicate import Communicate, encode
from operate.system import System

LOOK_S = 0.1


class Replayed(msgspec.Struct, frozen=True):
    """Result of a replay: communicates and other samples sent, duration [s], recorded duration [s],
    greatest delay [s].

    `late_s` None: as fast as possible, so nothing could be late.
    """

    communicates: int
    others: int
    loops: int
    seconds: float
    recorded_s: float
    late_s: float | None
    system: str
    connect: str


def moved(one: Communicate, recorded_at: float, now: float, fast: float | None) -> Communicate:
    """A communicate that was heard then, as if it were said now: as old as it was, with as much
    time for an answer.

    Slower than recorded, there is so much more time.
    """
    stretch = max(1.0, 1 / fast) if fast else 1.0
    reply_by = None if one.reply_by is None else now + (one.reply_by - recorded_at) * stretch
    sent = now - (recorded_at - one.sent) if one.sent else 0.0
    return msgspec.structs.replace(one, sent=sent, reply_by=reply_by)


def sentence(done: Replayed) -> str:
    """Return the result in one line."""
    also = f" and {done.others} other things" if done.others else ""
    times = f", {done.loops} times over" if done.loops > 1 else ""
    late = "" if done.late_s is None else f"; at most {1000 * done.late_s:.1f} ms late"
    took = f"in {done.seconds:.1f} s (recorded in {done.recorded_s:.1f} s)"
    return f"{done.communicates} communicates{also} said again{times} {took}{late}"


class Player:
    """Says samples again, on time."""

    def __init__(
        self,
        stage: Stage,
        samples: list[Sample],
        fast: float | None,
        seen: Callable[[Sample], None] = lambda _: None,
    ) -> None:
        """`seen`: is told each sample as it was put."""
        self._seen = seen
        self._stage, self._samples, self._fast = stage, samples, fast
        self._communicates = self._others = self._loops = 0
        self._late, self._began = 0.0, time.monotonic()
        self._span = samples[-1].at - samples[0].at

    def play(self, look: Callable[[str], None]) -> None:
        """All of it once; `look` is told how far it is."""
        first, begun = self._samples[0].at, time.monotonic()
        self._loops += 1
        self._began = begun if self._loops == 1 else self._began
        for sample in self._samples:
            if self._fast:
                due = begun + (sample.at - first) / self._fast
                self.wait(due)
                self._late = max(self._late, time.monotonic() - due)
            self._say(sample)
            said = f"{self._communicates} communicates"
            look(f"{sample.at - first:.1f} s of {self._span:.1f} s, {said}")

    def wait(self, due: float) -> None:
        """Until then [monotonic s]."""
        while (left := due - time.monotonic()) > 0:
            time.sleep(min(left, LOOK_S))

    def _say(self, sample: Sample) -> None:
        key, one = sample.key.split("/", 2)[2], heard_message(sample)
        communicate = one.communicate() if one is not None else None
        now, data = time.time(), sample.data
        if communicate is not None:
            data = encode(moved(communicate, sample.at, now, self._fast))
        self._stage.put(key, data)
        self._seen(Sample(f"roco/{self._stage.system}/{key}", data, now))
        self._communicates += one is not None
        self._others += one is None

    def done(self) -> Replayed:
        """Return the totals of what was sent so far."""
        seconds, late = time.monotonic() - self._began, self._late if self._fast else None
        counts = (self._communicates, self._others, self._loops)
        where = (self._stage.system, self._stage.endpoint)
        return Replayed(*counts, round(seconds, 3), round(self._span, 3), late, *where)


# --- Where what is said, or put out, differs from what is recorded --------------------------------


MOST_WORDS = 160


def difference(was: Any, now: Any, place: str = "") -> tuple[str, Any, Any] | None:
    """The first place where two values differ, and what stands there in both; None where they are
    the same.
    """
    if type(was) is not type(now):
        return place, was, now
    if isinstance(was, dict):
        for key in (*was, *(key for key in now if key not in was)):
            where = f"{place}.{key}" if place else str(key)
            if key not in was or key not in now:
                return where, was.get(key), now.get(key)
            found = difference(was[key], now[key], where)
            if found is not None:
                return found
        return None
    if isinstance(was, list):
        for n, (one, other) in enumerate(zip(was, now, strict=False)):
            found = difference(one, other, f"{place}[{n}]")
            if found is not None:
                return found
        return None if len(was) == len(now) else (f"{place} (length)", len(was), len(now))
    return None if was == now else (place, was, now)


def short(value: Any) -> str:
    """A value in JSON, cut off where it is long; None: nothing."""
    text = "nothing" if value is None else msgspec.json.encode(value).decode()
    return text if len(text) <= MOST_WORDS else text[: MOST_WORDS - 1] + "…"


def as_agent(system: System, run: Path, settings: dict[str, str]) -> dict[str, str]:
    """The environment of an agent of this system that is run again; `settings`: its options, as in
    ROCO_NAME.
    """
    settings = {"TLS_DIR": "", "LOG_LEVEL": "error"} | settings
    own = {f"ROCO_{name}": value for name, value in settings.items()}
    return os.environ | system.environment(run) | own


def compared(recorded: Any, now: Any) -> str:
    """Both values of a difference, a line for each."""
    return f"  recorded: {short(recorded)}\n  now:      {short(now)}"
