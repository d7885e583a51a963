"""What benchmarks import is there: they run too long to be run here, and no type checker reads
them.
"""

import ast
import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROGRAMS = {path.stem: path for path in sorted((ROOT / "benchmarks").glob("*.py"))}
LENT = {path.stem for folder in ("tests", "scripts") for path in (ROOT / folder).rglob("*.py")}


@pytest.mark.parametrize("program", PROGRAMS)
def test_what_a_benchmark_imports_is_there(program: str) -> None:
    for node in ast.walk(ast.parse(PROGRAMS[program].read_text())):
        if isinstance(node, ast.Import):
            assert all(found(name.name) for name in node.names), ast.unparse(node)
        elif isinstance(node, ast.ImportFrom) and node.module in PROGRAMS:
            assert {name.name for name in node.names} <= defined(node.module)
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert found(node.module), ast.unparse(node)


def found(module: str) -> bool:
    """Whether a module is beside, lent by the tests or scripts, or installed."""
    return module in PROGRAMS or module in LENT or importlib.util.find_spec(module) is not None


def defined(program: str) -> set[str]:
    """Return the names that a program defines at its top."""
    names = set()
    for node in ast.parse(PROGRAMS[program].read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        else:
            bound = [one for one in ast.walk(node) if isinstance(one, ast.Name)]
            names |= {one.id for one in bound if isinstance(one.ctx, ast.Store)}
    return names
