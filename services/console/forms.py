"""The two forms in which every verb prints: text for people, json for programs; problems too, on standard error."""

import sys
from enum import StrEnum
from typing import Annotated

import msgspec
import typer


class Format(StrEnum):
    """How things are printed."""

    TEXT = "text"
    JSON = "json"


Form = Annotated[Format, typer.Option("--format", help="text for people, json for programs.")]


def tell_problem(problem: object, form: Format) -> None:
    """What went wrong, in words, on standard error."""
    words = msgspec.json.encode({"error": str(problem)}).decode() if form is Format.JSON else f"roco: {problem}"
    print(words, file=sys.stderr)
