"""`python -m operate.supervisor` looks at what it is given before it starts anything."""

import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner, Result

from companion.tools.system import SYSTEM
from operate.supervisor import folder
from operate.supervisor.__main__ import main
from operate.system import ENTRY_VARIABLE
from topdown.scaffold import scaffold, smallest

FAR_AWAY = 'name = "far"\n[[thing]]\nid = "jar_1"\nmodel = "jar"\nxyz = [100.0, 0.0, 0.0]\n'
WRONG = (
    ("--seed -1", "-1 is not in the range"),
    ("--scene far.toml", "supervisor: scene: thing jar_1 (far.toml:"),
    ("--scene nowhere.toml", "nowhere.toml"),
    ("--scene .", "directory"),
    ("--only nobody", "supervisor: no process is called nobody"),
    ("--only pl,km", "supervisor: co, ta would be elsewhere; --agents tells"),
    ("--only router,pl,km --agents co=tls/desk:1", "supervisor: ta would be elsewhere"),
    ("--keys given", "given has no rules of"),
    ("--links unix --faults", "--links unix goes with neither --agents nor --faults"),
)
"""Words that cannot be, and what is said of them."""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to be in, with a scene that cannot be."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(ENTRY_VARIABLE, SYSTEM.entry)
    (tmp_path / "far.toml").write_text(FAR_AWAY)
    return tmp_path


def supervisor(*words: str) -> Result:
    """Call it, to look alone."""
    command = typer.Typer()
    command.command()(main)
    return CliRunner().invoke(command, ["--run-dir", "run", "--check", *words])


def test_what_cannot_be_ends_it_before_anything_starts(here: Path) -> None:
    """Exit code 2 and a sentence; the run's folder is not even made."""
    for words, said in WRONG:
        done = supervisor(*words.split())
        assert (done.exit_code, said in done.stderr) == (2, True), (words, done.stderr)
    assert not (here / "run").exists()


@pytest.mark.process
def test_the_program_itself_ends_so(here: Path) -> None:
    """As a container starts it, and without --check."""
    command = [sys.executable, "-m", "services.supervisor", "--run-dir", "run", "--only", "nobody"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30)
    said = "supervisor: no process is called nobody"
    assert (done.returncode, done.stderr.startswith(said)) == (2, True), done.stderr
    assert not (here / "run").exists()


def test_a_look_alone_starts_nothing(here: Path) -> None:
    """A scene is of no interest where no loop runs."""
    assert supervisor("--seed", "7").exit_code == 0
    assert supervisor("--scene", "far.toml", "--only", "router,km").exit_code == 0
    assert not (here / "run").exists()


def test_latest_is_moved_only_where_it_may_be(tmp_path: Path) -> None:
    """A second fleet leaves it with the first."""
    folder.make(tmp_path / "first")
    folder.make(tmp_path / "second", latest=False)
    assert (tmp_path / "latest").readlink() == Path("first")
    folder.make(tmp_path / "third")
    assert (tmp_path / "latest").readlink() == Path("third")


# --- A project in the foreground ------------------------------------------------------------------


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
