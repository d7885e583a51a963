"""A pretended fleet, started the way the console starts the real one."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "operate"))  # tests have no packages

from console.fleet import starting
from console.runs import folders

FAKE = Path(__file__).with_name("fake_fleet.py")


@pytest.fixture
def called() -> Iterator[Callable[..., int]]:
    """Have a process live that does nothing, was called with these words, and has these variables;
    its pid.
    """
    with ExitStack() as stack:

        def call(*words: object, **variables: str) -> int:
            idle = [sys.executable, "-c", "import time; time.sleep(300)", *map(str, words)]
            process = stack.enter_context(subprocess.Popen(idle, env=os.environ | variables))
            stack.callback(process.kill)
            until = time.monotonic() + 20.0
            # for a moment it still bears the words of this process
            while not folders.is_service(process.pid, str(words[0])):
                assert time.monotonic() < until, f"{words} did not start"
                time.sleep(0.001)
            return process.pid

        yield call


@pytest.fixture
def pretend(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[bool], None]]:
    """Let the console start the pretended fleet in place of the supervisor; its report will say so
    much of success.
    """
    started: list[subprocess.Popen[bytes]] = []

    def with_success(success: bool) -> None:
        def start(run: Path, arguments: list[str]) -> subprocess.Popen[bytes]:
            run.mkdir(parents=True)
            started.append(
                subprocess.Popen([sys.executable, FAKE, "services.supervisor", run, str(success)])
            )
            return started[-1]

        monkeypatch.setattr(starting, "start", start)

    yield with_success
    for process in started:
        process.kill()
        process.wait()


@pytest.fixture
def run(tmp_path: Path, pretend: Callable[[bool], None]) -> Path:
    """The folder of a run whose pretended fleet is up."""
    pretend(True)
    folder = tmp_path / "run"
    supervisor = starting.start(folder, [])
    starting.wait_ready(folder, supervisor, lambda _: None)
    assert folders.fleet(folder) is not None
    return folder
