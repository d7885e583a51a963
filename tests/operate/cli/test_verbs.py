"""The table of verbs: every row leads to a function that says what the row says and shows calls of itself."""

import inspect
import os
import shlex
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import msgspec
import pytest
import typer

from companion.tools.verbs.table import VERBS as OWN
from operate.cli import lazy
from operate.cli.__main__ import app
from operate.cli.verbs import GROUP, VERBS, merged
from operate.run_folder import FLEET_FILE, Fleet, ProcessState, ProcessStatus

ROWS = {words: row for rows in merged(VERBS, OWN).values() for words, row in rows.items()}
GONE = ProcessStatus("co", ProcessState.STOPPED)
CALLED = [words for words, (place, _) in ROWS.items() if place is not GROUP]


def found(words: list[str]) -> tuple[Any, list[str]]:
    """The command that these words lead to, and the words left for it."""
    command: Any = typer.main.get_command(app)
    context = typer.Context(command)
    while isinstance(command, lazy.Verbs) and words and not words[0].startswith("-"):
        _, command, words = command.resolve_command(context, words)
    return command, words


@pytest.mark.parametrize("words", CALLED)
def test_a_row_says_what_its_verb_does(words: str) -> None:
    """The docstring begins with the row's line, and the words lead to that function."""
    place, line = ROWS[words]
    module, name = place.split(":")
    function = getattr(import_module(module, lazy.ROOM), name)
    assert (inspect.getdoc(function) or "").startswith(line.rstrip("."))
    command, rest = found(words.split())
    assert not rest
    assert command.name == words.rsplit(" ")[-1]
    assert command.help.startswith(line.rstrip("."))


@pytest.mark.parametrize("words", [words for words, (place, _) in ROWS.items() if place is GROUP])
def test_a_group_has_verbs(words: str) -> None:
    """Its row has a line, and rows below it."""
    assert ROWS[words][1]
    assert any(other.startswith(words + " ") for other in CALLED)


@pytest.mark.process
def test_a_list_of_verbs_imports_none() -> None:
    """Neither the list nor a light verb pays for the heavy ones."""
    code = (
        "import sys\nfrom operate.cli.__main__ import app\n"
        "try:\n    app(['--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = ('operate.cli.design.', 'cryptography', 'zenoh')\n"
        "print([name for name in sys.modules if name.startswith(heavy)])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
    assert "conversation" in done.stdout


@pytest.mark.process
@pytest.mark.parametrize("words", [("status",), ("agents",), ("say", "look around")], ids=lambda words: words[0])
def test_what_is_called_often_imports_nothing_heavy(words: tuple[str, ...], tmp_path: Path) -> None:
    """Of a fleet that was there: no session, no numbers, no robot; no tables of rich where a program asks."""
    (tmp_path / FLEET_FILE).write_bytes(msgspec.json.encode(Fleet("roco", str(tmp_path), 0, 0.0, (GONE,))))
    code = (
        "import sys\nfrom operate.cli.__main__ import app\n"
        "try:\n    app(sys.argv[1:])\nexcept SystemExit:\n    pass\n"
        "print(*sys.modules)"
    )
    heavy = {"cryptography", "matplotlib", "mujoco", "numpy", "pinocchio", "rdflib", "rich", "structlog", "zenoh"}
    called = [sys.executable, "-c", code, *words, "--run-dir", str(tmp_path), "--format", "json"]
    done = subprocess.run(called, capture_output=True, text=True, timeout=30, check=True)
    *told, imported = done.stdout.splitlines()
    assert heavy.isdisjoint(imported.split())
    assert told or "human interface" in done.stderr


@pytest.mark.parametrize("words", CALLED)
def test_the_examples_of_a_verb_are_calls_of_it(words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each verb shows one at least; each parses, also with --format json, which every verb has."""
    monkeypatch.chdir(tmp_path)
    module, name = ROWS[words][0].split(":")
    examples = lazy.examples_of(getattr(import_module(module, lazy.ROOM), name))
    assert examples
    for example in examples:
        roco, *called = shlex.split(example)
        assert roco == "roco"
        assert called[: len(words.split())] == words.split()
        for word in (Path(word) for word in called if ("/" in word or "." in word) and " " not in word):
            (word.parent if word.suffix else word).mkdir(parents=True, exist_ok=True)
            word.touch()
        command, rest = found(called)
        command.make_context(words, list(rest))
    assert command.make_context(words, [*rest, "--format", "json"]).params["form"] == "json"


@pytest.mark.process
def test_completion_knows_verbs_names_and_files(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A shell gets verbs, agents (without a fleet), channels and runs."""
    (tmp_path / "runs" / "2026-01-01").mkdir(parents=True)

    def completed(words: str) -> list[str]:
        environment = os.environ | {"_ROCO_COMPLETE": "complete_bash", "COMP_WORDS": words}
        environment |= {
            "COMP_CWORD": str(len(words.split(" ")) - 1),
            "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1",
        }
        done = subprocess.run(
            [sys.executable, "-c", "from operate.cli.__main__ import app; app(prog_name='roco')"],
            env=environment,
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=30,
            check=False,
        )
        return done.stdout.split()

    assert completed("roco ag") == ["agents", "agent"]
    assert completed("roco agent sta") == ["start"]
    assert completed("roco status --run-dir ") == ["runs/2026-01-01"]
    assert "km" in completed("roco agents ")
