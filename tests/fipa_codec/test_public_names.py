"""Every public name and every module of the package has a docstring."""

import ast
import importlib
import inspect
from itertools import pairwise
from pathlib import Path

import fipa_codec
from fipa_codec import acl_string, protocols

PACKAGE = Path(fipa_codec.__file__).parent


def described_constants() -> set[str]:
    """Return the names that any module of the package assigns with a docstring after the
    assignment.
    """
    found = set()
    for path in PACKAGE.rglob("*.py"):
        body = ast.parse(path.read_text(encoding="utf-8")).body
        for one, after in pairwise(body):
            if (
                isinstance(after, ast.Expr)
                and isinstance(after.value, ast.Constant)
                and isinstance(after.value.value, str)
            ):
                targets = (
                    one.targets if isinstance(one, ast.Assign) else [getattr(one, "target", None)]
                )
                found |= {target.id for target in targets if isinstance(target, ast.Name)}
    return found


def test_every_public_name_has_a_docstring():
    """Of its own, not an inherited one; and every module has one."""
    lacking, constants = [], described_constants()
    for module, name in (
        (one, name) for one in (fipa_codec, acl_string, protocols) for name in one.__all__
    ):
        value = getattr(module, name)
        if not (inspect.isclass(value) or inspect.isfunction(value)):
            lacking += [name] if name not in constants else []
            continue
        lacking += (
            []
            if value.__dict__.get("__doc__", value.__doc__ if inspect.isfunction(value) else None)
            else [name]
        )
        for attribute, member in vars(value).items():
            ours = inspect.isfunction(member) and member.__module__.startswith("fipa_codec")
            lacking += (
                [f"{name}.{attribute}"]
                if ours and attribute[0] != "_" and not member.__doc__
                else []
            )
    for path in PACKAGE.rglob("*.py"):
        name = ".".join(
            ("fipa_codec", *path.relative_to(PACKAGE).with_suffix("").parts)
        ).removesuffix(".__init__")
        lacking += [] if importlib.import_module(name).__doc__ else [name]
    assert not lacking
