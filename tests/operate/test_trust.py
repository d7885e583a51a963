"""Code of a project runs only where nobody but the caller and root can change it; a look at a run
or folder runs none.

The strangers here are files that belong to another user. What would run leaves a mark.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from synthetic import SYSTEM
from typer.testing import CliRunner, Result

from agent_runtime.io.fleet_processes import set_stop
from agent_runtime.io.run_files import STOP_FILE, LinkedError
from console.__main__ import app
from console.fleet.local import Local
from operate.file_names import FLEET_FILE, REPORT_FILE, RRD_FILE
from operate.fleet_file import Fleet
from operate.recording.recorder import Recorder
from operate.recording.run import Run
from operate.reports.make import PAGE_FILE, everything
from operate.system import TRUST_VARIABLE, UntrustedError, changeable, of_run

ROOT = Path(__file__).parents[2]
POUR = ROOT / "tests/histories/pour_seed_7"
NOBODY = 65534
as_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a file to another user")
CODE = (
    "from pathlib import Path\nPath({mark!r}).touch()\nfrom companion.tools.system import SYSTEM\n"
)
MODULE = "strange"


@pytest.fixture
def place() -> Iterator[Path]:
    """A folder that every user may enter, as those of users on one machine are."""
    made = Path(tempfile.mkdtemp()).resolve()
    made.chmod(0o755)
    yield made
    shutil.rmtree(made)


@pytest.fixture
def project(place: Path) -> Path:
    """A project whose code leaves a mark, and one run of it."""
    folder = place / "project"
    (folder / "run").mkdir(parents=True)
    (folder / "pyproject.toml").write_text(
        f'[tool.roco]\nsystem = "{MODULE}:SYSTEM"\ndesign = "design.toml"\n'
    )
    (folder / f"{MODULE}.py").write_text(CODE.format(mark=str(mark(folder))))
    shutil.copy(ROOT / "examples/depot/depot/design.toml", folder)
    for file in POUR.iterdir():
        shutil.copy(file, folder / "run")
    told = Fleet("velma", "tcp/127.0.0.1:1", 0, 0.0, (), f"{MODULE}:SYSTEM", str(folder))
    (folder / "run" / FLEET_FILE).write_bytes(msgspec.json.encode(told))
    return folder


def mark(project: Path) -> Path:
    """What the project's code would make."""
    return project.parent / "it-ran"


def given_away(folder: Path) -> None:
    """Let everything of a folder belong to another user."""
    for path in (folder, *folder.rglob("*")):
        os.chown(path, NOBODY, NOBODY, follow_symlinks=False)


def roco(*words: object) -> Result:
    """Call the command line in this process; one that imports the project makes its mark here,
    too.
    """
    return CliRunner().invoke(app, [str(word) for word in words])


OF_A_RUN = (
    "status --run-dir", "report", "traffic judge", "traffic echo --run", "doctor --run-dir",
    "replay", "replay --verify", "why --run", "trace --run", "conversation --run",
    "export --out tables", "compare run",
)  # fmt: skip


@as_root
def test_a_run_of_somebody_else_is_looked_at_without_his_code(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In place of it the verb says what was found, whose it is, and what to do."""
    given_away(project)
    monkeypatch.chdir(project.parent)
    (project.parent / "run").symlink_to(project / "run")
    for verb in OF_A_RUN:
        done = roco(*verb.split(), project / "run")
        said = " ".join((done.stdout + done.stderr).split())
        assert not mark(project).exists(), verb
        for words in (
            f"{FLEET_FILE} names the system 'strange:SYSTEM' in {project}",
            f"(uid {NOBODY})",
            f"{TRUST_VARIABLE}={project / 'run'}:{project}",
        ):
            assert words in said, verb


@as_root
def test_verbs_that_need_no_system_do_without_it(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing runs."""
    given_away(project)
    monkeypatch.chdir(project.parent)
    (project.parent / "runs").mkdir()
    (project.parent / "runs" / "latest").symlink_to(project / "run")
    for verb in ("logs", "agents", "runs", "view --web --format json"):
        roco(*verb.split())
        assert not mark(project).exists(), verb


@as_root
def test_a_project_above_of_somebody_else_does_not_run(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither for help nor where a system is needed, which is refused with the reason."""
    given_away(project)
    (project / "below").mkdir()
    monkeypatch.chdir(project / "below")
    for verb in ("--help", "up --help", "design check", "strange", "up"):
        done = roco(*verb.split())
        assert not mark(project).exists(), verb
        assert done.exit_code == (0 if "--help" in verb else 2), verb
        said = " ".join(done.stderr.replace("│", "").split())
        for words in ("pyproject.toml names the system 'strange:SYSTEM'", f"(uid {NOBODY})"):
            assert "--help" in verb or words in said, verb


@pytest.mark.parametrize("whose", ["mine", pytest.param("another's", marks=as_root)])
def test_help_and_completion_import_nothing_of_a_project(
    project: Path, monkeypatch: pytest.MonkeyPatch, whose: str
) -> None:
    """Examples and names are those of its design file; of somebody else's project there are
    none.
    """
    if whose != "mine":
        given_away(project)
    monkeypatch.chdir(project)
    for words in (("--help",), ("design", "--help"), ("traffic", "echo", "--help")):
        assert roco(*words).exit_code == 0
    assert "roco agent stop desk" in roco("agent", "stop", "--help").stdout or whose != "mine"
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "1")
    asked = (
        "send --as d", "strange x", "up --only r", "cancel ", "conversation --run run c",
        "traffic echo --run run --channel ", "agent stop --run-dir run d",
    )  # fmt: skip
    names = {words: completed(words, project) for words in asked}
    assert names["send --as d"] == (["desk", "dispatcher"] if whose == "mine" else [])
    assert names["up --only r"] == []
    assert not mark(project).exists()


def python(code: str, folder: Path, **more: str) -> "subprocess.CompletedProcess[str]":
    """Run code in a process of its own, in this folder."""
    command, env = [sys.executable, "-P", "-c", code], os.environ | more
    return subprocess.run(command, env=env, cwd=folder, capture_output=True, text=True, timeout=50)


def completed(words: str, folder: Path) -> list[str]:
    """Return the names that a shell gets in this folder."""
    asked = {
        "_ROCO_COMPLETE": "complete_bash",
        "COMP_WORDS": f"roco {words}",
        "COMP_CWORD": str(len(words.split(" "))),
    }
    done = python("from console.__main__ import app; app(prog_name='roco')", folder, **asked)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout.split()


def ran(folder: Path, run: Path, **environment: str) -> bool:
    """Whether a process of this user that asks for the system of a run runs its project's code."""
    code = "from pathlib import Path; from operate.system import of_run; print(of_run(Path()).name)"
    done = python(code, run, **environment)
    assert (done.returncode == 0) == mark(folder).exists(), done.stderr
    return done.returncode == 0


@as_root
def test_what_is_trusted_by_name_runs(project: Path) -> None:
    """The folders that the sentence names, or one above them; no other."""
    given_away(project)
    assert not ran(project, project / "run", **{TRUST_VARIABLE: str(project / "run")})
    assert not ran(project, project / "run", **{TRUST_VARIABLE: f"{project}-beside"})
    with pytest.raises(UntrustedError) as refused:
        of_run(project / "run")
    named = str(refused.value).rpartition(f"{TRUST_VARIABLE}=")[2]
    assert ran(project, project / "run", **{TRUST_VARIABLE: named})


def test_ones_own_run_needs_no_trust(project: Path) -> None:
    """It is the usual case."""
    assert ran(project, project / "run")


@as_root
def test_each_part_is_looked_at(project: Path) -> None:
    """The file that names the system, the folder that its code is in, and those above, which could
    be renamed.
    """
    toml = project / "pyproject.toml"
    for part in (toml, project / "run" / FLEET_FILE, project, project.parent):
        os.chown(part, NOBODY, NOBODY)
        assert changeable(part) == f"{part} belongs to nobody (uid {NOBODY})"
        assert part == toml or not ran(project, project / "run"), part
        os.chown(part, 0, 0)


def test_who_else_can_write_counts(project: Path) -> None:
    """Everybody does; a group does where somebody else is in it; the sticky bit protects what is
    below a folder.
    """
    assert changeable(project) == ""
    project.chmod(0o777)
    assert changeable(project) == f"every user can write to {project}"
    assert changeable(project / "run") == f"every user can write to {project}"
    project.chmod(0o1777)
    assert changeable(project) == f"every user can write to {project}"
    assert changeable(project / "run") == ""
    project.chmod(0o775)
    assert changeable(project / "run") == ""  # the group of the caller's own name


@as_root
def test_a_group_with_others_in_it_can_write(project: Path) -> None:
    """As a folder that a team shares."""
    os.chown(project, 0, NOBODY)
    project.chmod(0o775)
    assert changeable(project).startswith(f"other users can write to {project} (group ")


def test_a_pipe_in_place_of_a_file_ends_nothing(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A reader of it would wait for ever."""
    os.mkfifo(place / "pyproject.toml")
    os.mkfifo(place / FLEET_FILE)
    monkeypatch.chdir(place)
    assert of_run(place).name == "roco"


def test_no_stop_is_written_through_a_link(place: Path) -> None:
    """Nor a fault, nor what keeps a process down: the file behind stays, and the message names the
    link.
    """
    secret = place / "secret"
    secret.write_bytes(b"kept")
    run = place / "run"
    run.mkdir()
    for name in (STOP_FILE, "faults.jsonl"):
        (run / name).symlink_to(secret)
    why = f"{run}/stop is a symbolic link, and is not written through: remove it"
    with pytest.raises(LinkedError, match=why):
        set_stop(run, held=True)
    done = roco("stop", "--run-dir", run)
    assert (done.exit_code, "stop is a symbolic link" in done.stderr) == (2, True)
    with pytest.raises(LinkedError):
        Local(run).add_fault(b"{}")
    assert secret.read_bytes() == b"kept"


def test_no_report_is_written_through_a_link(place: Path) -> None:
    """The link is replaced by the file; so is one at the name under which the file is begun."""
    run, names = place / "run", (REPORT_FILE, RRD_FILE, PAGE_FILE)
    Recorder(run, SYSTEM).finish()
    secret = place / "secret"
    secret.write_bytes(b"kept")
    for name in names:
        (run / name).unlink(missing_ok=True)
        (run / name).symlink_to(secret)
        (run / f".{name}.new").symlink_to(secret)
        (run / f".{name}").symlink_to(secret)
    told: list[object] = []
    made = everything(Run(run, SYSTEM), lambda *words, **more: told.append((words, more)))
    assert made, told
    assert secret.read_bytes() == b"kept"
    assert not any((run / name).is_symlink() for name in names)
    assert all((run / name).stat().st_size for name in names)
