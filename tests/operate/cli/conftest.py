"""A pretended fleet, started the way the console starts the real one."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from operate.cli.fleet import starting
from operate.cli.runs import folders

FAKE = Path(__file__).with_name("fake_fleet.py")


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
