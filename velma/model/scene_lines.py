"""The line of a scene's TOML file that an error is about. Knows the file's layout, not what a scene means."""

import re
from collections.abc import Iterator

_PATH = re.compile(r"\$\.(?P<table>\w+)(?:\[(?P<number>\d+)\])?(?:\.(?P<key>\w+))?")
_THING = re.compile(r"thing (?P<id>\S+?)(?:: (?P<key>\w+))?$")
_FIELD = re.compile(r"(?P<table>\w+)\.(?P<key>\w+)$")


def of_path(text: str, message: str) -> int:
    """Return the line of the path in a message of msgspec, as in "- at `$.thing[2].xyz`"; 1 if there is none."""
    found = _PATH.search(message)
    if not found:
        return 1
    number = int(found["number"] or 0)
    blocks = [block for block in _blocks(text) if block.table == found["table"]]
    return blocks[number].line(found["key"]) if number < len(blocks) else _top(text, found["table"])


def of_field(text: str, field: str) -> int:
    """Return the line of a field as SceneError names it: "thing jar_1: inside", "noise.force"; 1 if there is none."""
    if found := _THING.match(field):
        named = [block for block in _blocks(text) if block.has_id(found["id"])]
        return named[-1].line(found["key"] or "id") if named else 1
    if found := _FIELD.match(field):
        return next((block.line(found["key"]) for block in _blocks(text) if block.table == found["table"]), 1)
    return 1


class _Block:
    """A table of the file: its name, its first line, the lines below."""

    def __init__(self, table: str, first: int) -> None:
        self.table, self.first = table, first
        self.lines: list[str] = []

    def line(self, key: str | None) -> int:
        """Return the line of a key, that of the table's head where the key is not there."""
        begins = re.compile(rf"\s*{key}\s*=")
        return next((self.first + n for n, line in enumerate(self.lines, 1) if key and begins.match(line)), self.first)

    def has_id(self, name: str) -> bool:
        return any(re.match(rf"\s*id\s*=\s*[\"']{re.escape(name)}[\"']", line) for line in self.lines)


def _blocks(text: str) -> Iterator[_Block]:
    block: _Block | None = None
    for number, line in enumerate(text.splitlines(), 1):
        if head := re.match(r"\s*\[+\s*(\w+)\s*\]+", line):
            if block is not None:
                yield block
            block = _Block(head[1], number)
        elif block is not None:
            block.lines.append(line)
    if block is not None:
        yield block


def _top(text: str, key: str) -> int:
    begins = re.compile(rf"\s*{key}\s*=")
    return next((n for n, line in enumerate(text.splitlines(), 1) if begins.match(line)), 1)
