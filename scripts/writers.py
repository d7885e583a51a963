"""The table of docs/design/core-state.md: which functions of agent_runtime.core write which field
of an agent's state.

    scripts/writers.py           print it
    scripts/writers.py --write   put it into the page

Read off the code: what is assigned, deleted or changed in place through a name of a CoreState or of
one of its fields.
"""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

from marked import put

from agent_runtime.core.state import CoreState, Soft

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "design" / "core-state.md"
CORE = ROOT / "shared/agent_runtime/core"
OPEN, CLOSE = "<!-- writers: made by scripts/figures -->\n", "<!-- :writers -->\n"
CHANGES = {"append", "clear", "pop", "setdefault", "update"}
"""Methods of dict and list that change it."""
MAKING = "set only when the state is created"
DURABLE = tuple(name for name in CoreState.__struct_fields__ if name != "soft")


STATE, SOFT = "the state", "its soft part"
MADE = {"fresh", "restored"}
"""Functions that return a state."""


class Function:
    """One function of the core: what its names stand for, and the fields that it writes."""

    def __init__(self, function: ast.FunctionDef, of: str) -> None:
        self._known = {arg.arg: {STATE} for arg in function.args.args if _is_state(arg, of)}
        for node in ast.walk(function):
            for name, value in _pairs(node):
                if isinstance(name, ast.Name) and (meant := self._meant(value)):
                    self._known[name.id] = meant
        changed = [one for node in ast.walk(function) for one in _changed(node)]
        self.writes = {field for one in changed for field in self._meant(one)} - {STATE, SOFT}

    def _meant(self, node: ast.expr) -> set[str]:
        """Return what an expression stands for: the state, its soft part, or fields; nothing for
        anything else.
        """
        match node:
            case ast.Name(id=name):
                return self._known.get(name, set())
            case ast.Attribute(value=ast.Name(id="self"), attr="_state"):
                return {STATE}
            case ast.Attribute(value=value, attr=name):
                return {field for one in self._meant(value) if (field := _field(one, name))}
            case ast.Subscript(value=value):
                return self._meant(value)
            case ast.Call(func=ast.Name(id=name)):
                return {STATE} if name in MADE else set()
            case ast.Call(func=ast.Attribute(value=value, attr="get")):
                return self._meant(value)
            case ast.Call(func=ast.Attribute(value=value, attr="fork")):
                return self._meant(value) & {STATE}
            case ast.IfExp(body=one, orelse=other):
                return self._meant(one) | self._meant(other)
            case ast.Tuple(elts=some):
                return set().union(*map(self._meant, some))
        return set()


def _is_state(arg: ast.arg, of: str) -> bool:
    annotated = isinstance(arg.annotation, ast.Name) and arg.annotation.id in (
        "CoreState",
        "Record",
    )
    return annotated or (arg.arg == "self" and of == "CoreState")


def _field(of: str, name: str) -> str:
    if of == STATE:
        return SOFT if name == "soft" else name if name in DURABLE else ""
    return f"soft.{name}" if of == SOFT and name in Soft.__struct_fields__ else ""


def _pairs(node: ast.AST) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Yield each target of an assignment or a loop, with its value."""
    match node:
        case ast.For(target=target, iter=value):
            yield target, value
        case ast.Assign(targets=targets, value=value):
            for target in targets:
                if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
                    yield from zip(target.elts, value.elts, strict=True)
                else:
                    yield target, value


def _changed(node: ast.AST) -> Iterator[ast.expr]:
    """Yield what a statement assigns to, deletes or changes in place; a name that is assigned is
    only another name.
    """
    match node:
        case ast.Assign():
            yield from (target for target, _ in _pairs(node) if not isinstance(target, ast.Name))
        case ast.AugAssign(target=target) | ast.AnnAssign(target=target) if not isinstance(
            target, ast.Name
        ):
            yield target
        case ast.Delete(targets=targets):
            yield from targets
        case ast.Call(func=ast.Attribute(value=value, attr=attr)) if attr in CHANGES:
            yield value
        case ast.Call(func=ast.Name(id="put"), args=[table, *_]):  # agent_runtime.core.streams
            yield table


def writers() -> dict[str, list[str]]:
    """Return field -> the functions that write it, as file and name."""
    found: dict[str, list[str]] = {
        name: [] for name in (*DURABLE, *(f"soft.{one}" for one in Soft.__struct_fields__))
    }
    for path in sorted(CORE.glob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        classes = [(one.name, one.body) for one in tree.body if isinstance(one, ast.ClassDef)]
        for name, body in [("", tree.body), *classes]:
            for function in body:
                if isinstance(function, ast.FunctionDef):
                    for field in Function(function, name).writes:
                        found[field].append(f"`{path.stem}.{function.name.lstrip('_')}`")
    return found


def table() -> str:
    """The fields, each with the functions that write it."""
    return "".join(
        f"- `{field}`: {', '.join(dict.fromkeys(by)) or MAKING}\n"
        for field, by in writers().items()
    )


def page(text: str) -> str:
    """The page with the table as it is now. Raise ValueError where the page has no place for it."""
    return put(text, OPEN, CLOSE, table())


if __name__ == "__main__":
    if sys.argv[1:] == ["--write"]:
        PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    else:
        print(table(), end="")
