"""Choice of the system for a verb, failures to find one, and the effect of a system's own verbs on
the table.
"""

import json
import os
from itertools import pairwise
from pathlib import Path

import click
import pytest
import typer
from calling import printed, roco
from hypothesis import given
from hypothesis import strategies as st

from console import completion
from console.fleet import targets
from console.runs import folders
from console.verbs import merged

NOWHERE = '[tool.roco]\nsystem = "nowhere_to_be.system:SYSTEM"\n'
BROKEN = "[system]\nname = 'broken'\n"


@pytest.fixture
def nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project whose system cannot be imported."""
    (tmp_path / "pyproject.toml").write_text(NOWHERE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def broken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project whose design cannot be read."""
    module = f"broken_{tmp_path.name.replace('-', '_')}"
    (tmp_path / "pyproject.toml").write_text(f'[tool.roco]\nsystem = "{module}:SYSTEM"\n')
    (tmp_path / "design.toml").write_text(BROKEN)
    file = str(tmp_path / "design.toml")
    code = f"from topdown.model import design\ndesign.load(__import__('pathlib').Path({file!r}))\n"
    (tmp_path / f"{module}.py").write_text(code)
    monkeypatch.chdir(tmp_path)
    return tmp_path


VERBS = [("up",), ("send", "--list"), ("design", "check")]


@pytest.mark.parametrize("words", [*VERBS, ("traffic", "judge", "."), ("keys", "make", "keys")])
def test_a_system_that_is_not_there_is_wrong_use(nowhere: Path, words: tuple[str, ...]) -> None:
    """One sentence, which names what was looked for; nothing is made."""
    done = roco(*words, "--format", "json")
    assert (done.exit_code, done.stdout) == (2, "")
    assert "'nowhere_to_be.system:SYSTEM'" in json.loads(done.stderr)["error"]
    assert [path.name for path in nowhere.iterdir()] == ["pyproject.toml"]


@pytest.mark.parametrize("words", VERBS)
def test_a_design_that_cannot_be_read_is_wrong_use(broken: Path, words: tuple[str, ...]) -> None:
    """It names the file."""
    assert "design.toml" in printed(*words, code=2)["error"]


@pytest.mark.parametrize("project", ["nowhere", "broken"])
def test_help_and_completion_need_no_system(project: str, request: pytest.FixtureRequest) -> None:
    """The verbs that serve any system are listed; an unknown one is told with the reason."""
    request.getfixturevalue(project)
    assert "conversation" in roco("--help").stdout
    context = typer.Context(click.Command("roco"))
    for names in (completion.agents, completion.channels, completion.protocols):
        assert names(context, "") == []
    assert targets.processes(context, "") == []
    assert "no system here that could add one" in printed("say", "pour", code=2)["error"]


PANELS = st.lists(st.sampled_from("ABCDE"), unique=True)


@given(PANELS, PANELS)
def test_panels_are_merged_in_order(general: list[str], own: list[str]) -> None:
    """Those of any system as they were; a new one right behind the own one before it; every row is
    there.
    """
    tables = [
        {panel: {f"{kind} {panel}": ("", "")} for panel in panels}
        for kind, panels in (("g", general), ("o", own))
    ]
    found = merged(*tables)
    assert [panel for panel in found if panel in general] == general
    assert sorted(row for rows in found.values() for row in rows) == sorted(
        row for one in tables for rows in one.values() for row in rows
    )
    order = list(found)
    for before, panel in pairwise(own):
        assert panel in general or order[order.index(before) + 1] == panel


def test_a_pid_is_ours_only_while_it_runs_that_module() -> None:
    """By whole words of its command line."""
    words = Path(f"/proc/{os.getpid()}/cmdline").read_bytes().decode().split("\0")
    assert folders.is_service(os.getpid(), "operate.supervisor", words[1])
    assert not folders.is_service(os.getpid(), words[1][:-1])
    assert not folders.is_service(os.getpid(), "")
    assert not folders.is_service(0, words[1])
