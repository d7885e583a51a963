"""A group of verbs whose modules are imported when they are called: `roco status` does not pay for `roco design`."""

import inspect
import sys
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from itertools import pairwise
from typing import Any, cast

import typer
from typer.core import TyperCommand, TyperGroup

from operate.cli.verbs import VERBS

ROOM = "operate.cli"
EXAMPLES = "\nExamples:\n"
WrongUse = cast(type[typer.BadParameter], typer.BadParameter.__mro__[1])
"""Any error of options and arguments; typer has it under other names from version to version."""


class Verbs(TyperGroup):
    """The verbs that begin with `words`. What it lists are summaries; whoever calls one gets the verb itself."""

    def __init__(self, *, words: str = "", commands: object = None, **settings: Any) -> None:
        self.words = words
        super().__init__(commands=dict(_listed(words)), **settings)

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        """As typer does; to a program that asked for JSON a wrong use is told as one object, not as a box."""
        words = sys.argv[1:] if args is None else list(args)
        if not (standalone_mode and wants_json(words)):
            return super().main(args, prog_name, complete_var, standalone_mode, windows_expand_args, **extra)
        try:
            # A verb gives nothing back: what comes is the exit code of an end in the middle.
            sys.exit(super().main(args, prog_name, complete_var, False, windows_expand_args, **extra) or 0)
        except WrongUse as error:
            from operate.cli.output import Format, tell_problem

            tell_problem(error.format_message(), Format.JSON)
            sys.exit(error.exit_code)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """As click does, and a summary becomes the verb."""
        name, command, rest = super().resolve_command(ctx, args)
        return name, command.load() if isinstance(command, Summary) else command, rest


class Summary(TyperCommand):
    """A verb as a list of verbs shows it: its name and what it does in a line."""

    place = ""

    def load(self) -> TyperCommand:
        """The verb itself. Raises ImportError or AttributeError where the table is wrong."""
        module, name = self.place.split(":")
        return made(cast(str, self.name), getattr(import_module(module, ROOM), name))


def wants_json(words: Sequence[str]) -> bool:
    """Whether a command line asks for JSON; it may be one that cannot be read as a whole."""
    return "--format=json" in words or ("--format", "json") in pairwise(words)


def made(name: str, function: Callable[..., None]) -> TyperCommand:
    """A function as a command; its docstring is the help, the examples at its end stand below the options."""
    text, _, examples = (inspect.getdoc(function) or "").partition(EXAMPLES)
    only = typer.Typer(add_completion=False)
    only.command(name, help=text.strip(), epilog=_paragraphs(examples))(function)
    return cast(TyperCommand, typer.main.get_command(only))


def examples_of(function: Callable[..., None]) -> list[str]:
    """The calls of roco that a verb's docstring shows."""
    return [
        line.strip() for line in (inspect.getdoc(function) or "").partition(EXAMPLES)[2].splitlines() if line.strip()
    ]


def _paragraphs(examples: str) -> str | None:
    """Examples as the help shows them, a line for each; brackets are no markup."""
    lines = [line.replace("[", r"\[") for line in _lines(examples)]
    return "\n\n".join(("Examples:", *(f"  {line}" for line in lines))) if lines else None


def _lines(examples: str) -> list[str]:
    return [line.strip() for line in examples.splitlines() if line.strip()]


def _listed(words: str) -> Iterator[tuple[str, TyperCommand | TyperGroup]]:
    """The rows one word below `words`."""
    for panel, rows in VERBS.items():
        for called, (place, line) in rows.items():
            before, _, name = called.rpartition(" ")
            if before != words:
                continue
            settings = {"help": line, "rich_help_panel": panel if not words else None}
            yield name, _row(called, name, place, settings)


def _row(called: str, name: str, place: str, settings: dict[str, Any]) -> TyperCommand | TyperGroup:
    if not place:
        return Verbs(words=called, name=name, no_args_is_help=True, **settings)
    summary = Summary(name, **settings)
    summary.place = place
    return summary
