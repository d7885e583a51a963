"""Where the processes of a host cannot meet on 127.0.0.1, `up` and `doctor` say so at once, with a
network of the kernel's that has no such interface, or one with ::1 only.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

ALONE = ["unshare", "--map-root-user", "--net"]
SIX = ["sh", "-c", 'ip link set lo up && ip address del 127.0.0.1/8 dev lo && exec "$@"', "sh"]
ROCO = [sys.executable, "-P", "-m", "console"]
WORDS = "processes cannot meet on 127.0.0.1 ("


def tried(*command: str, cwd: Path) -> "subprocess.CompletedProcess[str]":
    """A command to its end."""
    shared = os.environ | {"COLUMNS": "200"}
    return subprocess.run(
        command, cwd=cwd, env=shared, capture_output=True, text=True, timeout=50, check=False
    )


@pytest.fixture(params=[ALONE, [*ALONE, *SIX]], ids=["none", "::1"])
def alone(request: pytest.FixtureRequest, tmp_path: Path) -> list[str]:
    """Words before a command that has such a network."""
    try:
        possible = not tried(*request.param, "true", cwd=tmp_path).returncode
    except FileNotFoundError:
        possible = False
    if not possible:
        pytest.skip("needs networks of its own (Debian: apt install util-linux iproute2)")
    return list(request.param)


def test_up_says_what_is_missing(alone: list[str], tmp_path: Path) -> None:
    """Nothing of it is started, and nobody waits."""
    done = tried(*alone, *ROCO, "up", "--only", "router,monitor", cwd=tmp_path)
    assert done.returncode == 1
    assert f"supervisor: {WORDS}" in done.stderr
    assert "`ip link set lo up`" in done.stderr
    assert "Error" not in done.stderr


def test_doctor_says_what_is_missing(alone: list[str], tmp_path: Path) -> None:
    """It connects, since a port is had without an interface, too."""
    for before, level in ((alone, "wrong"), ([], "fine")):
        done = tried(*before, *ROCO, "doctor", "--format", "json", cwd=tmp_path)
        (check,) = (one for one in json.loads(done.stdout)["checks"] if one["name"] == "ports")
        assert check["level"] == level
        assert check["what"].startswith(WORDS) == (level == "wrong")


def test_a_project_says_what_is_missing(alone: list[str], tmp_path: Path) -> None:
    """One made by `roco design new` is run without `roco`."""
    assert not tried(*ROCO, "design", "new", "lamp", cwd=tmp_path).returncode
    done = tried(*alone, sys.executable, "-m", "lamp", "--until-ready", cwd=tmp_path / "lamp")
    assert done.returncode == 1
    assert done.stderr.startswith(f"lamp: {WORDS}")
