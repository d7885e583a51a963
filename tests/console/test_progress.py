"""What takes longer than a second says on the terminal what it does, and leaves nothing there."""

import os
import pty
import select
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import pytest

from console.progress import CLEARED

pytestmark = pytest.mark.process

LONGEST_S = 40.0
WORKS = """
import sys
from console import progress
from operate.doing import doing
with progress.shown(sys.stdout, sys.stderr, "list the stars", wanted=True) as (out, err):
    sys.stdin.readline()
    with doing("counting the stars") as say:
        sys.stdin.readline()
        say("counting them again")
        sys.stdin.readline()
    out.write("done\\n")
"""


class Watched(NamedTuple):
    """A process whose output goes to a terminal, of which this is our end."""

    process: "subprocess.Popen[bytes]"
    ours: int

    def until(self, words: bytes) -> bytes:
        """What it wrote up to these words."""
        told = b""
        while words not in told:
            assert select.select([self.ours], [], [], LONGEST_S)[0], told
            told += os.read(self.ours, 4096)
        return told

    def go_on(self) -> None:
        """Give it a line."""
        assert self.process.stdin is not None
        self.process.stdin.write(b"\n")
        self.process.stdin.flush()


Start = Callable[..., Watched]


@pytest.fixture
def start() -> Iterator[Start]:
    """Start Python with these words."""
    with ExitStack() as stack:

        def started(*words: object) -> Watched:
            ours, theirs = pty.openpty()
            stack.callback(os.close, ours)
            process = stack.enter_context(
                subprocess.Popen(
                    [sys.executable, "-P", *map(str, words)],
                    stdin=subprocess.PIPE,
                    stdout=theirs,
                    stderr=theirs,
                    env=os.environ | {"TERM": "xterm", "COLUMNS": "100"},
                )
            )
            os.close(theirs)
            stack.callback(process.kill)
            return Watched(process, ours)

        yield started


def test_it_is_said_from_the_whole_to_the_part_and_goes_away(start: Start) -> None:
    """The verb itself, what it does, what that becomes; the answer stands on a clean line."""
    one = start("-c", WORKS)
    one.until(b"list the stars \xe2\x80\xa6 1 s")
    one.go_on()
    one.until(b"counting the stars")
    one.go_on()
    one.until(b"counting them again")
    one.go_on()
    told = one.until(b"done")
    assert CLEARED.encode() + b"done" in told


def test_a_verb_that_waits_says_what_it_does_to_people_alone(start: Start, tmp_path: Path) -> None:
    """Of two that wait for the same, the one that was asked for JSON says nothing."""
    os.mkfifo(tmp_path / "slow.mcap")
    words = ("-m", "console", "why", "--run", tmp_path / "slow.mcap")
    program, person = start(*words, "--format", "json"), start(*words)
    person.until(b"tell why a task went as it did")
    assert not select.select([program.ours], [], [], 0)[0]
    for one in (program, person):
        one.process.terminate()
        assert one.process.wait(LONGEST_S) != 0
