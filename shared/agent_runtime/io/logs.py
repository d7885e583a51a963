"""Structured logs: every event as one JSON line in a file, and what the level asks for as a short
line on the console.

Each line has time, agent and event; lines about a conversation have its id. A flood fills no disk:
lines that blame somebody are told singly up to a number, then as a sum; a file that is full becomes
the last but one.
"""

import logging
import math
import sys
import time
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import suppress
from io import FileIO
from pathlib import Path
from typing import Any, Generic, TextIO, TypeVar

import msgspec

# --- The clock of an agent ------------------------------------------------------------------------
# The wall time at which the process started, and from there the time that really passed.
# A wall clock may be set: back, and everything that is due waits for the hours to come again;
# forward, and every deadline is over at once. This one does neither while the process lives. A
# restart begins with the wall time of then: deadlines in the journal are absolute, so one that was
# set before the clock was moved is off by that once.


class Clock:
    """`now`: unix seconds, even. `wall`, `steady`: the clocks of the system."""

    def __init__(
        self, wall: Callable[[], float] = time.time, steady: Callable[[], float] = time.monotonic
    ) -> None:
        self._steady = steady
        self._offset = wall() - steady()

    def now(self) -> float:
        """The time [unix s]; it never goes back."""
        return self._offset + self._steady()


clock = Clock()
"""The clock of this process."""


# --- Rate limit for reports of one kind, so that a sender of many wrong messages fills no disk:
# pure, without a clock The first of a kind are told one by one. What comes beyond them within a
# window is counted, and told as one number when the window is over.


K = TypeVar("K", bound=Hashable)

SINGLY = 20
"""Reports of a kind in a window that are told one by one; estimate: a person reads no more of
them.
"""
WINDOW_S = 10.0
KINDS = 1024
"""Kinds in a window; what is of further ones is not told singly, and counted together. Estimate:
there are dozens.
"""


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
        """How many of which kind were not told in the window that is over by `now` [s], which is
        forgotten.
        """
        if now < self._until:
            return []
        withheld = [(kind, count - SINGLY) for kind, count in self._seen.items() if count > SINGLY]
        self._seen, self.look_at = {}, math.inf
        return withheld


# --- Structured logs ------------------------------------------------------------------------------


LEVELS = {
    "debug": logging.DEBUG,
    "info": logging.INFO,
    "warning": logging.WARNING,
    "error": logging.ERROR,
}


MOST_BYTES = 32 * 1024 * 1024
"""Of a log file; then it is FILE.1, and the FILE.1 before it is gone. Estimate: a pour writes 0.3
MB in a minute.
"""
MORE = "more of a kind"
"""Event of a line that sums up lines that were not written."""
_Line = tuple[float, str, str, dict[str, Any]]
_Kind = tuple[str, str, str]


class Log:
    """`file`: JSON lines are appended there, from debug on; `level`: the least that the console
    shows.

    Lines that the disk does not take are lost, and how many is the next line that it takes.
    """

    def __init__(
        self,
        agent: str,
        level: str = "info",
        file: Path | None = None,
        console: TextIO | None = None,
    ) -> None:
        """Raises ValueError for an unknown level."""
        if level not in LEVELS:
            raise ValueError(f"log level {level!r} is none of {', '.join(LEVELS)}")
        self._agent = agent
        self._least = LEVELS[level]
        self._lost, self._torn = 0, False
        self._file: FileIO | None = None
        if file is not None:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._file = FileIO(file, "a")
        self._path, self._size = file, self._file.tell() if self._file is not None else 0
        self._repeats = Repeats[_Kind](("", "warning", "others"))
        self._console = console or sys.stdout

    def show(self, level: str) -> None:
        """Set the least level that the console shows. Raises KeyError for an unknown one."""
        self._least = LEVELS[level]

    def write(self, event: str, level: str = "info", **fields: Any) -> None:
        self.write_all([(clock.now(), event, level, fields)])

    def write_all(self, lines: Sequence[_Line]) -> None:
        """Lines in one go: of each the time [unix s], the event, its level and its fields."""
        told = [*self._summed(lines[0][0] if lines else clock.now())]
        told += [
            line for line in lines if not _blames(line) or self._repeats.told(_kind(line), line[0])
        ]
        self._put(told)

    def look(self) -> None:
        """Write the sums that are due."""
        if self._repeats.look_at <= clock.now():
            self._put([*self._summed(clock.now())])

    def _summed(self, now: float, *, last: bool = False) -> Iterator[_Line]:
        for (event, level, who), count in self._repeats.over(math.inf if last else now):
            why = f"… {count:,} more of this kind from {who or 'here'} in {WINDOW_S:g} s"
            yield now, MORE, level, {"of": event, "count": count, "why": why}

    def _put(self, lines: Sequence[_Line]) -> None:
        if self._file is not None:
            self._append(self._file, b"".join(self._line(*line) for line in lines), len(lines))
        for at, event, level, fields in lines:
            if LEVELS.get(level, logging.ERROR) >= self._least:
                with suppress(OSError):  # a file, too, under a supervisor
                    # one write: others have threads
                    self._console.write(self._short(at, event, level, fields) + "\n")
                    self._console.flush()

    def _line(self, at: float, event: str, level: str, fields: dict[str, Any]) -> bytes:
        line = {"agent": self._agent, "t": at, "level": level, **fields, "event": event}
        return _encoder.encode(line) + b"\n"

    def _short(self, at: float, event: str, level: str, fields: dict[str, Any]) -> str:
        """`12:00:01.123 ta   sent  inform to co  co-1-4`: time, agent, event, the rest as words."""
        rest = " ".join(
            f"{name}={value}"
            for name, value in fields.items()
            if name != "conversation" and value not in ("", None)
        )
        when = time.strftime("%H:%M:%S", time.localtime(at)) + f".{int(at % 1 * 1000):03d}"
        mark = {"warning": "! ", "error": "!! "}.get(level, "")
        parts = (when, f"{self._agent:<6}", f"{mark}{event}", rest, fields.get("conversation", ""))
        return " ".join(part for part in parts if part)

    def _append(self, file: FileIO, data: bytes, count: int) -> None:
        if self._lost:
            why = f"{self._lost} lines before this one are lost: the disk took nothing"
            data = (
                b"\n" * self._torn
                + self._line(clock.now(), "lines lost", "warning", {"why": why})
                + data
            )
        try:
            taken = file.write(data)
        except OSError:
            taken = 0
        if taken == len(data):
            self._lost = 0
            self._torn = False
        else:
            self._lost += count
            self._torn = self._torn or bool(taken)
        self._size += taken or 0
        if self._size > MOST_BYTES and self._path is not None:
            file.close()
            self._path.replace(before(self._path))
            self._file, self._size = FileIO(self._path, "a"), 0

    def close(self) -> None:
        """Write the sums of what was not written, close the file."""
        self._put([*self._summed(clock.now(), last=True)])
        if self._file is not None:
            self._file.close()
            self._file = None


def before(file: Path) -> Path:
    """The file in which the lines are that were written before those in `file`."""
    return file.with_name(f"{file.name}.1")


def _blames(line: _Line) -> bool:
    """Whether a line is of the kinds that others can cause at will."""
    return line[2] not in ("info", "debug") or "sender" in line[3]


def _kind(line: _Line) -> _Kind:
    _, event, level, fields = line
    who = next((str(fields[name]) for name in ("sender", "peer", "key") if fields.get(name)), "")
    return f"{event} {fields.get('verdict', '')}".strip(), level, who


_encoder = msgspec.json.Encoder(enc_hook=str)
