"""Wrong use, as people and programs are told of it; what cannot be is said before anything
starts.
"""

import json
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from calling import printed, roco

from console import lazy

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
