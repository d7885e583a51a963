"""Completion: each parameter of each verb has names to complete, or a reason why there are none;
and they are right.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from companion.design import DESIGN
from companion.tools.verbs.table import VERBS as OWN
from console import lazy
from console.__main__ import app
from console.verbs import GROUP, VERBS, merged

ROOT = Path(__file__).parents[2]
POUR = ROOT / "tests/histories/pour_seed_7"
DEPOT = ROOT / "examples/depot/depot/design.toml"
CHOICES, PATHS = ("choice", "boolean"), ("path", "file", "directory")
"""Types that the command line completes by itself, and those that the shell does."""
NUMBERS = ("int", "integer", "float", "int range", "integer range", "float range")
"""Types of which one gives a number of one's own."""
A_NAME, A_TEXT = "a name that is not there yet", "a text of one's own"
FREE = {
    ("*", "seed"): "a number of one's own, or none",
    ("*", "another"): A_NAME,
    ("ask", "question"): A_TEXT,
    ("say", "text"): A_TEXT,
    ("say", "at"): "a time of day",
    ("view", "at"): "an address of this machine",
    ("fipa", "at"): "an address of this machine",
    ("fipa", "df"): "the name and address of another platform's directory",
    ("replay", "system"): A_NAME,
    ("replay", "connect"): "the address of a router of another machine",
    ("traffic judge", "languages"): "a place in code that is not this system's",
    ("send", "content"): A_TEXT,
    ("send", "in_reply_to"): "a label that is in no list: `roco traffic echo` shows it as JSON",
    ("send", "reply_with"): A_NAME,
    ("send", "id"): A_NAME,
    ("acl show", "source"): "a message's own text; of a file the shell completes the name",
    ("design new", "name"): A_NAME,
    ("*", "agents"): A_TEXT,
    ("fault thing", "by"): "a number of one's own",
    ("keys make", "host"): "a name or an address of another machine",
}
"""(verb, or * for all; parameter) -> why nothing can be completed."""


def parameters() -> Iterator[tuple[str, Any]]:
    """Every parameter of every verb."""
    for rows in merged(VERBS, OWN).values():
        for words, (place, _) in rows.items():
            if place is not GROUP:
                module, name = place.split(":")
                function = getattr(import_module(module, lazy.ROOM), name)
                yield from ((words, one) for one in lazy.made(words.split()[-1], function).params)


def completed(one: Any) -> bool:
    """Whether a completer, a choice, or the shell's files complete it; a flag has no value."""
    by_itself = getattr(one, "is_flag", False) or one.type.name in (*CHOICES, *PATHS, *NUMBERS)
    return by_itself or one._custom_shell_complete is not None


def test_every_parameter_is_completed_or_has_a_reason() -> None:
    """A new parameter needs a completer, or an entry in FREE with the reason why it has no names to
    give; and no reason is left over.
    """
    bare = {(verb, one.name) for verb, one in parameters() if not completed(one)}
    assert [row for row in bare if row not in FREE and ("*", row[1]) not in FREE] == []
    used = bare | {("*", name) for _, name in bare}
    assert [row for row in FREE if row not in used] == []


def shell(words: str) -> dict[str, str]:
    """The variables by which a shell asks."""
    return {
        "_ROCO_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": str(len(words.split(" ")) - 1),
        "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1",
    }


def asked(words: str) -> list[str]:
    """The completions that a shell gets in this folder."""
    done = CliRunner().invoke(app, [], env=shell(words), prog_name="roco")
    assert (done.exit_code, done.stderr) == (0, ""), done.output
    return done.stdout.split()


NAMES: list[tuple[str, list[str]]] = [
    ("ag", ["agents", "agent"]),
    ("agent sta", ["start"]),
    ("agents k", ["km"]),
    ("status --run-dir ", ["runs/2026-01-02", "runs/2026-01-01"]),
    ("traffic echo --channel C", list(DESIGN.channels)),
    ("traffic echo --run runs/2026-01-0", ["runs/2026-01-02", "runs/2026-01-01"]),
    ("traffic echo --protocol q", ["query"]),
    ("sniff --performative inform-", ["inform-if", "inform-ref"]),
    ("send --as p", ["pl"]),
    ("send --language R", ["RC", "RS"]),
    ("agents --ontology ", ["RoCo"]),
    ("replay runs/x --only ch", ["channel="]),
    ("replay runs/x --only agent=pl,k", ["agent=pl,km"]),
    ("up --only router,mo", ["router,monitor"]),
    ("runs --failed 2026-01-01", ["2026-01-01"]),
    ("fault h", ["hang", "heal"]),
    ("fault se", ["sensor"]),
    ("record in", ["info"]),
    (
        "design export --pair ta-",
        ["-".join(one.ends) for one in DESIGN.channels.values() if one.ends[0] == "ta"],
    ),
    ("design verify --layer ", ["1", "2", "3"]),
    ("param pl a", ["attempts"]),
    ("param pl log-level w", ["warning"]),
    ("fault kill pl --at ta:su", ["ta:surveying"]),
    ("param pl attempts ", [str(DESIGN.agents["pl"].parameter[0].default)]),
    ("design show --what req", ["requirements"]),
    ("conversation --run runs/2026-01-02 ta-1-2", ["ta-1-2", "ta-1-24"]),
    ("protocol co", ["coordinate"]),
    ("protocol fipa-re", ["fipa-recruiting", "fipa-request", "fipa-request-when"]),
    (f"design show {DEPOT} --agent m", ["mule"]),
    (f"design export {DEPOT} --use tender_", ["tender_mule", "tender_ox"]),
]
"""What is typed behind `roco`, and what a shell offers then."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to be in, with two runs, the newer one a recorded pour."""
    monkeypatch.chdir(tmp_path)
    for name in [name for name in os.environ if name.startswith("ROCO_")]:
        monkeypatch.delenv(name)
    (tmp_path / "runs" / "2026-01-01").mkdir(parents=True)
    (tmp_path / "runs" / "2026-01-02").symlink_to(POUR)
    return tmp_path


def test_a_shell_is_answered_with_what_there_is(folder: Path) -> None:
    """Of the system here, or of the design file or the run that is named before."""
    wrong = [(words, told) for words, names in NAMES if (told := asked(f"roco {words}")) != names]
    assert wrong == []


def test_in_a_folder_without_a_system_nothing_is_invented(folder: Path) -> None:
    """A design file that cannot be read gives no names, and no traceback."""
    (folder / "design.toml").write_text("nonsense")
    assert asked("roco design show design.toml --agent ") == []


@pytest.mark.process
def test_the_command_itself_completes(folder: Path) -> None:
    """In a process of its own, as a shell calls it."""
    code = "from console.__main__ import app; app(prog_name='roco')"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | shell("roco send --as p"),
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert (done.returncode, done.stdout.split()) == (0, ["pl"]), done.stderr
