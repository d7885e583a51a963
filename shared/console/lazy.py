"""A group of verbs whose modules are imported when they are called: `roco status` does not pay for
`roco design`.
"""

import functools
import inspect
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from importlib import import_module
from itertools import pairwise
from typing import Any, TextIO, cast

import typer
from typer.core import TyperCommand, TyperGroup

from console import progress
from console.guarded import Guarded
from console.verbs import VERBS, Table, merged
from operate.system import NoSystemError, design_shown, here, installed_here
from operate.wording import escaped
from topdown.model.errors import TopdownError

ROOM = "console"
EXAMPLES = "\nExamples:\n"
ELSEWHERE = {
    "--system": (
        "the system is that of the project in this folder ([tool.roco] system in its"
        ' pyproject.toml), else the installed one; ROCO_ENTRY="package.module:NAME" names another'
        " one (docs/design-your-own-robot.md)"
    )
}
"""What to do instead of an option that people expect of a verb that has none."""
BELOW_ZERO = re.compile(r"-\d+(\.\d+)?")
WrongUse = cast(type[typer.BadParameter], typer.BadParameter.__mro__[1])
"""Any error of options and arguments; typer has it under other names from version to version."""


class Verbs(TyperGroup):
    """The verbs that begin with `words`. What it lists are summaries; whoever calls one gets the
    verb itself.

    Those that an installed system adds are listed with them. A project's are not, since help and
    completion import nothing of a project; they are looked up where one is called.
    """

    def __init__(self, *, words: str = "", commands: object = None, **settings: Any) -> None:
        self.words = words
        super().__init__(commands=dict(_listed(words, VERBS)), **settings)

    def list_commands(self, ctx: Any) -> list[str]:
        """The names of all verbs, in the order of the tables."""
        self.commands = dict(_listed(self.words, merged(VERBS, added())))
        return list(self.commands)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The verb, or the summary of one; None where there is none."""
        if cmd_name not in self.commands:
            self.list_commands(ctx)
        return self.commands.get(cmd_name)

    def called(self, ctx: Any, cmd_name: str) -> Any:
        """The verb of this name, also one that a project adds; None where there is none."""
        if self.get_command(ctx, cmd_name) is None:
            self.commands.update(_listed(self.words, added(of_project=True)))
        return self.get_command(ctx, cmd_name)

    def main(self, *given: Any, **named: Any) -> Any:
        """As typer does; to a program that asked for JSON a wrong use is told as one object, not as
        a box. What the operating system refuses is told in a line, output to a full disk too.
        """
        if not named.get("standalone_mode", True):
            return super().main(*given, **named)
        words = given[0] if given else named.get("args")
        json = wants_json(sys.argv[1:] if words is None else list(words))
        try:
            try:
                # A verb gives nothing back: what comes is the exit code of an end in the middle.
                sys.exit(super().main(*given, **{**named, "standalone_mode": not json}) or 0)
            finally:
                sys.stdout.flush()
        except WrongUse as error:
            sys.exit(_report_problem(error.format_message(), error.exit_code, json=True))
        except OSError as error:
            from console.output import refused

            problem = refused(error)
            sys.exit(_report_problem(str(problem), problem.code, json=json))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """As click does, and a summary becomes the verb. Where there is none it says what there
        is.
        """
        # a shell that completes is not told what is wrong
        asked = args[:1] if not ctx.resilient_parsing else []
        if asked and not args[0].startswith("-") and self.called(ctx, args[0]) is None:
            ctx.fail(unknown(" ".join(filter(None, (self.words, args[0]))), list(self.commands)))
        name, command, rest = super().resolve_command(ctx, args)
        return name, command.load(rest) if isinstance(command, Summary) else command, rest


class Summary(TyperCommand):
    """A verb as a list of verbs shows it: its name and what it does in a line."""

    place = ""
    above = ""
    """Its words, where verbs of other rows begin with them."""

    def load(self, words: Sequence[str] = ()) -> TyperCommand | TyperGroup:
        """The verb itself, for the words behind it. Raises ImportError or AttributeError where the
        table is wrong.
        """
        module, name = self.place.split(":")
        verb = made(cast(str, self.name), getattr(import_module(module, ROOM), name))
        if not self.above:
            return verb
        options = [one for one in verb.params if one.param_type_name != "argument"]
        below = VerbWithVerbs(self.above, verb)
        if words and below.called(None, words[0]) is not None:
            below.params = options
        elif words and words[0] != "--help" and options != verb.params:
            # the word is its own argument: `roco fault kill AGENT` beside `roco fault list`
            return verb
        return below


class Verb(TyperCommand):
    """A verb. Its help has examples with names of the system here in place of AGENT, PEER and
    CHANNEL.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """As click does, but a number below zero is an argument, and no option."""
        ctx.ignore_unknown_options = any(BELOW_ZERO.fullmatch(word) for word in args)
        try:
            return super().parse_args(ctx, args)
        except WrongUse as error:
            if instead := ELSEWHERE.get(getattr(error, "option_name", "")):
                error.message = f"{error.message.rstrip('.')}: {instead}"
            raise

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        self.epilog = named(self.epilog or "")
        super().format_help(ctx, formatter)


class VerbWithVerbs(Verbs):
    """A verb that others begin with: `roco record` and `roco record info`. Without one of those it
    is the verb.
    """

    def __init__(self, words: str, verb: TyperCommand) -> None:
        self._examples = verb.epilog or ""
        alone = not any(one.required for one in verb.params)
        shown: dict[str, Any] = {"help": verb.help, "params": verb.params}
        shown |= {"callback": verb.callback, "invoke_without_command": alone}
        shown |= {"no_args_is_help": not alone}
        super().__init__(words=words, name=verb.name, **shown)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the verb below; this one is not called then, and has no options before its
        name.
        """
        sources = [ctx.get_parameter_source(name).name for name in ctx.params]
        found = super().resolve_command(ctx, args)
        if "COMMANDLINE" in sources and not ctx.resilient_parsing:
            right = f"roco {self.words} {args[0]} --option ..."
            ctx.fail(f"options stand behind all words of a verb: {right}")
        self.callback = None
        return found

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help, with names of the system here in the examples."""
        self.epilog = named(self._examples)
        super().format_help(ctx, formatter)


def named(examples: str) -> str:
    """Return examples with a channel of the system here and its agents; as they are if no system is
    found.
    """
    try:
        channel = next(iter(design_shown().channels.values()), None)
    except (NoSystemError, TopdownError):
        return examples
    parts = (*channel.ends, channel.id) if channel else ()
    names = dict(zip(("AGENT", "PEER", "CHANNEL"), map(escaped, parts), strict=False))
    return re.sub("|".join(names) or "$^", lambda found: names[found[0]], examples)


def added(*, of_project: bool = False) -> Table:
    """The verbs that the system here adds; none if it cannot be read. A project's is imported only
    if asked for.
    """
    try:
        found = here() if of_project else installed_here()
        return (found.addition("verbs") if found is not None else None) or {}
    except (NoSystemError, TopdownError):
        return {}


def unknown(words: str, there: list[str]) -> str:
    """Return the message for an unknown verb: it does not exist at all, or not for the system
    here.
    """
    try:
        where = f"the system here, {here().name}, has no verb {words!r}"
    except (NoSystemError, TopdownError) as error:
        where = f"there is no verb {words!r}, and no system here that could add one ({error})"
    return escaped(f"{where}; there are {', '.join(there)}")


def wants_json(words: Sequence[str]) -> bool:
    """Whether a command line asks for JSON; it may be one that cannot be read as a whole."""
    return "--format=json" in words or ("--format", "json") in pairwise(words)


def made(name: str, function: Callable[..., None]) -> TyperCommand:
    """A function as a command whose output is guarded; its docstring is the help, the examples at
    its end stand below the options.
    """
    text = unwrapped((inspect.getdoc(function) or "").partition(EXAMPLES)[0].strip())
    lines = [line.replace("[", r"\[") for line in examples_of(function)]  # a bracket is no markup
    shown = "\n\n".join(("Examples:", *(f"  {line}" for line in lines))) if lines else None
    only = typer.Typer(add_completion=False)
    only.command(name, cls=Verb, help=text, epilog=shown)(function)
    command = cast(TyperCommand, typer.main.get_command(only))
    command.callback = guarded(cast(Callable[..., None], command.callback))
    return command


def unwrapped(text: str) -> str:
    """A text whose paragraphs are one line each, so that a terminal of any width wraps them. What
    is indented, as a list is, keeps its lines.
    """
    return re.sub(r"(?<=\S)\n(?=\S)", " ", text)


def _report_problem(problem: str, code: int, *, json: bool) -> int:
    """Tell a problem, unless standard error is on the disk that is full; its exit code."""
    from console.output import Format, tell_problem

    with suppress(OSError):
        tell_problem(problem if json else escaped(problem), Format.JSON if json else Format.TEXT)
    return code


def examples_of(function: Callable[..., None]) -> list[str]:
    """The calls of roco that a verb's docstring shows."""
    examples = (inspect.getdoc(function) or "").partition(EXAMPLES)[2]
    return [line.strip() for line in examples.splitlines() if line.strip()]


def _listed(words: str, table: Table) -> Iterator[tuple[str, TyperCommand | TyperGroup]]:
    """The rows one word below `words`."""
    every = [called for rows in table.values() for called in rows]
    for panel, rows in table.items():
        for called, (place, line) in rows.items():
            before, _, name = called.rpartition(" ")
            if before != words:
                continue
            settings: Any = {"help": line, "rich_help_panel": None if words else panel}
            if not place:
                yield name, Verbs(words=called, name=name, no_args_is_help=True, **settings)
                continue
            summary = Summary(name, **settings)
            below = any(other.startswith(f"{called} ") for other in every)
            summary.place, summary.above = place, called if below else ""
            yield name, summary


FOR_PROGRAMS = ("json", "otlp")
"""Formats of answers beside which a problem is told as JSON, too."""


def guarded(verb: Callable[..., Any]) -> Callable[..., Any]:
    """A verb whose output is escaped, however it prints, and whose problems are told in words."""

    summary = (inspect.getdoc(verb) or "").partition("\n")[0].partition(".")[0]
    does = f"{summary[:1].lower()}{summary[1:]}"

    @functools.wraps(verb)
    def call(*given: Any, **named: Any) -> Any:
        from console.output import (  # a verb has imported it; a list of verbs need not
            Format,
            problems,
        )

        form = Format.JSON if named.get("form") in FOR_PROGRAMS else Format.TEXT
        with progress.shown(sys.stdout, sys.stderr, does, wanted=form is Format.TEXT) as streams:
            out, err = (cast(TextIO, Guarded(stream)) for stream in streams)
            with redirect_stdout(out), redirect_stderr(err), problems(form):
                return verb(*given, **named)

    return call
