"""Mutants: each is one change that compiles and has a name of its own; a test that notices it kills
it.
"""

import ast
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

import mutations  # noqa: E402  (after the path is set)

Made = Callable[[str], list[str]]


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Made]:
    """The names of the mutants of a source."""

    def names(source: str) -> list[str]:
        (tmp_path / "toy.py").write_text(source)
        monkeypatch.setattr(mutations, "ROOT", tmp_path)
        return [one.what for one in mutations.mutants("toy")]

    return names


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("return a < b", ["return a < b -> return None", "a < b -> a <= b"]),
        ("return None", []),
        ("x = a and b", ["a and b -> a or b"]),
        ("x = a + 2", ["a + 2 -> a - 2", "2 -> 3", "2 -> 1"]),
        ("x = not a", ["not a -> a"]),
        ("x = f(a, k=b)", ["f(a, k=b) -> f(a)"]),
        ("f(a)", ["f(a) -> pass"]),
        ("a.b = True", ["a.b = True -> pass", "True -> False"]),
        ("raise E('x', 1)", ["raise E('x', 1) -> pass"]),
        ("log.info('x', n=1)", []),
        ("x: int = f'{a + 1}'", []),
        ("if a: f()", ["a -> not a", "f() -> pass"]),
        ("if a == b: f()", ["a == b -> a != b", "f() -> pass"]),
        ("for x in a: break", ["break -> continue"]),
    ],
)
def test_a_line_has_these_mutants(made: Made, line: str, expected: list[str]) -> None:
    """And no others."""
    assert sorted(made(f"def f():\n    {line}\n")) == sorted(expected)


def test_what_a_module_declares_stays() -> None:
    """Annotations, docstrings, decorators and constants outside functions."""
    source = '"""Doc."""\nBOUND = 16 + 1\n\n@dec(k=1)\ndef f(x: 3 = 4) -> 5:\n    """Doc."""\n'
    tree = ast.parse(source)
    found = [place for *_, place, _ in mutations._walk(tree, "", tree, tree, frozen=True)]
    assert [ast.unparse(mutations._at(place)) for place in found] == ["4", "4"]


@pytest.mark.parametrize("module", ["agent_runtime.core.turn", "velma.control.safety"])
def test_each_mutant_is_another_program_with_a_name_of_its_own(module: str) -> None:
    """It compiles, and differs from the module as it is."""
    found = mutations.mutants(module)
    assert len({one.key for one in found}) == len(found) > 0
    as_is = ast.dump(ast.parse(mutations.path(module).read_text()))
    for one in found:
        changed = one.code()
        compile(changed, module, "exec")
        assert ast.dump(changed) != as_is
    assert ast.dump(found[0].tree) == as_is, "a mutant changed the tree of the others"
