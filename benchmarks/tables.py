"""Of the long benchmarks: seeds, results as JSON lines, and the tables that a page has of them."""

import subprocess
from pathlib import Path
from typing import Any

import msgspec
import typer


def seeds(text: str) -> range:
    """Return the seeds that a command line names: "1-20" or "7". Raise BadParameter."""
    first, _, last = text.partition("-")
    try:
        return range(int(first), int(last or first) + 1)
    except ValueError:
        raise typer.BadParameter(
            f"seeds are first-last, as 1-20, or one, as 7; not {text!r}"
        ) from None


def commit(checkout: Path = Path(__file__).parent) -> str:
    """Return the short hash of what is measured, with a + where files differ from it."""
    words = ["git", "describe", "--always", "--dirty=+", "--abbrev=7"]
    found = subprocess.run(words, cwd=checkout, capture_output=True, text=True, check=False)
    return found.stdout.strip() or "unknown"


def read(out: Path) -> list[dict[str, Any]]:
    """Return the rows of a results file; none where there is no file yet."""
    return (
        [msgspec.json.decode(line) for line in out.read_bytes().splitlines()]
        if out.exists()
        else []
    )


def append(out: Path, line: object) -> None:
    """Add a row, a dict or struct, to a results file, which is made where it is missing."""
    out.parent.mkdir(parents=True, exist_ok=True)
    with out.open("ab") as file:
        file.write(msgspec.json.encode(line) + b"\n")


def put(page: Path, begin: str, text: str, end: str) -> None:
    """Put a text between two marks of a page, in place of what stands there."""
    head, _, rest = page.read_text(encoding="utf-8").partition(begin)
    page.write_text(f"{head}{begin}{text}{end}{rest.partition(end)[2]}", encoding="utf-8")
