"""All processes over a real Zenoh router: every agent hears an answer on each of its channels."""

import subprocess
import sys
from pathlib import Path


def test_all_become_ready(tmp_path):
    """`python -m depot --until-ready` ends with 0 once router and agents are ready."""
    command = [sys.executable, "-m", "depot", "--until-ready", "--run-dir", str(tmp_path)]
    done = subprocess.run(command, cwd=Path(__file__).parents[1], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
