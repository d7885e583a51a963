"""scripts/bounded.py and scripts/test: whatever a command started ends with it, however it ends."""

import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

ROOT = Path(__file__).parents[1]
WITHIN_S = 45.0
STRAY = "import time; time.sleep(600)"
LEAVES = f"""
import os, subprocess, sys
if not os.fork():
    command = [sys.executable, "-c", {STRAY!r}]
    print(subprocess.Popen(command, env={{}}, start_new_session=True).pid, flush=True)
    os._exit(0)
os.wait()
"""
"""Starts a process that neither Ctrl-C nor the end of its parent reaches: its parent is gone at
once, its session is its own, and it has none of our variables. It prints its number.
"""
WAITS = LEAVES + "import time; time.sleep(600)"
DEAF = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n" + WAITS
ENDS_IN_ORDER = f"""
try:
    {WAITS.strip().replace(chr(10), chr(10) + "    ")}
except KeyboardInterrupt:
    print("in order", flush=True)
"""


PATIENT = f"""
import sys
sys.path.insert(0, {str(ROOT / "scripts")!r})
import bounded
bounded.GRACE_S = float(sys.argv[1])
sys.exit(bounded.main(float(sys.argv[2]), sys.argv[3:]))
"""


class Bounded:
    """A call of bounded.py whose command starts a stray."""

    def __init__(self, program: str, seconds: float = 600.0, grace_s: float = 20.0) -> None:
        python, pipe = (sys.executable, "-c"), subprocess.PIPE
        command = [*python, PATIENT, str(grace_s), str(seconds), *python, program]
        self.process = subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True)
        assert self.process.stdout is not None
        self.stray = int(self.process.stdout.readline())

    def ended(self) -> tuple[int, str, str]:
        """Return exit code and output, once it has ended; the stray has, too."""
        out, err = self.process.communicate(timeout=WITHIN_S)
        assert not Path(f"/proc/{self.stray}").exists()
        return self.process.returncode, out, err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_interrupts_the_command_and_kills_what_it_left(number: signal.Signals) -> None:
    """Which may end in order first."""
    call = Bounded(ENDS_IN_ORDER)
    call.process.send_signal(number)
    code, out, err = call.ended()
    assert (code, out) == (128 + number, "in order\n")
    assert "killed 1 processes" in err
    assert STRAY in err


@pytest.mark.parametrize("program", [WAITS, DEAF], ids=["interrupted", "deaf"])
def test_time_is_over(program: str) -> None:
    """For one that does not hear, too."""
    assert Bounded(program, seconds=1.0, grace_s=1.0).ended()[0] == 124


@pytest.mark.parametrize("code", [0, 3])
def test_the_exit_code_is_that_of_the_command(code: int) -> None:
    """Which has left something."""
    assert Bounded(f"{LEAVES}\nsys.exit({code})").ended()[0] == code


HANGS = """
import os, subprocess, sys, time
from pathlib import Path
import pytest

@pytest.fixture
def fleet():
    command = [sys.executable, "-P", "-m", "console", "up", "--out", "run"]
    subprocess.run(command, cwd=os.environ["DEPOT"], check=True, timeout=90)
    yield

@pytest.mark.timeout(600)
def test_has_a_fleet_up(fleet):
    Path(os.environ["DEPOT"], "up").touch()
    time.sleep(600)
"""


def of(depot: Path) -> list[str]:
    """Return the command lines of all processes that were started with this variable DEPOT."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if f"DEPOT={depot}".encode() in (place / "environ").read_bytes().split(b"\0"):
                found.append((place / "cmdline").read_bytes().replace(b"\0", b" ").decode())
    return found


@pytest.mark.timeout(240)
def test_an_interrupted_scripts_test_leaves_no_worker_and_no_fleet(tmp_path: Path) -> None:
    """Of a fleet that is up, each process has a session of its own, and `roco up` that started them
    is gone.
    """
    depot = tmp_path / "depot"
    without = shutil.ignore_patterns("runs", "__pycache__")
    shutil.copytree(ROOT / "examples/depot", depot, ignore=without)
    (tmp_path / "test_hangs.py").write_text(HANGS)
    ours, pipe = ("PYTEST_", "ROCO_"), subprocess.PIPE
    kept = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    command, env = [ROOT / "scripts/test", tmp_path / "test_hangs.py"], kept | {"DEPOT": str(depot)}
    process = subprocess.Popen(command, env=env, stdout=pipe, stderr=subprocess.STDOUT, text=True)
    until = time.monotonic() + 150.0
    while not (depot / "up").exists():
        assert process.poll() is None, process.communicate()[0]
        assert time.monotonic() < until, "no fleet is up"
        time.sleep(0.1)
    assert len(of(depot)) > 10  # scripts/test, its runner, pytest, its workers, a fleet of nine
    process.terminate()
    said, _ = process.communicate(timeout=WITHIN_S)
    assert process.returncode == 128 + signal.SIGTERM, said
    assert of(depot) == []
