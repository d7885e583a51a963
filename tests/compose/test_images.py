"""Packages left out of an image's lock are not needed by its programs: nothing else can be imported
in these tests.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.process, pytest.mark.timeout(120)]
ROOT = Path(__file__).resolve().parents[2]
POUR = ROOT / "tests/histories/pour_seed_7"
BLOCK = """
import re, sys
from importlib.metadata import packages_distributions
name = lambda text: re.sub(r"[-_.]+", "-", text).lower()
locked = {name(line.split("==")[0]) for line in open(sys.argv[1]) if "==" in line}
locked |= {"robot-companion", "pip"}
for package, owners in packages_distributions().items():
    if not locked & {name(owner) for owner in owners}:
        sys.modules[package] = None
"""
TIMED = """
import numpy as np
from velma.kinematics import timing
from velma.kinematics.robot import Robot
import {0}
print(timing.timed(Robot(), [np.zeros(15), np.full(15, 0.1)], tool_speed=0.3).duration)
"""
REPORTED = """
from pathlib import Path
from companion.tools.system import SYSTEM
from operate.pictures.feed import feeding
from operate.recording.run import Run
from operate.reports.make import everything
from operate.recording.run import Run
import services.monitor.__main__, operate.recording.recorder
told = []
say = lambda event, **fields: told.append((event, fields.get("file")))
assert everything(Run(Path(sys.argv[2]), SYSTEM), say), told
assert feeding({"roco": Path(sys.argv[2])}, SYSTEM, say) == {}
print(told)
"""
MADE = """
from pathlib import Path
from companion.tools.system import SYSTEM
from operate.reports.make import everything
from operate.recording.run import Run
told = []
say = lambda event, **fields: told.append((event, fields.get("file")))
assert everything(Run(Path(sys.argv[2]), SYSTEM), say), told
print(told)
"""


def run(image: str, code: str, *words: str, code_expected: int = 0) -> str:
    """Run code with nothing to import but what an image's lock names."""
    command = [sys.executable, "-c", BLOCK + code, str(ROOT / f"requirements/{image}.txt"), *words]
    kept = {name: value for name, value in os.environ.items() if not name.startswith("ROCO_")}
    done = subprocess.run(
        command, cwd=ROOT, env=kept, capture_output=True, text=True, timeout=110, check=False
    )
    assert done.returncode == code_expected, done.stderr
    return done.stdout + done.stderr


@pytest.mark.parametrize("image", ["planner", "executor"])
def test_a_motion_is_timed_by_what_is_locked(image: str) -> None:
    """Without scipy, matplotlib or anything else that another image or a test brings."""
    module = {"planner": "companion.planning.search", "executor": "companion.skills.motions"}[image]
    assert float(run(image, TIMED.format(module))) > 0.1


def test_a_recorder_without_pictures_makes_the_report(tmp_path: Path) -> None:
    """report.json as ever; the page and the pictures are left out, and that is told."""
    (tmp_path / "traffic.mcap").write_bytes((POUR / "traffic.mcap").read_bytes())
    told = run("recorder", REPORTED, str(tmp_path))
    assert "('left out', 'report.html')" in told
    assert "('left out', 'run.rrd')" in told
    assert (tmp_path / "report.json").stat().st_size > 1000
    assert "('no pictures', None)" in told
    assert not (tmp_path / "run.rrd").exists()


def test_the_monitor_draws_the_robot_with_what_it_has(tmp_path: Path) -> None:
    """The page of the report and the pictures, with all that the robot's own drawers import."""
    (tmp_path / "traffic.mcap").write_bytes((POUR / "traffic.mcap").read_bytes())
    told = run("monitor", MADE, str(tmp_path))
    assert "('made', 'report.html'), ('made', 'run.rrd')" in told
    assert (tmp_path / "report.html").stat().st_size > 1000
    assert (tmp_path / "run.rrd").stat().st_size > 1000


def test_what_is_not_locked_cannot_be_imported() -> None:
    """Else these tests would show nothing."""
    assert "halted; None in sys.modules" in run("recorder", "import rerun", code_expected=1)
