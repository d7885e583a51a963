"""`new`: the project of any design is well-formed, binds and answers; what a user changed is never
touched.
"""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

import companion
from agent_runtime.io.cli import endpoints
from topdown.check import check
from topdown.model import loading
from topdown.model.design import Design
from topdown.scaffold import ScaffoldError, project_files, scaffold, smallest
from topdown.scaffold.project import MANIFEST, docstring, missing

ROOT = Path(__file__).parents[2]
DEPOT = ROOT / "examples" / "depot" / "depot" / "design.toml"
COMPANION = Path(companion.__path__[0]) / "design.toml"
GROUPED = Path(__file__).with_name("grouped.toml")
DESIGNS = {
    "tiny": lambda: smallest("tiny"),
    "depot_copy": DEPOT.read_text,
    "companion_copy": COMPANION.read_text,
    "grouped": GROUPED.read_text,
}


def run_its_tests(folder: Path, *arguments: str) -> None:
    """Run the project's own tests in a process of their own, as its user would."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=55)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def projects(tmp_path_factory):
    """A folder with the project of each design."""
    folder = tmp_path_factory.mktemp("projects")
    for name, design in DESIGNS.items():
        scaffold(design(), folder / name, name)
    return folder


@pytest.mark.process
@pytest.mark.parametrize("name", ["grouped", "companion_copy"])
def test_every_agent_of_a_new_project_binds_and_declines(name, projects):
    """The project's own tests pass before anything is filled in: design, languages, interfaces,
    every question.
    """
    run_its_tests(projects / name, "--ignore", "tests/test_run.py")


@pytest.mark.zenoh
def test_a_new_project_runs_at_once(tmp_path):
    """Router and agents become ready over Zenoh; they do not wait for the group, which nobody of
    the project runs.
    """
    scaffold(GROUPED.read_text(), tmp_path)
    run_its_tests(tmp_path, "tests/test_run.py")


@pytest.mark.process
def test_what_is_made_is_formatted_and_without_lint(projects):
    """ruff has nothing to say."""
    places = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    ruff = shutil.which("ruff", path=places)
    assert ruff is not None, "ruff is among the dev packages"
    for words in (["check"], ["format", "--check"]):
        command = [ruff, *words, "--no-cache", "."]
        done = subprocess.run(command, cwd=projects, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr


def test_the_smallest_design_is_sound():
    """No finding."""
    assert check(Design(loading.read(smallest("tiny")), "tiny")) == ()


@pytest.fixture
def tiny(tmp_path):
    """A project of the smallest design, and its file with the behaviours."""
    scaffold(smallest("tiny"), tmp_path)
    return tmp_path / "tiny" / "doer" / "behaviours.py"


def test_a_second_time_changes_nothing(tiny, tmp_path):
    """Everything is as it was."""
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    again = scaffold(smallest("tiny"), tmp_path)
    assert (again.written, again.kept, again.left) == ((), (), ())
    assert {tmp_path / path for path in again.same} | {tmp_path / MANIFEST} == before.keys()
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def grown(text: str) -> str:
    """The smallest design with one behaviour more: what a user does next."""
    return text.replace('behaviour = "do"', 'behaviour = "work"').replace(
        "# The design of", "# Design of"
    )


def test_what_the_user_changed_is_kept_and_the_rest_is_made_anew(tiny, tmp_path):
    """The changed file stays as it is, byte for byte, and the name it lacks is told; the rest is
    rewritten.
    """
    tiny.write_text(tiny.read_text().replace("# to fill in", "# filled in"))
    before = tiny.read_bytes()
    outcome = scaffold(grown(smallest("tiny")), tmp_path)
    assert tiny.read_bytes() == before
    kept = [(one.path, one.missing) for one in outcome.kept]
    assert kept == [("tiny/doer/behaviours.py", ("work",))]
    assert outcome.written == ("tiny/design.toml",)


def test_an_untouched_stub_follows_the_design(tiny, tmp_path):
    """Nobody wrote in it, so it is rewritten."""
    outcome = scaffold(grown(smallest("tiny")), tmp_path)
    assert set(outcome.written) == {"tiny/design.toml", "tiny/doer/behaviours.py"}
    assert "def work(" in tiny.read_text()


def test_a_file_that_was_there_before_is_kept(tmp_path):
    """No manifest knows it, so it is the user's."""
    (tmp_path / "README.md").write_text("mine")
    outcome = scaffold(smallest("tiny"), tmp_path)
    assert [kept.path for kept in outcome.kept] == ["README.md"]
    assert (tmp_path / "README.md").read_text() == "mine"


def test_without_its_manifest_nothing_is_overwritten(tiny, tmp_path):
    """Lost or unreadable: every file that differs counts as changed."""
    (tmp_path / MANIFEST).write_text("{")
    with pytest.raises(ScaffoldError, match="was changed"):
        scaffold(grown(smallest("tiny")), tmp_path)
    assert "def work(" not in tiny.read_text()


def test_what_the_design_no_longer_makes_is_left_and_told(tiny, tmp_path):
    """Files of an agent that was renamed stay."""
    outcome = scaffold(smallest("tiny").replace("doer", "maker"), tmp_path)
    assert "tiny/doer/behaviours.py" in outcome.left
    assert tiny.exists()


def test_a_design_that_cannot_be_a_project_is_refused_before_anything_is_written(tmp_path):
    """The error says what is wrong and what would be right; the folder stays empty."""
    text = smallest("tiny")
    for old, new, wrong in (
        ('name = "tiny"', 'name = "two words"', "not a name in Python"),
        ('name = "tiny"', 'name = "json"', "installed package"),
        ('name = "tiny"', 'name = "msgspec"', "installed package"),
        ('name = "tiny"', 'name = "topdown"', "installed package"),
        ('name = "tiny"', 'name = "Tiny"', "write it small"),
        ("doer", "languages", "name of a module"),
        ('behaviour = "do"', 'behaviour = "do it"', "not a name in Python"),
        ('terminal = "done"', 'terminal = "while"', "not a name in Python"),
        ('key = "roco/{system}/{channel}', 'key = "my/{system}/{channel}', "the runtime's keys"),
        ('into = ["asker", "doer"]', 'into = ["asker", "does"]', "which is not a group"),
    ):
        assert old in text
        with pytest.raises(ScaffoldError, match=wrong):
            scaffold(text.replace(old, new), tmp_path)
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", DESIGNS)
def test_compose_has_a_service_for_each_agent_router_and_monitor(name, projects):
    """Each runs a module that is there, finds router and agents by their names, and says whose
    fleet it is.
    """
    services = yaml.safe_load((projects / name / "compose.yaml").read_text())["services"]
    agents = Design(loading.read(DESIGNS[name]()), name).agents
    assert set(services) == {"router", "monitor", *agents}
    assert {one["labels"]["robot-companion.system"] for one in services.values()} == {name}
    for agent in agents:
        package, _, module = services[agent]["command"][-1].partition(".")
        assert (projects / name / package / module / "__main__.py").exists()
        told = services[agent]["environment"]
        assert told["ROCO_CONNECT"] == "tcp/router:7447"
        assert told["ROCO_LISTEN"] == "tcp/0.0.0.0:7448"
        assert endpoints(told["ROCO_AGENTS"]) == {one: f"tcp/{one}:7448" for one in agents}
        assert services[agent]["depends_on"] == ["router", "monitor"]


def test_texts_of_a_design_stay_text(tmp_path):
    """Quotes and backslashes in a text make no code, and long ones are wrapped."""
    nasty = 'say \\"\\"\\" and \\\\n, ' + "very " * 60 + "long"
    text = smallest("tiny").replace('text = "carries out orders"', f'text = "{nasty}"')
    for path, made in project_files(text, "tiny").items():
        if path.endswith(".py"):
            ast.parse(made)
            assert max(map(len, made.splitlines()), default=0) <= 120, path


def test_a_docstring_ends_where_it_should():
    """One line where it fits, else the closing quotes on their own."""
    assert docstring("short.", 4) == '    """short."""'
    assert docstring("word " * 40).endswith('\n"""')


def test_missing_names_are_those_that_are_mentioned_nowhere():
    """A name that is imported from elsewhere is not missing."""
    assert missing("def a(): ...\nclass B: ...\nC = 1\n", "from x import a\n") == ("B", "C")
