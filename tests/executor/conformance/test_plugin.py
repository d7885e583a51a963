"""`pytest -p services.executor.conformance`: what a lab sees."""

import subprocess
import sys
from pathlib import Path

import pytest

from services.executor.conformance import CHECKS

pytestmark = pytest.mark.process
ROBOTS = Path(__file__).parents[3] / "examples" / "point_mass"
HUNG = """
import time
import msgspec
from services.executor import conformance
from velma.sim.mock_backend import MockBackend

first, *rest = conformance.CHECKS
conformance.CHECKS = (msgspec.structs.replace(first, most_s=0.5), *rest)

class Hung(MockBackend):
    def step(self, command):
        time.sleep(30.0)
"""


def ask(*words: str, folder: Path = ROBOTS) -> tuple[int, str]:
    """Exit code and standard output."""
    plugin = ("-v", "--no-header", "-p", "services.executor.conformance")
    command = [sys.executable, "-P", "-m", "pytest", *plugin, *words]
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=55, check=False
    )
    return done.returncode, done.stdout + done.stderr


def test_a_failure_says_what_is_wrong_by_how_much_and_what_to_do() -> None:
    """Property, measured value, limit with its source, remedy; exit code 1. What is left out is
    told.
    """
    code, out = ask(
        "--backend", "turned:make", "--gentle", "-k", "own-joint or period or servo-ends"
    )
    assert code == 1
    assert "readings::own-joint FAILED 1 of at most 0 joints" in out
    assert "measured  1 joints (right_arm_1_joint by -" in out
    assert "limit     0 joints - velma.names.BODY" in out
    assert "to do     map joints by name" in out
    assert "timing::period PASSED 0 of at most 1e-09 s" in out
    assert "SKIPPED (left out, so not known" in out
    assert "1 failed, 1 passed, 1 skipped" in out


def test_no_such_back_end_is_wrong_usage() -> None:
    """Exit code 4, and what to give."""
    code, out = ask("--backend", "point_mass:none")
    assert code == 4
    assert "makes a back-end" in out


def test_the_list_has_every_property_with_its_limit_and_source() -> None:
    """So that a lab can trust and act; names are unique."""
    code, out = ask("--backend", "mock", "--collect-only", "-qq")
    assert code == 0
    assert all(
        f"{check.area}: {check}\n  {check.says}" in out and check.source in out for check in CHECKS
    )
    assert len({check.name for check in CHECKS}) == len(CHECKS)
    assert all(check.source and check.remedy and check.says for check in CHECKS)


def test_after_what_hangs_nothing_is_tried(tmp_path: Path) -> None:
    """A call that does not come back is its check's failure; the robot may still be in it."""
    (tmp_path / "hung.py").write_text(HUNG)
    code, out = ask("--backend", "hung:Hung", "-k", "step-returns or period", folder=tmp_path)
    assert code == 1
    assert "no answer within 0.5 s: a call does not return" in out
    assert "period: not tried: step-returns did not come back" in out
