"""docs/glossary.md names what is in the code."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
ROWS = [
    [cell.strip() for cell in line.strip("|\n").split("|")]
    for line in (ROOT / "docs/glossary.md").read_text().splitlines()
    if line.startswith("| ") and not line.startswith("| word ")
]


def names(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.ClassDef):
            yield node.name


def file_of(module: str) -> Path | None:
    path = module.replace(".", "/") + ".py"
    return next(
        (folder / path for folder in (ROOT / "shared", ROOT) if (folder / path).exists()), None
    )


def test_what_the_glossary_names_is_in_the_code() -> None:
    wrong = []
    for word, _, symbol, _ in ROWS:
        module, _, name = symbol.strip("`").rpartition(".")
        file = file_of(module)
        if symbol and (file is None or name not in names(file)):
            wrong.append(f"{word}: {symbol}")
    assert len(ROWS) >= 30
    assert wrong == []
