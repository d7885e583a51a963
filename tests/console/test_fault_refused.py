"""No fault is done to a fleet whose back-end may move a real robot."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from typer.testing import CliRunner

from console.__main__ import app
from operate.file_names import FAULTS_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus

pytestmark = pytest.mark.process
MODULE = "services.executor.loop"
LISTENS = "import sys; print(flush=True); sys.stdin.read()"


@pytest.fixture(params=["my_lab:make", "mock", None])
def backend(request: pytest.FixtureRequest) -> str | None:
    """A back-end as the environment names it."""
    name: str | None = request.param
    return name


@pytest.fixture
def loop(backend: str | None, tmp_path: Path) -> Iterator["subprocess.Popen[bytes]"]:
    """A process in place of the loop, in a run folder that says so."""
    environment = {name: value for name, value in os.environ.items() if name != "ROCO_BACKEND"}
    environment |= {"ROCO_BACKEND": backend} if backend else {}
    pipe = subprocess.PIPE
    command = [sys.executable, "-c", LISTENS, MODULE]
    with subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe) as process:
        assert process.stdout is not None
        process.stdout.readline()  # it runs, with its own environment
        status = ProcessStatus("loop", ProcessState.READY, process.pid, module=MODULE)
        told = Fleet("roco", "", 0, 0.0, (status,), entry="companion.tools.system:SYSTEM")
        (tmp_path / "fleet.json").write_bytes(msgspec.json.encode(told))
        yield process
        process.kill()


def test_only_simulated_robots(
    loop: "subprocess.Popen[bytes]", backend: str | None, tmp_path: Path
) -> None:
    """Any other back-end than the simulator and the mock: refused, before anything is noted."""
    words = ["fault", "pause", "loop", "--for", "0.1", "--run-dir", str(tmp_path)]
    done = CliRunner().invoke(app, words)
    if backend == "my_lab:make":
        assert done.exit_code == 1
        assert "the back-end my_lab:make may move a real robot" in done.stderr
        assert not (tmp_path / FAULTS_FILE).exists()
    else:
        assert done.exit_code == 0, done.stderr
        assert "pause loop: healed after 0.1 s" in done.stdout
    assert loop.poll() is None
