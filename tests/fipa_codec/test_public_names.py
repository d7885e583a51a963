"""Every public name and every module of the package has a docstring."""

import ast
import importlib
import inspect
from itertools import pairwise
from pathlib import Path

import pytest

import fipa_codec
from fipa_codec import acl_string, protocols

PACKAGE = Path(fipa_codec.__file__).parent
NAMES = [(module, name) for module in (fipa_codec, acl_string, protocols) for name in module.__all__]


def described_constants() -> set[str]:
    """Return the names that any module of the package assigns with a docstring after the assignment."""
    found = set()
    for path in PACKAGE.rglob("*.py"):
        body = ast.parse(path.read_text(encoding="utf-8")).body
        for one, after in pairwise(body):
            if (
                isinstance(after, ast.Expr)
                and isinstance(after.value, ast.Constant)
                and isinstance(after.value.value, str)
            ):
                targets = one.targets if isinstance(one, ast.Assign) else [getattr(one, "target", None)]
                found |= {target.id for target in targets if isinstance(target, ast.Name)}
    return found


@pytest.mark.parametrize(("module", "name"), NAMES, ids=[f"{module.__name__}.{name}" for module, name in NAMES])
def test_every_public_name_has_a_docstring(module, name):
    """Of its own, not an inherited one."""
    value = getattr(module, name)
    if inspect.isclass(value) or inspect.isfunction(value):
        assert value.__dict__.get("__doc__") if inspect.isclass(value) else value.__doc__
        for attribute, member in vars(value).items():
            if (
                inspect.isfunction(member)
                and not attribute.startswith("_")
                and member.__module__.startswith("fipa_codec")
            ):
                assert member.__doc__, attribute
    else:
        assert name in described_constants()


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_every_module_has_a_docstring(path):
    """Of its own; imported by its name."""
    name = ".".join(("fipa_codec", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")
    assert importlib.import_module(name).__doc__
