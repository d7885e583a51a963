"""The table of verbs: every row leads to a function that says what the row says and shows calls of
itself.
"""

import inspect
import json
import re
import shlex
import subprocess
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec
import pytest
import typer
from calling import printed, roco

from companion.tools.verbs.table import VERBS as OWN
from console import lazy
from console.__main__ import app
from console.verbs import GROUP, VERBS, merged
from operate.file_names import FLEET_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus

ROWS = {words: row for rows in merged(VERBS, OWN).values() for words, row in rows.items()}
IMPORTED = """
import json, sys
from console.__main__ import app
def imported(*words):
    try:
        app(list(words))
    except SystemExit:
        return list(sys.modules)
asked = ["--run-dir", sys.argv[1], "--format", "json"]
calls = [["status", *asked], ["agents", *asked], ["say", "look around", *asked]]
called = [imported(*words) for words in calls][-1]
print(json.dumps([called, imported("--help")]))
"""
"""Prints the modules that are there after some verbs, and after help."""
GONE = ProcessStatus("co", ProcessState.STOPPED)
CALLED = [words for words, (place, _) in ROWS.items() if place is not GROUP]


def function(place: str) -> Any:
    """The function of a row."""
    module, name = place.split(":")
    return getattr(import_module(module, lazy.ROOM), name)


def found(words: list[str]) -> tuple[Any, list[str]]:
    """The command that these words lead to, and the words left for it."""
    command: Any = typer.main.get_command(app)
    context = typer.Context(command)
    while isinstance(command, lazy.Verbs) and words and not words[0].startswith("-"):
        _, command, words = command.resolve_command(context, words)
    return command, words


def test_a_row_says_what_its_verb_does() -> None:
    """The docstring begins with the row's line, and the words lead to that function; a group has a
    line and verbs.
    """
    wrong = []
    for words, (place, line) in ROWS.items():
        if place is GROUP:
            right = line and any(other.startswith(words + " ") for other in CALLED)
        else:
            command, rest = found(words.split())
            says = (inspect.getdoc(function(place)) or "", command.help)
            right = not rest and command.name == words.rsplit(" ")[-1]
            right = right and all(" ".join(one.split()).startswith(line[:-1]) for one in says)
        wrong += [] if right else [words]
    assert wrong == []


def test_the_examples_of_a_verb_are_calls_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each verb shows one at least; each parses, also with --format json, which every verb has."""
    monkeypatch.chdir(tmp_path)
    for words in CALLED:
        examples = lazy.examples_of(function(ROWS[words][0]))
        assert examples, words
        for example in examples:
            roco, *called = shlex.split(example)
            assert (roco, called[: len(words.split())]) == ("roco", words.split()), example
            places = [word for word in called if {"/", "."} & {*word} and " " not in word]
            for place in map(Path, places):
                (place.parent if place.suffix else place).mkdir(parents=True, exist_ok=True)
                place.touch()
            command, rest = found(called)
            command.make_context(words, list(rest))
        given = command.make_context(words, [*rest, "--format", "json"]).params["form"]
        assert given == "json", words


def test_help_of_an_option_has_no_word_in_brackets() -> None:
    """Rich takes `[s]` for a style and leaves it out."""
    swallowed = [
        (words, option.name)
        for words in CALLED
        for option in found(words.split())[0].params
        if re.search(r"\[[a-z][^\]]*\]", getattr(option, "help", None) or "")
    ]
    assert swallowed == []


@pytest.mark.process
def test_lists_and_frequent_verbs_import_nothing_heavy(tmp_path: Path) -> None:
    """Of a fleet that was there: no session, no numbers, no robot; no tables of rich where a
    program asks.
    """
    fleet = Fleet("roco", str(tmp_path), 0, 0.0, (GONE,))
    (tmp_path / FLEET_FILE).write_bytes(msgspec.json.encode(fleet))
    command = [sys.executable, "-c", IMPORTED, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=True)
    called, listed = json.loads(done.stdout.splitlines()[-1])
    heavy = {"cryptography", "matplotlib", "mujoco", "numpy", "pinocchio", "rdflib", "zenoh"}
    assert (heavy | {"rich"}).isdisjoint(called)
    unwanted = ("console.design.", "cryptography", "zenoh")
    assert [name for name in listed if name.startswith(unwanted)] == []
    assert '"state":"stopped"' in done.stdout
    assert "human interface" in done.stderr
    assert "conversation" in done.stdout


# --- Wrong use, as people and programs are told of it; what cannot be is said before anything
# starts.


FAR_AWAY = 'name = "far"\n[[thing]]\nid = "jar_1"\nmodel = "jar"\nxyz = [100.0, 0.0, 0.0]\n'


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("up", "--seed", "x", "--format", "json"), "'x' is not a seed"),
        (("up", "--format=json", "--nonsense"), "--nonsense"),
        (("nonsense", "--format", "json"), "nonsense"),
        (("agent", "nonsense", "--format", "json"), "nonsense"),
        (("say", "--format", "json"), "Missing argument"),
        (("demo", "--scene", "nowhere.toml", "--format", "json"), "nowhere.toml"),
        (("--nonsense", "status", "--format", "json"), "--nonsense"),
    ],
)
def test_a_program_is_told_of_wrong_use_in_one_object(words: tuple[str, ...], said: str) -> None:
    """On standard error, exit code 2; a person gets a box."""
    done = roco(*words, code=2)
    assert (done.stdout, said in json.loads(done.stderr)["error"]) == ("", True)
    box = roco(
        *(word for word in words if word not in ("--format", "json", "--format=json")), code=2
    )
    assert "Usage:" in box.stderr


def test_other_ends_are_as_without_json() -> None:
    """Help is help, and exit codes of verbs stay."""
    roco("up", "--help", "--format", "json", code=0)
    done = roco("status", "--run-dir", "/nowhere", "--format", "json")
    assert (done.exit_code, json.loads(done.stderr)["error"][:6]) == (3, "no run")
    assert not lazy.wants_json(["say", "json", "--format", "text"])


@pytest.mark.process
def test_the_version_is_that_of_the_package() -> None:
    """As pip says it."""
    done = subprocess.run(
        [sys.executable, "-m", "console", "--version"], capture_output=True, text=True
    )
    assert (done.returncode, done.stdout) == (0, f"roco {version('robot-companion')}\n")


@pytest.mark.parametrize("verb", [("up",), ("demo",), ("experiment", "pour")])
@pytest.mark.parametrize(
    ("options", "said"),
    [(("--seed", "-1"), "'-1' is not a seed"), (("--scene", "far.toml"), "is (100.0, 0.0, 0.0, ")],
)
def test_seed_and_scene_are_looked_at_before_anything_starts(
    verb: tuple[str, ...],
    options: tuple[str, ...],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The loop would say the same, after router and monitor; here no folder was made."""
    monkeypatch.chdir(tmp_path)
    Path("far.toml").write_text(FAR_AWAY)
    assert said in printed(*verb, *options, code=2)["error"]
    assert [path.name for path in tmp_path.iterdir()] == ["far.toml"]


def test_a_process_that_is_none_is_wrong_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It lists what there is."""
    monkeypatch.chdir(tmp_path)
    assert "there are router, monitor" in printed("up", "--only", "nobody", code=2)["error"]
    assert not list(tmp_path.iterdir())


def test_an_option_before_the_verb_below_is_refused() -> None:
    """It would be of `roco record`, and have no effect on what is shown."""
    done = roco("record", "--format", "json", "info", "runs/latest", code=2)
    assert "roco record info --option" in done.output
