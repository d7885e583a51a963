"""Processes of this machine, or of a container, as Linux tells of them (man 5 proc): the only
reader of their files.

What processes were started with is in agent_runtime.io.fleet_processes.
"""

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import msgspec

PROC = Path("/proc")
TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")
PAGE = os.sysconf("SC_PAGE_SIZE")
FROZEN, ENDED = "T", "Z"
"""State of a process that was stopped by a signal, and of one that has ended unknown to its
parent.
"""


class Stat(msgspec.Struct, frozen=True):
    """A line of /proc/PID/stat, as far as it is wanted. `start`: when the process started [ticks
    after boot].
    """

    pid: int
    parent: int
    state: str
    ticks: int
    pages: int
    start: int = 0


class Used(msgspec.Struct, frozen=True):
    """A process and those below it: processor time [s] so far, resident memory [bytes]; `frozen`:
    it may not run.

    `start`: when the process itself started [ticks after boot]: another one under the same pid
    started later.
    """

    cpu_s: float
    memory: int
    frozen: bool
    start: int = 0


def stats(lines: Iterable[str]) -> dict[int, Stat]:
    """Lines of /proc/*/stat by pid; what is not whole is left out."""
    found = {}
    for line in lines:
        head, _, rest = line.rpartition(")")  # the name before it may have blanks and parentheses
        fields = rest.split()
        if len(fields) > 21:
            pid = int(head.split(" ", 1)[0])
            ticks = int(fields[11]) + int(fields[12])
            found[pid] = Stat(
                pid, int(fields[1]), fields[0], ticks, int(fields[21]), int(fields[19])
            )
    return found


def stats_here(pid: int | None = None) -> dict[int, Stat]:
    """The processes of this machine, or one of them, by pid; what ends meanwhile is left out."""
    return stats(data.decode(errors="replace") for _, data in _files("stat", pid))


def used(pid: int, found: Mapping[int, Stat]) -> Used | None:
    """What a process and its children use; None if it does not exist or has ended."""
    if pid not in found or found[pid].state == ENDED:
        return None
    tree, grown = {pid}, 0
    while grown != len(tree):
        grown = len(tree)
        tree |= {stat.pid for stat in found.values() if stat.parent in tree}
    ticks, pages = (sum(getattr(found[one], name) for one in tree) for name in ("ticks", "pages"))
    return Used(TICK_S * ticks, PAGE * pages, found[pid].state == FROZEN, found[pid].start)


def started(pid: int) -> int:
    """When a process of this machine started [ticks after boot]; 0: there is none."""
    found = stats_here(pid).get(pid)
    return found.start if found is not None and found.state != ENDED else 0


def command_line(pid: int) -> tuple[str, ...]:
    """What a process was called with; () of one that is not there, or has ended and its parent has
    not looked.
    """
    return next((called for _, called in every_words(pid)), ())


def every_words(pid: int | None = None) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Yield each process of this machine, or one of them, with what it was called with."""
    for number, data in _files("cmdline", pid):
        yield number, tuple(data.decode(errors="surrogateescape").split("\0")[:-1])


def _files(name: str, pid: int | None) -> Iterator[tuple[int, bytes]]:
    for file in PROC.glob(f"{'[0-9]*' if pid is None else pid}/{name}"):
        try:
            yield int(file.parent.name), file.read_bytes()
        except OSError:  # it has ended since
            continue
