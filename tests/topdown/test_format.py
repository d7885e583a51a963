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
from topdown.model.elements import CHANGES, FORMAT, DesignFile, Row
from topdown.model.findings import Kind
from topdown.model.machines import Cause

PAGE = (Path(__file__).resolve().parents[2] / "docs/design/format.md").read_text(encoding="utf-8")
WORDS = {str: "text", bool: "true or false", int: "integer", float: "number"}
FIELD = re.compile(
    r"^- (?P<names>`[\w-]+`(?:, `[\w-]+`)*)(?: \((?P<brackets>.+?)\))?(?:: (?P<meaning>.+))?$",
    re.MULTILINE,
)
SHARED = {"name", "text", "ruling"}
"""Fields that the page explains once for all entries."""
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


def brackets(kind: Any, field: msgspec.structs.FieldInfo) -> str:
    """Type and default as the page says them behind a field: nothing for a required text."""
    said = {"required": "", "none": "optional"}.get(default(field), f"default {default(field)}")
    return ", ".join(part for part in (words(kind), said) if part not in ("text", ""))


def section(title: str) -> str:
    """The text under a heading, each item of a list on one line."""
    found = re.search(rf"^## {re.escape(title)}\n(.*?)(?=^## |\Z)", PAGE, re.MULTILINE | re.DOTALL)
    assert found, f"docs/design/format.md has no section {title}"
    return found.group(1).replace("\n  ", " ")


def test_every_field_is_documented_and_no_other() -> None:
    """Name, type and default are those of the code; a field has a meaning, or a link to one."""
    for kind in structs():
        told = {
            name: (row["brackets"] or "", row["meaning"])
            for row in FIELD.finditer(section(kind.__name__))
            for name in re.findall(r"`(.+?)`", row["names"])
        }
        hints, fields = get_type_hints(kind), msgspec.structs.fields(kind)
        made = {field.encode_name: brackets(hints[field.name], field) for field in fields}
        assert {name: said for name, (said, _) in told.items()} == made, kind.__name__
        silent = {
            name for name, (said, meaning) in told.items() if not meaning and "](#" not in said
        }
        assert silent <= SHARED, kind.__name__


def test_every_section_of_an_entry_is_one_of_the_code() -> None:
    """A kind of entry that is gone leaves no section behind."""
    titles = set(re.findall(r"^## (\w+)$", PAGE, re.MULTILINE))
    assert titles - {"Formats", "Events"} == {kind.__name__ for kind in structs()}


def test_every_finding_is_documented() -> None:
    """By its name, once."""
    told = re.findall(
        r"^- ([^:\n]+)(?:: .+)?$", section("Findings of `roco design check`"), re.MULTILINE
    )
    assert sorted(told) == sorted(Kind)


def test_every_format_is_documented() -> None:
    """With its sentence of what changed."""
    told = re.findall(r"^- (\d+): (.+)$", section("Formats"), re.MULTILINE)
    assert told[0][0] == "1"
    assert {int(number): words for number, words in told[1:]} == CHANGES
    assert max(CHANGES) == FORMAT


def test_every_event_is_documented_with_a_row() -> None:
    """The row has that event."""
    told = re.findall(r"^- `(.+?)`: .+ `(\{.+\})`$", section("Events"), re.MULTILINE)
    events = {}
    for event, row in told:
        (read,) = msgspec.convert(tomllib.loads(f"row = [{row}]")["row"], list[Row])
        events[event.partition(" ")[0]] = read.on.partition(" ")[0]
    assert events.pop("USE") == "order"
    assert events == {cause: cause for cause in set(Cause) - {Cause.TAKE}}


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
