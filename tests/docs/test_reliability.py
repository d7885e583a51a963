"""docs/reliability.md: its tables are those of the results."""

import importlib.util
from pathlib import Path
from typing import Any

import msgspec
import pytest

ROOT = Path(__file__).parents[2]


def script(name: str) -> Any:
    """Return a script of benchmarks/ as a module."""
    found = importlib.util.spec_from_file_location(name, ROOT / f"benchmarks/{name}.py")
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def lines(of: Any) -> list[dict[str, Any]]:
    """Return the results of a script."""
    return [msgspec.json.decode(line) for line in of.RESULTS.read_bytes().splitlines()]


@pytest.mark.parametrize("name", ["fault_table", "coming_back", "soak", "kill_boundaries", "fuzz"])
def test_the_tables_are_those_of_the_results(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """`python benchmarks/NAME.py --table` writes them."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    monkeypatch.syspath_prepend(ROOT / "tests/fuzz")
    monkeypatch.syspath_prepend(ROOT / "tests/fleet")
    made = script(name)
    assert f"{made.BEGIN}{made.printed(lines(made))}{made.END}" in made.PAGE.read_text(encoding="utf-8")


def test_each_fault_was_tried_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """No cell stands twice in the table."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    cells = [(line["fault"], line["victim"], line["phase"]) for line in lines(script("fault_table"))]
    assert len(cells) == len(set(cells))
