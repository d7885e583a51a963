"""Errors of the command line; each message says what to do, each kind has its exit code.

ConsoleError
    UsageError      what was named is not there, or makes no sense
NoRunError      no run exists to talk about
    FleetError      the fleet did not come up, or not go down
    NotWaitedError  Ctrl-C while the fleet ends: it goes on ending
    DockerError     docker is not there, or did not do what was asked
    MissingExtraError  what an extra of the distribution installs is not there
"""

from collections.abc import Iterator
from contextlib import contextmanager

AS_WANTED = 0
NO = 1
"""It failed, or what was asked is answered with no: not ready, refused, a finding, a violation."""
WRONG_USE = 2
"""An option, a name or a file is not as it must be; calling it again the same way cannot help."""
NOTHING_RUNS = 3
"""There is nothing to ask: no run, no fleet, nobody who listens to people."""
INTERRUPTED = 130
"""Ctrl-C, as shells count it: 128 and the signal's number; for SIGTERM and SIGHUP, which end a
command alike, too.
"""


class ConsoleError(Exception):
    """Base of them all; the command line prints it and exits with its code."""

    code = NO


class UsageError(ConsoleError):
    """A named thing does not exist or makes no sense."""

    code = WRONG_USE


class NoRunError(ConsoleError):
    """The run folder was not found where it was looked for."""

    code = NOTHING_RUNS

    def __init__(self, where: str, words: str = "") -> None:
        self.where = where
        super().__init__(
            words or f"no run at {where}; start one with `roco up`, or name it with --run-dir"
        )


class FleetError(ConsoleError):
    """The fleet is not as wanted; `processes`: who, and why, in words."""

    def __init__(self, what: str, processes: tuple[str, ...] = ()) -> None:
        self.what = what
        self.processes = processes
        super().__init__("\n  ".join([what, *processes]))


class NotWaitedError(ConsoleError):
    """Ctrl-C while the fleet ends; it goes on ending in the background."""

    code = INTERRUPTED

    def __init__(self, run: str, names: tuple[str, ...]) -> None:
        of = f" of {', '.join(names)}" if names else ""
        goes_on = f"the end{of} goes on in the background; `roco down --run-dir {run}` waits for it"
        super().__init__(f"not waited for: {goes_on}")


class DockerError(ConsoleError):
    """Docker is not there, or did not do what was asked."""


class MissingExtraError(ConsoleError):
    """What an extra installs is not there."""

    def __init__(self, what: str, extra: str) -> None:
        how = f"pip install 'robot-companion[{extra}]'"
        super().__init__(f"{what} is not installed here: {how}")


@contextmanager
def needing(extra: str) -> Iterator[None]:
    """Raise MissingExtraError where an import within needs this extra."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise MissingExtraError(str(error.name), extra) from error


def last_line(output: bytes) -> str:
    """Return the last line that a process wrote, "" where it wrote none."""
    return output.decode(errors="replace").strip().rpartition("\n")[2]
