"""Errors as the code itself declares them: exceptions, warnings of the log, exit codes. Read, not
run.

docs/errors.md says of each of them the cause and what to do (scripts/errors.toml); nothing may be
missing or too much.
"""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
ROOMS = (
    *map(
        "shared/{}".format,
        ("c_library", "fipa_codec", "agent_runtime", "topdown", "operate", "console", "companion"),
    ),
    "velma",
    "services",
)
BUILT_IN = {
    "Exception",
    "ValueError",
    "TypeError",
    "LookupError",
    "RuntimeError",
    "MemoryError",
    "KeyError",
    "OSError",
}
LEVELS = ("warning", "error")
ENUMS = {  # words that a person meets as the reason of something; each member has its row
    "verdicts": ("shared/topdown/judge/verdicts.py", "Verdict"),
    "acts": ("shared/companion/languages/rc.py", "NotDoneKind"),
    "states": ("shared/operate/fleet_file.py", "ProcessState"),
}
# members of agent_runtime.core.reception.What
DROPS = {"What.DROP": "stray", "What.REFUSE": "not understood"}
CODES = "shared/console/errors.py"


class Declared(NamedTuple):
    """Something that can go wrong: its name, where, and the form of its message (`…` for what
    varies).
    """

    name: str
    where: str
    message: str


def sources() -> tuple[tuple[str, ast.Module], ...]:
    """Every module of the packages, by its path below the root."""
    return _parsed(ROOT, ROOMS)


@cache
def _parsed(root: Path, rooms: tuple[str, ...]) -> tuple[tuple[str, ast.Module], ...]:
    paths = [path for room in rooms for path in sorted((root / room).rglob("*.py"))]
    return tuple(
        (str(path.relative_to(root)), ast.parse(path.read_text(encoding="utf-8"))) for path in paths
    )


def calls() -> Iterator[tuple[str, ast.Call]]:
    """Every call in them."""
    return ((path, call) for path, found in _calls(ROOT, ROOMS) for call in found)


@cache  # walking through all of the code takes seconds
def _calls(root: Path, rooms: tuple[str, ...]) -> tuple[tuple[str, tuple[ast.Call, ...]], ...]:
    every = ((path, tuple(ast.walk(tree))) for path, tree in _parsed(root, rooms))
    return tuple(
        (path, tuple(one for one in nodes if isinstance(one, ast.Call))) for path, nodes in every
    )


def exceptions() -> dict[str, Declared]:
    """Every class that is an exception, by its name; two of one name are kept apart by their
    module.
    """
    classes = [
        (path, node)
        for path, tree in sources()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
    ]
    known = set(BUILT_IN)
    while new := {node.name for _, node in classes if known & _bases(node)} - known:
        known |= new
    found: dict[str, Declared] = {}
    for path, node in classes:
        if known & _bases(node):
            name = node.name if node.name not in found else f"{Path(path).stem}.{node.name}"
            found[name] = Declared(name, path, _message(node))
    return found


def _called(call: ast.Call) -> str:
    """The name of a function or a class, without what stands before it."""
    return call.func.id if isinstance(call.func, ast.Name) else getattr(call.func, "attr", "")


def _bases(node: ast.ClassDef) -> set[str]:
    return {
        base.id if isinstance(base, ast.Name) else getattr(base, "attr", "") for base in node.bases
    }


def _message(node: ast.ClassDef) -> str:
    """Return the argument of `super().__init__`, "" if that is left to the caller that raises
    it.
    """
    for call in ast.walk(node):
        if (
            isinstance(call, ast.Call)
            and call.args
            and _called(call) == "__init__"
            and "super()" in ast.unparse(call)
        ):
            return _words(call.args[-1])
    return ""


def _words(node: ast.expr) -> str:
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=values):
            return "".join(
                _words(value) if isinstance(value, ast.Constant) else "…" for value in values
            )
        case ast.IfExp(body=body, orelse=other):
            return f"{_words(body)} / {_words(other)}"
    return "…"


def warnings() -> dict[str, Declared]:
    """Every event that some module logs as a warning or an error."""
    found: dict[str, Declared] = {}
    for path, tree in sources():
        scopes = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
        for scope in scopes:
            for node in ast.walk(scope):
                for words in _told(node, scope, tree):
                    found.setdefault(words, Declared(words, path, ""))
    return found


def _told(node: ast.AST, scope: ast.FunctionDef, tree: ast.Module) -> list[str]:
    """The loud events of a call; or of a pair (event, level), which is handed on."""
    match node:
        case ast.Call(args=[first, *_]) if _loud(node, scope):
            return _events(first, scope) or _events(first, tree)
        case ast.Tuple(elts=[first, ast.Constant(value=level)]) if level in LEVELS:
            return [words for words in _events(first, scope) if words != "…"]
    return []


def _events(first: ast.expr, tree: ast.AST) -> list[str]:
    """The events that an expression may be; none for a parameter, whose values are where it is
    called.
    """
    match first:
        case ast.Constant(value=str(words)):
            return [words]
        case ast.IfExp(body=body, orelse=other):
            return _events(body, tree) + _events(other, tree)
        case ast.JoinedStr():
            return [_words(first)]
        case ast.Name(id=name):
            values = [
                each.value
                for each in ast.walk(tree)
                if isinstance(each, ast.Assign) and name in _targets(each)
            ]
            return [event for value in values for event in _events(value, tree)]
    return []


def _targets(assign: ast.Assign) -> list[str]:
    return ast.unparse(assign.targets[0]).strip("()").split(", ")


def _loud(call: ast.Call, tree: ast.AST) -> bool:
    """Whether a call logs at a loud level: said there, or in a variable that is called `level`."""
    levels = [keyword.value for keyword in call.keywords if keyword.arg == "level"]
    if any(isinstance(level, ast.Name) for level in levels):
        levels += [
            each.value
            for each in ast.walk(tree)
            if isinstance(each, ast.Assign) and "level" in _targets(each)
        ]
    return any(
        isinstance(part, ast.Constant) and part.value in LEVELS
        for level in levels
        for part in ast.walk(level)
    )


def rejected() -> dict[str, Declared]:
    """Return the messages that the runtime drops, counts and reports (`reject` of the intake)."""
    found = {}
    for path, call in calls():
        if (
            isinstance(call, ast.Call)
            and isinstance(call.func, ast.Name)
            and call.func.id == "reject"
            and len(call.args) > 3
        ):
            what = call.args[3]
            words = what.value if isinstance(what, ast.Constant) else DROPS[ast.unparse(what)]
            found[words] = Declared(words, path, _words(call.args[4]))
    return found


def members(path: str, name: str) -> dict[str, Declared]:
    """The words of an enumeration."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    (node,) = [each for each in tree.body if isinstance(each, ast.ClassDef) and each.name == name]
    values = [each.value for each in node.body if isinstance(each, ast.Assign)]
    return {
        each.value: Declared(each.value, path, "")
        for each in values
        if isinstance(each, ast.Constant)
    }


def codes() -> dict[str, Declared]:
    """The exit codes of `roco`."""
    tree = ast.parse((ROOT / CODES).read_text(encoding="utf-8"))
    pairs = [(each.targets[0], each.value) for each in tree.body if isinstance(each, ast.Assign)]
    return {
        str(value.value): Declared(str(value.value), CODES, target.id)
        for target, value in pairs
        if isinstance(target, ast.Name)
        and isinstance(value, ast.Constant)
        and isinstance(value.value, int)
    }


@cache
def every() -> dict[str, dict[str, Declared]]:
    """All kinds."""
    told = {"exceptions": exceptions(), "log": warnings(), "dropped": rejected(), "codes": codes()}
    return told | {kind: members(*where) for kind, where in ENUMS.items()}
