"""The report and the pictures of a system that is not the Robot Companion: examples/depot, run over
a real router.
"""

import os
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from operate.recording import mcap_file
from operate.recording.records import Spoken
from operate.reports.report import Report
from operate.system import of_run

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(120)]
EXAMPLE = Path(__file__).parents[3] / "examples" / "depot"
AGAIN = """
import sys
from pathlib import Path
from operate.reports import make
from operate.system import of_run
from operate.recording.run import Run
run = Path(sys.argv[1])
assert make.everything(Run(run, of_run(run)), lambda *_, **__: None)
ours = ("companion", "velma", "services")
print([name for name in sys.modules if name.partition(".")[0] in ours])
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The run folder of a depot that has run for some seconds and ended in order; the project is
    outside the clone.
    """
    folder = tmp_path_factory.mktemp("depot")
    shutil.copytree(
        EXAMPLE, folder / "project", ignore=shutil.ignore_patterns("runs", "__pycache__")
    )
    command = [sys.executable, "-m", "depot", "--seconds", "3", "--run-dir", str(folder / "run")]
    path = sys.path.copy()
    subprocess.run(command, cwd=folder / "project", check=True, timeout=90, capture_output=True)
    yield folder / "run"
    sys.path[:] = path
    for name in [name for name in sys.modules if name.partition(".")[0] == "depot"]:
        del sys.modules[name]


def test_the_report_counts_what_was_recorded(run: Path) -> None:
    """The report counts the communicates per pair, all as designed, and the busy agents."""
    told = msgspec.json.decode((run / "report.json").read_bytes(), type=Report)
    first = {
        one.identity: one
        for one in mcap_file.read(run / mcap_file.FILE).records
        if isinstance(one, Spoken)
    }
    pairs = Counter((one.sender, one.receiver) for one in first.values())
    assert pairs["desk", "dispatcher"]
    assert {
        (s, r): n for s, row in told.communicates.matrix.items() for r, n in row.items() if n
    } == pairs
    assert told.judged is not None
    assert told.judged.violations == ()
    assert {one.agent for one in told.busy} == set(of_run(run).design.agents)


def test_the_page_speaks_of_its_agents_only(run: Path) -> None:
    """Every agent is named; nothing is said of jars."""
    page = (run / "report.html").read_text()
    assert all(f"<th>{agent}</th>" in page for agent in of_run(run).design.agents)
    assert "jar" not in page
    assert "paper" not in page


def test_neither_report_nor_pictures_need_the_companion(run: Path) -> None:
    """Made again by a process that imports nothing of it."""
    environment = os.environ | {"PYTHONSAFEPATH": "1"}
    done = subprocess.run(
        [sys.executable, "-c", AGAIN, str(run)],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.stdout.strip() == "[]", done.stderr
    assert (run / "run.rrd").stat().st_size
