"""`python scripts/bounded.py SECONDS COMMAND...`: run a command for so long at most; all that it
started ends with it.

A fleet that a test started has a session of its own and its parent is gone, so neither Ctrl-C nor
the end of a process group reaches it. This process becomes the parent of such orphans: whatever the
command left is below it in the tree of processes, and nothing else is. SIGINT, SIGTERM, SIGHUP and
the end of the time interrupt the command as Ctrl-C does; what has not ended after GRACE_S is
killed. Exit code: that of the command, 128 + signal, or 124 when the time is over.
"""

import ctypes
import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
TIME_IS_OVER = 124  # as `timeout` has it
# pytest-xdist gives its workers 10 s; estimate: a fleet ends in order within that time
GRACE_S = 20.0
KILLED_S = 10.0  # estimate: until the kernel has taken down what was killed
LOOK_S = 0.05  # between two looks; estimate: nobody notices
PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h


class Command:
    """The command, in a process group of its own: it is interrupted once, by `interrupt` alone."""

    def __init__(self, words: list[str]) -> None:
        self.pid = os.posix_spawnp(words[0], words, os.environ, setpgroup=0, setsigdef=SIGNALS)
        self.code: int | None = None

    def reap(self) -> None:
        """Take note of what has ended, also of what was left to this process."""
        with suppress(ChildProcessError):
            while (ended := os.waitpid(-1, os.WNOHANG))[0]:
                if ended[0] == self.pid:
                    self.code = os.waitstatus_to_exitcode(ended[1])

    def interrupt(self) -> None:
        """Send SIGINT to its process group: pytest's workers, too, end their fixtures."""
        with suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGINT)

    def kill_left(self) -> list[str]:
        """Kill all that is below this process; return the command lines of what was there."""
        found: dict[int, str] = {}
        until = time.monotonic() + KILLED_S
        self.reap()
        while (living := below(os.getpid())) and time.monotonic() < until:
            for pid in living:
                found.setdefault(pid, _words(pid))
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            time.sleep(LOOK_S)
            self.reap()
        return [words for words in found.values() if words]


def below(pid: int) -> list[int]:
    """Return all descendants of a process."""
    children: dict[int, list[int]] = {}
    for file in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            parent = int(file.read_text(errors="replace").rpartition(")")[2].split()[1])
            children.setdefault(parent, []).append(int(file.parent.name))
    found = list(children.get(pid, ()))
    for one in found:
        found += children.get(one, ())
    return found


def _words(pid: int) -> str:
    """Return the command line of a process; "" where it has ended."""
    with suppress(OSError):
        return (
            Path(f"/proc/{pid}/cmdline")
            .read_bytes()
            .replace(b"\0", b" ")
            .decode(errors="replace")
            .strip()
        )
    return ""


def main(seconds: float, words: list[str]) -> int:
    """Run the command; return the exit code."""
    asked: list[int] = []
    for number in SIGNALS:
        signal.signal(number, lambda caught, _: asked.append(caught))
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1)
    command = Command(words)
    until = time.monotonic() + seconds
    while command.code is None and not asked and time.monotonic() < until:
        time.sleep(LOOK_S)
        command.reap()
    code = command.code
    if code is None:
        code = 128 + asked[0] if asked else TIME_IS_OVER
        command.interrupt()
        until = time.monotonic() + GRACE_S
        while command.code is None and time.monotonic() < until:
            time.sleep(LOOK_S)
            command.reap()
    left = command.kill_left()
    if left:
        print(
            f"killed {len(left)} processes that {words[0]} left:",
            *left,
            sep="\n  ",
            file=sys.stderr,
        )
    return code if code >= 0 else 128 - code


if __name__ == "__main__":
    sys.exit(main(float(sys.argv[1]), sys.argv[2:]))
