"""`roco acl show`: what an ACL message in text says, or where it stops being one."""

import sys
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from rich.cells import cell_len
from rich.table import Table
from rich.text import Text

from console.output import Form, Format, argument, tell
from console.terminal.console import Console
from fipa_codec.acl_string import MAX_ACL_BYTES, AclMessage, AclSyntaxError, After, Aid, At, parse
from fipa_codec.acl_string.mapping import JSON
from fipa_codec.acl_string.message import EPOCH


def show(
    source: Annotated[
        str, argument("A message, a file with one, or - for stdin.", metavar="TEXT|FILE|-")
    ],
    form: Form = Format.TEXT,
) -> None:
    """Show what a message says. Exits with 1 where it is malformed, with a caret under the place.

    Examples:
      roco acl show message.acl
      roco acl show '(inform :sender (agent-identifier :name AGENT))'
    """
    try:
        message = parse(read(source))
    except AclSyntaxError as error:
        if form is Format.JSON:
            parts = {
                name: getattr(error, name)
                for name in ("field", "offset", "line", "column", "found", "expected")
            }
            print(msgspec.json.encode({"error": str(error), **parts}).decode(), file=sys.stderr)
        else:
            print(f"roco: {visible(str(error))}\n{pointed(error)}", file=sys.stderr)
        raise typer.Exit(1) from error
    tell(message, form, lambda: Console().print(table(message)))


def read(source: str) -> bytes | str:
    """The text that is meant: a message begins with a parenthesis, no name of a file is taken for
    one.
    """
    if source == "-":
        return sys.stdin.buffer.read(MAX_ACL_BYTES + 1)
    if source.lstrip().startswith("("):
        return source
    try:
        with Path(source).open("rb") as file:
            return file.read(MAX_ACL_BYTES + 1)
    except (OSError, ValueError) as error:
        raise typer.BadParameter(
            f"{source!r} is no message, which begins with (, and no file: {error}"
        ) from error


def pointed(error: AclSyntaxError) -> str:
    """The line with a caret under the fault, both indented."""
    before = visible(error.excerpt[: error.caret], "·")
    return f"  {before}{visible(error.excerpt[error.caret :], '·')}\n  {' ' * cell_len(before)}^"


def table(message: AclMessage) -> Table:
    """A row for each parameter given, in the order of SC00061G."""
    grid = Table.grid(padding=(0, 2))
    grid.add_column(style="bold")
    grid.add_column(overflow="fold")
    for name, value in rows(message):
        grid.add_row(Text(visible(name)), Text(visible(value)))
    return grid


def rows(message: AclMessage) -> Iterator[tuple[str, str]]:
    """Name and value of each parameter given, in words."""
    yield "performative", message.performative
    for field in msgspec.structs.fields(message)[1:]:
        value, name = getattr(message, field.name), field.name.replace("_", "-")
        if isinstance(value, dict):
            yield from value.items()
        elif isinstance(value, Aid):
            yield name, agent(value)
        elif isinstance(value, tuple):
            yield from ((name, agent(aid)) for aid in value)
        elif name == "content" and value is not None:
            yield name, content(value, message.encoding)
        elif value is not None:
            yield name, time(value) if isinstance(value, At | After) else value


def agent(aid: Aid) -> str:
    """An agent on one line: name, addresses, who resolves it, further slots."""
    parts = [aid.name, *aid.addresses]
    parts += [f"resolved by {agent(resolver)}" for resolver in aid.resolvers]
    return "  ".join([*parts, *(f"{name}={value}" for name, value in aid.user.items())])


def content(value: str | bytes, encoding: str | None) -> str:
    """Content as it is; JSON indented, bytes that are not text as Python writes them."""
    if isinstance(value, bytes):
        return repr(value)
    try:
        return msgspec.json.format(value) if encoding == JSON else value or '""'
    except msgspec.DecodeError:
        return value


def time(when: At | After) -> str:
    """A time in words."""
    if isinstance(when, At):
        then = EPOCH + timedelta(milliseconds=when.unix_ms)
        return f"{then:%Y-%m-%d %H:%M:%S}.{when.unix_ms % 1000:03} UTC"
    return f"{abs(when.ms) / 1000:g} s {'before' if when.ms < 0 else 'after'} the receipt"


def visible(text: str, instead: str = "") -> str:
    """The text without what a terminal would obey: control characters escaped, or `instead` of
    each.
    """
    return "".join(
        c if c.isprintable() or (c == "\n" and not instead) else instead or repr(c)[1:-1]
        for c in text
    )
