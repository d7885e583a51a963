"""The verbs of `roco`, from its own tables, and those whose output no page shows."""

import re
from collections.abc import Iterator
from typing import Any

import shown
import typer

ELSEWHERE = {"demo": "README.md; a fleet of its own, which takes minutes"}
"""Verbs that are shown where no script runs them."""


def every(command: Any = None, path: tuple[str, ...] = ()) -> Iterator[str]:
    """`design check`, `status`, ...: all commands that do something, in the order of `--help`;
    hidden ones too.
    """
    if command is None:
        from console.__main__ import app

        command = typer.main.get_command(app)
    if getattr(command, "above", ""):  # a verb that others begin with
        yield " ".join(path)
        command = command.load()
    if not hasattr(command, "list_commands"):
        yield " ".join(path)
        return
    context = typer.Context(command)
    for name in command.list_commands(context):
        yield from every(command.get_command(context, name), (*path, name))


def not_shown(blocks: list[shown.Block]) -> list[str]:
    """Verbs that no command of a shown output uses."""
    commands = [one.command for block in blocks for one in block.shown]
    return [
        verb
        for verb in every()
        if verb not in ELSEWHERE
        and not any(re.search(rf"\broco {verb}(?![\w-])", line) for line in commands)
    ]
