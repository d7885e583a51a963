"""A project made by `roco design new` in the foreground: what it says when it cannot come up."""

import subprocess
import sys
from pathlib import Path

import pytest

from topdown.scaffold import scaffold, smallest


@pytest.mark.long
@pytest.mark.zenoh
def test_an_agent_that_cannot_start_is_named_and_the_rest_is_ended(tmp_path: Path) -> None:
    """Its behaviours do not fit the design: the binding says which, the command ends with 1 and
    leaves nothing.
    """
    scaffold(smallest("tiny"), tmp_path)
    broken = tmp_path / "tiny" / "doer" / "behaviours.py"
    broken.write_text(broken.read_text().replace('"do": do}', '"dance": do}'))
    command = [sys.executable, "-m", "tiny", "--until-ready", "--run-dir", str(tmp_path / "run")]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=50)
    assert done.returncode == 1
    assert "not ready: " in done.stdout
    assert "doer" in done.stdout.rpartition("not ready: ")[2]
    log = (tmp_path / "run" / "doer.log").read_text()
    assert "nothing is bound to do; the design has no dance" in log
    assert list((tmp_path / "run").glob("*.pid")) == []
