"""The programs of docs/two-agents.md run as they stand there, and say what the page says."""

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import Queue

import pytest

from agent_runtime.io.sessions import open_client
from fipa_codec import decode

PAGE = (Path(__file__).parents[2] / "docs" / "two-agents.md").read_text(encoding="utf-8")
BLOCKS = dict(re.findall(r"```python file=(\S+)\n(.*?)```", PAGE, re.DOTALL))
SHOWN = [
    [line for line in text.splitlines() if not line.startswith("$")]
    for text in re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)
]
"""What they print: as called on the page, and where eve does not start and bob is killed."""
MANAGER, ANN, BOB, EVE = (
    ("manager.py",),
    ("bidder.py", "ann", "12"),
    ("bidder.py", "bob", "9"),
    ("bidder.py", "eve"),
)
ENDPOINT = "tcp/127.0.0.1:7461"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The programs."""
    for name, text in BLOCKS.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


@contextmanager
def started(folder: Path, *calls: tuple[str, ...]) -> Iterator[list[subprocess.Popen[str]]]:
    """These programs, until the end of the block."""
    begun = [
        subprocess.Popen(
            [sys.executable, *words],
            cwd=folder,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        for words in calls
    ]
    try:
        yield begun
    finally:
        for process in begun:
            process.kill()
            process.communicate()


def ended(begun: list[subprocess.Popen[str]], shown: list[str]) -> None:
    """Each ends by itself, and they print this."""
    said = [process.communicate(timeout=40)[0] for process in begun]
    assert [process.returncode for process in begun] == [0] * len(begun), said
    assert sorted(line for text in said for line in text.splitlines()) == sorted(shown)


@pytest.mark.zenoh
@pytest.mark.timeout(60)
def test_a_contract_net_with_a_silent_bidder(folder: Path) -> None:
    """The cheaper one does it, the silent one counts as refused, and everybody ends."""
    with started(folder, ANN, BOB, EVE, MANAGER) as begun:
        ended(begun, SHOWN[0])


@pytest.mark.zenoh
@pytest.mark.timeout(60)
def test_no_bidder_hangs_the_manager(folder: Path) -> None:
    """One never starts, the cheapest is killed after its proposal: both waits end."""
    heard: Queue[str] = Queue()
    with started(folder, MANAGER) as manager:
        observer = open_client(ENDPOINT, lambda: manager[0].poll() is not None)
        assert observer is not None, manager[0].communicate()
        with observer:
            observer.declare_subscriber(
                "net/manager", lambda sample: heard.put(decode(bytes(sample.payload)).sender)
            )
            with started(folder, ANN, BOB) as (ann, bob):
                while heard.get(timeout=40) != "bob":
                    pass
                bob.kill()
                ended([*manager, ann], SHOWN[1])


def test_each_program_is_short() -> None:
    """Thirty lines of code without imports and docstring, so that the page is read at a glance."""
    for name, text in BLOCKS.items():
        code = [
            line
            for line in text.splitlines()
            if line and not line.startswith(('"""', "import ", "from "))
        ]
        assert len(code) <= 30, (name, len(code))
