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
    assert f"{made.BEGIN}{made.printed(lines(made))}{made.END}" in made.PAGE.read_text(
        encoding="utf-8"
    )


def test_a_fault_is_tried_again_only_where_it_had_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cell that poured stands once, so that no lucky run takes the place of another one."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    poured = set()
    for line in lines(script("fault_table")):
        cell = (line["fault"], line["victim"], line["phase"])
        assert cell not in poured, cell
        poured |= {cell} if line["poured"] else set()
