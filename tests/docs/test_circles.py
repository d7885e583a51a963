"""No circle of imports between modules: each can be read, tested and loaded with only what stands
below it.

Imports inside functions count: a circle that is only put off is one. What only the type checker
reads does not.
"""

import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = (
    "services",
    "velma",
    "c_library",
    "fipa_codec",
    "agent_runtime",
    "topdown",
    "operate",
    "console",
    "companion",
)
SEVERAL = 300
"""A graph with fewer modules is not that of this project (it has about 380)."""
Edges = dict[str, set[str]]


@cache
def edges() -> Edges:
    """Return who imports whom directly."""
    graph = grimp.build_graph(
        PACKAGES[0], *PACKAGES[1:], exclude_type_checking_imports=True, cache_dir=None
    )
    return {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}


def circles(graph: Edges) -> Iterator[list[str]]:
    """Yield the shortest circle through each module that has one, once."""
    told: set[frozenset[str]] = set()
    for module in sorted(graph):
        circle = back_to(module, graph)
        if circle and frozenset(circle) not in told:
            told.add(frozenset(circle))
            yield circle


def back_to(start: str, graph: Edges) -> list[str]:
    """Return the shortest way from a module back to itself, without its repeated end; [] where
    there is none.
    """
    before: dict[str, str] = {}
    edge = [start]
    while edge and start not in before:
        found = [
            (one, other) for one in edge for other in sorted(graph[one]) if other not in before
        ]
        edge = []
        for one, other in found:
            if other not in before:
                before[other] = one
                edge.append(other)
    if start not in before:
        return []
    way = [before[start]]
    while way[-1] != start:
        way.append(before[way[-1]])
    return way[::-1]


def test_no_module_imports_itself_over_others() -> None:
    """A circle is named with all its modules: move what both need into a module of its own."""
    assert [" -> ".join([*circle, circle[0]]) for circle in circles(edges())] == []


def test_every_module_is_in_the_graph() -> None:
    """A file that is not looked at would pass."""
    files = [file for package in PACKAGES for file in folder(package).rglob("*.py")]
    assert len(edges()) == len(files) > SEVERAL


def folder(package: str) -> Path:
    """Return where a package's files are."""
    return next(place for place in (ROOT / package, ROOT / "shared" / package) if place.is_dir())


@pytest.mark.parametrize("circle", [["a"], ["a", "b"], ["a", "b", "c"]])
def test_a_circle_is_found_and_told_once(circle: list[str]) -> None:
    """Of any length, beside modules that only lead to it."""
    graph: Edges = {"lead": {circle[0]}, "end": set()}
    for one, other in zip(circle, [*circle[1:], circle[0]], strict=True):
        graph[one] = {other, "end"}
    assert list(circles(graph)) == [circle]


def test_imports_inside_functions_count_and_those_for_types_do_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the module's docstring says."""
    package = tmp_path / "circling"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "a.py").write_text("def f():\n    from circling import b\n")
    (package / "b.py").write_text("from circling import a\n")
    (package / "c.py").write_text(
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from circling import d\n"
    )
    (package / "d.py").write_text("from circling import c\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "circling", raising=False)
    graph = grimp.build_graph("circling", exclude_type_checking_imports=True, cache_dir=None)
    found = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    assert list(circles(found)) == [["circling.a", "circling.b"]]
