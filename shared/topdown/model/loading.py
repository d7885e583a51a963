"""Reads a design file into typed entries; an error names file, line, field, what is wrong and what
would be right.

The only I/O of topdown: reading the file.
"""

import re
import tomllib
from codecs import BOM_UTF8
from pathlib import Path
from typing import Any

import msgspec

from topdown.model import elements
from topdown.model.errors import DesignError

_AT = re.compile(r"^(?P<wrong>.*?)(?: - at `\$(?P<path>[^`]*)`)?$", re.DOTALL)
_PART = re.compile(r"\.([\w-]+)|\[(\d+|\.\.\.)\]")
_HEADER = re.compile(r"^\s*(\[\[?)\s*([\w.-]+)\s*\]\]?\s*(?:#.*)?$")
_TOML_LINE = re.compile(r"\(at line (\d+), column \d+\)")
_UNKNOWN = re.compile(r"unknown field `([^`]+)`")

_FORMER = {
    "house": "it is called [[signal]] now",
    "claim": "it is gone: keep it in a file of your own",
    "tally": "it is gone: keep it in a file of your own",
}
"""Top-level entries of former formats, and what to do."""

_HALVES = (
    'a step divides a group in exactly two halves: write into = ["one", "other"], and divide one of'
    " them again in a later step"
)
_TOML = "the file must be TOML 1.0"

Path_ = tuple[str | int, ...]


def load(path: Path) -> elements.DesignFile:
    """The design file at `path`. Raises DesignError."""
    return read(text_of(path), str(path))


def text_of(path: Path) -> str:
    """What is written in a file, without a byte order mark. Raises DesignError where it is not
    UTF-8.
    """
    data = path.read_bytes().removeprefix(BOM_UTF8)
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        wrong = f"byte {data[error.start]:02x} is not UTF-8"
        file, line = str(path), data.count(b"\n", 0, error.start) + 1
        raise DesignError(file, line, "(file)", wrong, _TOML) from error


def read(text: str, name: str = "design.toml") -> elements.DesignFile:
    """The design written in `text`; `name` is what errors call the file. Raises DesignError."""
    try:
        return msgspec.convert(tomllib.loads(text), elements.DesignFile)
    except msgspec.ValidationError as error:  # a ValueError, too
        raise _not_fitting(error, text, name) from error
    # of tomllib: its own, numbers too long, nesting too deep
    except (ValueError, RecursionError) as error:
        found = _TOML_LINE.search(str(error))
        line = int(found.group(1)) if found else len(text.splitlines())
        raise DesignError(name, line, "(file)", str(error), _TOML) from error


def _not_fitting(error: msgspec.ValidationError, text: str, name: str) -> DesignError:
    match = _AT.match(str(error))
    wrong = match.group("wrong") if match else str(error)
    path = parts(match.group("path") or "" if match else "")
    unknown = _UNKNOWN.search(wrong)
    line = line_of(text, (*path, unknown.group(1)) if unknown else path)
    field = (
        ".".join(f"[{part}]" if isinstance(part, int) else part for part in path).replace(".[", "[")
        or "(file)"
    )
    former = _FORMER.get(unknown.group(1)) if unknown and not path else None
    return DesignError(name, line, field, wrong, former or _right(path, wrong))


def parts(path: str) -> Path_:
    """The parts of a path like `.protocol[3].durable`."""
    found = _PART.findall(path)
    return tuple(name or (int(index) if index.isdigit() else 0) for name, index in found)


def _right(path: Path_, wrong: str) -> str:
    """In words what the entry at `path` may hold."""
    if path[-2:] == ("divide", "into"):
        return _HALVES
    if path == ("format",):
        return f"this version of robot-companion reads formats 1 to {elements.FORMAT}"
    kind: Any = elements.DesignFile
    for part in path:
        kind = _step(kind, part)
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        known = ", ".join(field.name for field in msgspec.structs.fields(kind))
        return f"an entry {kind.__name__} has the fields {known}"
    return (
        f"it must be {_kind_text(kind)}"
        if kind is not None
        else f"see topdown.model.elements ({wrong})"
    )


def _step(kind: Any, part: str | int) -> Any:
    """The type one part further down."""
    info = next((a for a in getattr(kind, "__args__", ()) if a not in (type(None), Ellipsis)), None)
    if isinstance(part, int):
        return info
    struct = kind if isinstance(kind, type) else info
    if struct is None or not issubclass(struct, msgspec.Struct):
        return None
    return next(
        (field.type for field in msgspec.structs.fields(struct) if field.name == part), None
    )


_KINDS: dict[Any, str] = {str: "text", bool: "true or false", int: "an integer", float: "a number"}


def _kind_text(kind: Any) -> str:
    """A type in words, as docs/design/format.md has it."""
    parts = getattr(kind, "__args__", ())
    if not parts:
        return _KINDS.get(kind) or str(getattr(kind, "__name__", kind))
    if getattr(kind, "__origin__", None) is not tuple:
        return " or ".join(_kind_text(part) for part in parts if part is not type(None))
    inner = list(dict.fromkeys(_kind_text(part) for part in parts if part is not Ellipsis))
    if Ellipsis in parts:
        return f"a list, of each element: {inner[0]}"
    each = f"each {inner[0]}" if len(inner) == 1 else ", ".join(inner)
    return f"a list of exactly {len(parts)}: {each}"


def line_of(text: str, path: Path_) -> int | None:
    """The line (from 1) of the entry or field at `path`, or of the nearest thing around it; None
    for the whole file.
    """
    line: int | None = None
    begin, end, lines = 0, None, text.splitlines()
    prefix = ""
    for here, part in enumerate(path):
        if isinstance(part, int):
            found = _headers(lines, prefix, begin, end)
            if part >= len(found):
                break
            line, begin = found[part] + 1, found[part] + 1
            end = found[part + 1] if part + 1 < len(found) else end
            continue
        prefix = f"{prefix}.{part}" if prefix else part
        isolated = here + 1 >= len(path) or not isinstance(path[here + 1], int)
        at = _field(lines, part, begin, end)
        if at is not None:
            return _element(lines, at, path[here + 1 :]) + 1
        table = _headers(lines, prefix, begin, end)
        if isolated and table:
            line, begin = table[0] + 1, table[0] + 1
    return line


def _element(lines: list[str], at: int, rest: Path_) -> int:
    """Index of the line of an element of a list that is written one element a line, below the field
    at index `at`.
    """
    if not rest or not isinstance(rest[0], int) or not lines[at].rstrip().endswith("["):
        return at
    opened = (
        index
        for index in range(at + 1, len(lines))
        if lines[index].lstrip().startswith(("{", "[", '"'))
    )
    for count, index in enumerate(opened):
        if count == rest[0]:
            return index
    return at


def _headers(lines: list[str], name: str, begin: int, end: int | None) -> list[int]:
    """Indices of the lines that open a table `name`."""
    span = range(begin, len(lines) if end is None else end)
    matches = ((index, _HEADER.match(lines[index])) for index in span)
    return [index for index, match in matches if match and match.group(2) == name]


def _field(lines: list[str], name: str, begin: int, end: int | None) -> int | None:
    """Index of the line `name = ...` before the next header."""
    for index in range(begin, len(lines) if end is None else end):
        if _HEADER.match(lines[index]):
            return None
        if re.match(rf"^\s*{re.escape(name)}\s*=", lines[index]):
            return index
    return None
