"""Stacks and run folders that are kept of a failing test, and how skips are told: conftest.py in
its own pytest.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
CASES = '''
import os, signal, subprocess, sys, time
import pytest

CHILD = """
import sys, time
def stands_here():
    print("stands", flush=True)
    time.sleep(600)
stands_here()
"""

@pytest.fixture
def child(tmp_path):
    (tmp_path / "fleet.json").write_text("{}")
    environment = os.environ | {"ROCO_RUN_DIR": str(tmp_path)}
    command = [sys.executable, "-c", CHILD]
    made = subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, start_new_session=True
    )
    assert made.stdout.readline() == b"stands\\n"
    yield made
    made.kill()
    made.communicate()

@pytest.mark.process
@pytest.mark.timeout(2)
def test_hangs(child):
    while True:
        time.sleep(0.1)

@pytest.mark.process
def test_waits_in_vain(child):
    subprocess.run([sys.executable, "-c", CHILD.replace("stands_here", "is_waited_for")], timeout=2)

@pytest.mark.process
@pytest.mark.timeout(1)
def test_fails_late(child):
    os.kill(child.pid, signal.SIGSTOP)  # its stacks are waited for longer than the test may take
    time.sleep(0.5)
    assert False

@pytest.mark.process
def test_passes(child):
    pass

@pytest.mark.skip(reason="needs a moon (Debian: apt install moon)")
@pytest.mark.parametrize("night", range(3))
def test_of_the_moon(night):
    pass

@pytest.mark.skip(reason="no moon")
def test_in_the_dark():
    pass
'''


@pytest.mark.process
@pytest.mark.parametrize("workers", [[], ["-n", "2"]], ids=["one process", "workers"])
def test_of_a_failing_test_stacks_and_run_folder_are_kept(
    tmp_path: Path, workers: list[str]
) -> None:
    """Where its time is over, before anything of it is ended; and skips are told with what they
    need.
    """
    (tmp_path / "test_cases.py").write_text(CASES)
    skipped = tmp_path / "skipped"
    ours = ("PYTEST_", "TESTS_")
    kept = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    told = {"ROCO_SKIPPED": str(skipped), "ROCO_SECOND_TRIES": ""}
    environment = kept | told | {"PYTHONPATH": str(ROOT / "tests")}
    words = ["-q", "-c", str(ROOT / "pyproject.toml"), "-p", "conftest", "-p", "no:rerunfailures"]
    command = [sys.executable, "-m", "pytest", *words, *workers, "test_cases.py"]
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=50
    )
    assert "3 failed, 1 passed, 3 skipped, 1 error" in done.stdout, done.stdout + done.stderr
    places = map(Path, re.findall(r"were: (\S+)", done.stdout))
    folders = {place.name.rpartition("-")[2]: place for place in places}
    assert folders.keys() == {"test_hangs", "test_waits_in_vain", "test_fails_late"}
    del folders["test_fails_late"]
    for name, folder in folders.items():
        stacks = (folder / "stacks.txt").read_text()
        assert "in stands_here" in stacks
        assert ("in is_waited_for" in stacks) is (name == "test_waits_in_vain")
        assert (folder / "run-0" / "fleet.json").exists()
    lines = sorted(line.rpartition("::")[2] for line in skipped.read_text().splitlines())
    why = "needs a moon (Debian: apt install moon)"
    assert lines == [f"test_of_the_moon[{night}]\t{why}" for night in range(3)]
    assert "skipped for 'no moon'; write what it needs and how to get it" in done.stdout
