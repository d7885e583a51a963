"""`roco` called in this process, and the recorded runs that tests of its verbs look at."""

import json
from pathlib import Path
from typing import Any

from typer.testing import CliRunner, Result

from console.__main__ import app

HISTORIES = Path(__file__).parents[1] / "histories"
POUR = HISTORIES / "pour_seed_7"


def roco(*words: object, columns: int = 100, code: int | None = None, stdin: bytes = b"") -> Result:
    """Call the command line in a terminal so wide; its exit code must be `code`, where given."""
    done = CliRunner().invoke(
        app,
        [str(word) for word in words],
        input=stdin,
        env={"COLUMNS": str(columns)},
        terminal_width=columns,
    )
    assert code in (None, done.exit_code), done.stdout + done.stderr
    return done


def printed(*words: object, code: int | None = 0) -> Any:
    """Call it for a program: the object that it prints, or its error."""
    done = roco(*words, "--format", "json", code=code)
    return json.loads(done.stdout or done.stderr)
