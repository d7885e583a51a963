"""`python -m services.supervisor` looks at what it is given before it starts anything."""

import subprocess
import sys
from pathlib import Path

import pytest

from operate.supervisor import folder

pytestmark = pytest.mark.process

FAR_AWAY = 'name = "far"\n[[thing]]\nid = "jar_1"\nmodel = "jar"\nxyz = [100.0, 0.0, 0.0]\n'


def supervisor(run: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    """Call it, and wait for its end; one that starts a fleet after all is ended in order."""
    command = [sys.executable, "-m", "services.supervisor", "--run-dir", str(run), *words]
    with subprocess.Popen(command, cwd=run.parent, stderr=subprocess.PIPE, text=True) as process:
        try:
            _, said = process.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            process.terminate()
            _, said = process.communicate()
    return subprocess.CompletedProcess(command, process.returncode, "", said)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--seed", "-1"), "-1 is not in the range"),
        (("--scene", "far.toml"), "supervisor: scene: thing jar_1 (far.toml:"),
        (("--scene", "nowhere.toml"), "nowhere.toml"),
        (("--scene", "."), "directory"),
        (("--only", "nobody"), "supervisor: no process is called nobody"),
        (
            ("--only", "pl,km"),
            "supervisor: co, ta would be elsewhere; --agents tells",
        ),
        (
            ("--only", "router,pl,km", "--agents", "co=tls/desk:1"),
            "supervisor: ta would be elsewhere",
        ),
        (("--keys", "given"), "given has no rules of"),
        (("--links", "unix", "--faults"), "--links unix goes with neither --agents nor --faults"),
    ],
)
def test_what_cannot_be_ends_it_before_anything_starts(tmp_path: Path, words: tuple[str, ...], said: str) -> None:
    """Exit code 2 and a sentence; the run's folder is not even made."""
    (tmp_path / "far.toml").write_text(FAR_AWAY)
    done = supervisor(tmp_path / "run", *words)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "run").exists()


def test_a_look_alone_starts_nothing(tmp_path: Path) -> None:
    """A scene is of no interest where no loop runs."""
    (tmp_path / "far.toml").write_text(FAR_AWAY)
    assert supervisor(tmp_path / "run", "--check", "--seed", "7").returncode == 0
    assert supervisor(tmp_path / "run", "--check", "--scene", "far.toml", "--only", "router,km").returncode == 0
    assert not (tmp_path / "run").exists()


def test_latest_is_moved_only_where_it_may_be(tmp_path: Path) -> None:
    """A second fleet leaves it with the first."""
    folder.make(tmp_path / "first")
    folder.make(tmp_path / "second", latest=False)
    assert (tmp_path / "latest").readlink() == Path("first")
    folder.make(tmp_path / "third")
    assert (tmp_path / "latest").readlink() == Path("third")
