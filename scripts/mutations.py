"""Mutants of a module: one small change each to its syntax tree, named so that it is found again.

Left alone: annotations, docstrings, constants that a module declares, the text of errors and log
lines.
"""

import ast
import copy
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SAID = {"log", "debug", "info", "warning", "error", "exception"}
"""Calls that only say something."""
COMPARED = {
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
RECKONED = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
    ast.Pow: ast.Mult,
    ast.MatMult: ast.Add,
}
LEFT_ALONE = ("annotation", "returns", "decorator_list", "type_comment")
JOINED = {ast.And: ast.Or, ast.Or: ast.And}
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


@dataclass(frozen=True)
class Mutant:
    """One change: `parent.field` (its `index`-th, where it is a list) becomes `node`; `lines`: of
    the statement.
    """

    module: str
    function: str
    what: str
    source: str
    lines: range
    place: tuple[ast.AST, str, int | None]
    node: ast.AST
    tree: ast.Module

    @property
    def key(self) -> tuple[str, str, str, str]:
        """By this a verdict is found again, till the function changes."""
        return self.module, self.function, self.what, self.source

    def code(self) -> ast.Module:
        """The changed tree, a copy: the other mutants of the module keep theirs."""
        tree, node, (parent, field, index) = copy.deepcopy((self.tree, self.node, self.place))
        if not hasattr(node, "lineno"):
            node = ast.copy_location(node, tree)
        if index is None:
            setattr(parent, field, node)
        else:
            getattr(parent, field)[index] = node
        return ast.fix_missing_locations(tree)


def path(module: str) -> Path:
    """The file of a module of this project; FileNotFoundError where there is none."""
    for folder in (ROOT, ROOT / "shared"):
        if (file := folder.joinpath(*module.split(".")).with_suffix(".py")).is_file():
            return file
    raise FileNotFoundError(
        f"no module {module!r} here or in shared; scripts/mutants.toml names those to mutate"
    )


def mutants(module: str) -> list[Mutant]:
    """Every mutant of a module, in the order of its lines."""
    tree, found, named = (
        ast.parse(path(module).read_text(encoding="utf-8")),
        [],
        dict[tuple[str, str], int](),
    )
    for function, outer, statement, place, node in _walk(tree, "", tree, tree, frozen=True):
        what = f"{_text(_at(place))} -> {_text(node)}"
        named[function, what] = named.get((function, what), 0) + 1
        if named[function, what] > 1:
            what += f" #{named[function, what]}"
        source = hashlib.sha256(wordless(outer).encode()).hexdigest()[:12]
        found.append(Mutant(module, function, what, source, _header(statement), place, node, tree))
    return sorted(found, key=lambda one: one.lines.start)


def wordless(node: ast.AST) -> str:
    """The code of a function without what people read: docstrings, log lines, texts of errors."""
    return ast.dump(_Wordless().visit(copy.deepcopy(node)))


class _Wordless(ast.NodeTransformer):
    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        return None if _said(node) else self.generic_visit(node)

    def visit_Raise(self, node: ast.Raise) -> ast.AST:
        raised = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
        return ast.Raise(raised, node.cause)


Place = tuple[ast.AST, str, int | None]
Found = tuple[str, ast.AST, ast.AST, Place, ast.AST]


def _walk(
    node: ast.AST, function: str, outer: ast.AST, statement: ast.AST, *, frozen: bool
) -> Iterator[Found]:
    """`frozen`: in the module's own statements, whose constants stay."""
    for field, value in ast.iter_fields(node):
        if field in LEFT_ALONE or (field == "keywords" and isinstance(node, ast.ClassDef)):
            continue
        for index, child in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if not isinstance(child, ast.AST) or _said(child):
                continue
            inner, within, stays = function, outer, frozen
            if isinstance(child, (*FUNCTIONS, ast.ClassDef)):
                inner, stays = f"{function}.{child.name}".lstrip("."), False
                within = child if isinstance(outer, ast.Module | ast.ClassDef) else outer
            here = child if isinstance(child, ast.stmt) else statement
            if not stays:
                yield from (
                    (inner, within, here, (node, field, index), new)
                    for new in _changes(child, node, field)
                )
            if not isinstance(child, ast.Raise):
                yield from _walk(child, inner, within, here, frozen=stays)


def _said(node: ast.AST) -> bool:
    """Whether it is text for people: a log line, a formatted string, a docstring."""
    call = node.value if isinstance(node, ast.Expr) else node
    if isinstance(call, ast.Constant | ast.JoinedStr):
        return isinstance(node, ast.Expr | ast.JoinedStr)
    return (
        isinstance(call, ast.Call)
        and isinstance(call.func, ast.Attribute)
        and call.func.attr in SAID
    )


def _changes(node: ast.AST, parent: ast.AST, field: str) -> Iterator[ast.AST]:
    yield from _statements(node) if isinstance(node, ast.stmt) else _expressions(node)
    asked = field == "test" or (field == "ifs" and isinstance(parent, ast.comprehension))
    if asked and isinstance(node, ast.expr) and not _negated(node):
        yield ast.UnaryOp(ast.Not(), node)


def _statements(node: ast.stmt) -> Iterator[ast.AST]:
    match node:
        case ast.Return(value=ast.expr() as value) if ast.unparse(value) != "None":
            yield ast.Return(ast.Constant(None))
        case ast.Expr() | ast.AugAssign() | ast.Raise() | ast.Delete():
            yield ast.Pass()
        case ast.Assign(targets=[ast.Attribute() | ast.Subscript(), *_]):
            yield ast.Pass()
        case ast.Break():
            yield ast.Continue()
        case ast.Continue():
            yield ast.Break()


def _expressions(node: ast.AST) -> Iterator[ast.AST]:
    match node:
        case ast.Compare(ops=[operator, *more]) if type(operator) in COMPARED:
            yield ast.Compare(node.left, [COMPARED[type(operator)](), *more], node.comparators)
        case ast.BoolOp():
            yield ast.BoolOp(JOINED[type(node.op)](), node.values)
        case ast.BinOp() if type(node.op) in RECKONED:
            yield ast.BinOp(node.left, RECKONED[type(node.op)](), node.right)
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            yield node.operand
        case ast.Constant(value=bool(truth)):
            yield ast.Constant(not truth)
        case ast.Constant(value=int(number) | float(number)):
            yield from (ast.Constant(number + 1), ast.Constant(number - 1))
        case ast.Call(keywords=[_, *_]):
            for gone in node.keywords:
                if gone.arg:
                    yield ast.Call(
                        node.func, node.args, [one for one in node.keywords if one is not gone]
                    )


def _negated(node: ast.expr) -> bool:
    """Whether a change of its operator negates it already."""
    if isinstance(node, ast.Compare):
        return len(node.ops) == 1 and type(node.ops[0]) in (
            ast.Eq,
            ast.NotEq,
            ast.In,
            ast.NotIn,
            ast.Is,
            ast.IsNot,
        )
    return isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)


def _header(statement: ast.AST) -> range:
    """The lines of a statement without those of the statements in it."""
    first, last = getattr(statement, "lineno", 1), getattr(statement, "end_lineno", 1)
    body = getattr(statement, "body", None)
    if isinstance(body, list) and body and isinstance(statement, ast.stmt):
        last = max(first, body[0].lineno - 1)
    return range(first, last + 1)


def _at(place: Place) -> ast.AST:
    parent, field, index = place
    value = getattr(parent, field)
    return value if index is None else value[index]


def _text(node: ast.AST) -> str:
    text = " ".join(ast.unparse(ast.fix_missing_locations(copy.deepcopy(node))).split())
    return text if len(text) <= 100 else f"{text[:60]} … {text[-38:]}"
