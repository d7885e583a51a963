"""docs/design/format.md documents every field of a design file, and no other; its examples can be
read.
"""

import re
import tomllib
from enum import StrEnum
from pathlib import Path
from types import EllipsisType
from typing import Any, get_args, get_origin, get_type_hints

import msgspec

from topdown.check import check
from topdown.check.recorded import Observed
from topdown.model import loading
from topdown.model.design import Design
from topdown.model.elements import DesignFile
from topdown.model.findings import Kind

PAGE = (Path(__file__).resolve().parents[2] / "docs/design/format.md").read_text(encoding="utf-8")
WORDS = {str: "text", bool: "true or false", int: "integer", float: "number"}
ROW = re.compile(
    r"^\| `(?P<name>[\w-]+)` \| (?P<type>.+?) \| (?P<default>.+?) \| (?P<meaning>.+?) \|$",
    re.MULTILINE,
)
EXAMPLES = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)


def structs(kind: Any = DesignFile) -> list[type[msgspec.Struct]]:
    """Every kind of entry that a design file may hold."""
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        inner = [one for hint in get_type_hints(kind).values() for one in structs(hint)]
        return list(dict.fromkeys([kind, *inner]))
    return [one for part in get_args(kind) for one in structs(part)]


def words(kind: Any) -> str:
    """A type as the page says it."""
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        return f"[{kind.__name__}](#{kind.__name__.lower()})"
    if isinstance(kind, type) and issubclass(kind, StrEnum):
        return kind.__name__
    parts = [part for part in get_args(kind) if part is not type(None)]
    if get_origin(kind) is tuple:
        if isinstance(parts[-1], EllipsisType):
            return f"list of {words(parts[0])}"
        return f"[{', '.join(map(words, parts))}]"
    return WORDS.get(kind) or " or ".join(map(words, parts))


def default(field: msgspec.structs.FieldInfo) -> str:
    """A default as the page says it."""
    if field.required:
        return "required"
    value = None if field.default is msgspec.NODEFAULT else field.default
    if value in ("", (), None):
        return "none"
    return str(value).lower() if isinstance(value, bool) else f"{value:g}"


def section(title: str) -> str:
    """The text under a heading."""
    found = re.search(rf"^## {re.escape(title)}\n(.*?)(?=^## |\Z)", PAGE, re.MULTILINE | re.DOTALL)
    assert found, f"docs/design/format.md has no section {title}"
    return found.group(1)


def test_every_field_is_documented_and_no_other() -> None:
    """Name, type and default are those of the code; every field has a meaning."""
    for kind in structs():
        told = {
            row["name"]: (row["type"], row["default"])
            for row in ROW.finditer(section(kind.__name__))
        }
        hints, fields = get_type_hints(kind), msgspec.structs.fields(kind)
        made = {field.encode_name: (words(hints[field.name]), default(field)) for field in fields}
        assert told == made, kind.__name__


def test_every_section_of_an_entry_is_one_of_the_code() -> None:
    """A kind of entry that is gone leaves no section behind."""
    titles = {
        title
        for title in re.findall(r"^## (\w+)$", PAGE, re.MULTILINE)
        if ROW.search(section(title))
    }
    assert titles == {kind.__name__ for kind in structs()}


def test_every_finding_is_documented() -> None:
    """By its name, with its reason."""
    told = re.findall(
        r"^\| ([^|`]+?) \| [^|]+ \|$", section("Findings of `roco design check`"), re.MULTILINE
    )
    assert set(told) - {"Finding", "---"} == set(Kind)


def test_the_least_design_is_one() -> None:
    """The first example is whole and sound."""
    assert check(Design(loading.read(EXAMPLES[0]))) == ()


def test_every_example_is_read() -> None:
    """As that part of a design file which it is."""
    hints = get_type_hints(DesignFile)
    for example in EXAMPLES[1:]:
        for name, value in tomllib.loads(example).items():
            assert msgspec.convert(value, hints[name]), example


def test_the_example_of_a_recording_is_one() -> None:
    """It is read as observations."""
    (example,) = re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)
    assert msgspec.json.decode(example, type=Observed).communicates[0].bytes == 100
