"""Parts shared by all verbs: two output formats, the option that names a run, messages and exit
codes of errors.

Text is for people, json for programs: one object, or one a line while something goes on; problems
on standard error.
"""

import errno
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

from agent_runtime.io.run_files import LinkedError
from console import completion, interrupts
from console.errors import INTERRUPTED, NO, WRONG_USE, ConsoleError, UsageError
from operate.structs import NothingToRead
from operate.system import NoSystemError
from topdown.model.errors import TopdownError


class Format(StrEnum):
    """Output formats."""

    TEXT = "text"
    JSON = "json"


def option(
    text: str, *names: str, complete: Callable[..., list[str]] | None = None, **settings: Any
) -> Any:
    """Declare an option of a verb. `text`: its help; `names`: only where they differ from the
    parameter's; `complete`: gives the completions.
    """
    return typer.Option(*names, help=text, autocompletion=complete, **settings)


def argument(
    text: str, *, complete: Callable[..., list[str]] | None = None, **settings: Any
) -> Any:
    """Declare an argument of a verb; parameters as for `option`."""
    return typer.Argument(help=text, autocompletion=complete, **settings)


Form = Annotated[Format, option("text for people, json for programs.", "--format")]
RunDir = Annotated[
    Path | None,
    option(
        "A run's folder; else ROCO_RUN_DIR, else runs/latest.",
        "--run-dir",
        complete=completion.runs,
    ),
]


class Reply(msgspec.Struct, frozen=True):
    """An answer that is only words."""

    text: str
    run: str = ""


def tell(what: object, form: Format, words: str | Callable[[], object] = "") -> None:
    """Print an answer: as JSON for programs, as `words` for people. A function prints its words
    itself; a Reply has a sentence of its own.
    """
    if form is Format.JSON:
        tell_json(what)
    elif callable(words):
        words()
    else:
        print(what.text if isinstance(what, Reply) else words)


def tell_json(what: object) -> None:
    """Print anything made of Structs, in a line; an interrupt does not cut it."""
    try:
        line = msgspec.json.encode(what).decode()
    except UnicodeEncodeError:  # the name of a file that is not UTF-8
        line = json.dumps(msgspec.to_builtins(what))
    with interrupts.put_off():
        print(line)


_MAY_NOT = "call roco in a folder that you may write to, or name one"
_REMEDIES = {
    errno.EACCES: _MAY_NOT,
    errno.EPERM: _MAY_NOT,
    errno.ENOENT: "name one that is there",
    errno.EEXIST: "it is a file; name a folder",
    errno.ENOTDIR: "a part of this path is a file; name another path",
    errno.EISDIR: "it is a folder; name a file",
    errno.ENAMETOOLONG: "name a shorter path",
}


def refused(error: OSError) -> ConsoleError:
    """Return what the operating system refused as an error of the command line, with what to do; an
    error of our own has its words.
    """
    from agent_runtime.io.journal import DISK, worded  # seldom needed, and verbs start quickly

    if error.errno in DISK:
        return ConsoleError(
            f"{worded(error.filename or 'the output', error)}; make room there, or write elsewhere"
        )
    # a number: of an open file
    if error.errno is None or not isinstance(error.filename, str | bytes | os.PathLike):
        return ConsoleError(error.strerror or str(error))
    words = (f"{os.fsdecode(error.filename)}: {error.strerror}", _REMEDIES.get(error.errno))
    return UsageError("; ".join(filter(None, words)))


def tell_problem(problem: object, form: Format) -> None:
    """Print a problem in words on standard error."""
    words = json.dumps({"error": str(problem)}) if form is Format.JSON else f"roco: {problem}"
    print(words, file=sys.stderr)


@contextmanager
def problems(form: Format) -> Iterator[None]:
    """Turn what goes wrong into words on standard error and the exit code of its kind
    (docs/errors.md).
    """
    try:
        yield
    except ConsoleError as error:
        tell_problem(error, form)
        raise typer.Exit(error.code) from error
    # no system here, or no recording there
    except (NoSystemError, TopdownError, LinkedError, NothingToRead) as error:
        tell_problem(error, form)
        raise typer.Exit(WRONG_USE) from error
    # what reads recordings, and what draws, is not installed with the tools
    except ModuleNotFoundError as error:
        tell_problem(f"{type(error).__name__}: {error}; install the extra `monitor`", form)
        raise typer.Exit(NO) from error
    except KeyboardInterrupt as error:
        tell_problem("interrupted", form)
        raise typer.Exit(INTERRUPTED) from error


# --- The option --seed: a number that varies what a system leaves to chance, or none --------------


NONE = "none"
AS_WRITTEN = 0
"""The seed that varies nothing."""


def number(text: str) -> int:
    """Return the seed of an option; 0 for "none". Raise typer.BadParameter that says what would be
    right.
    """
    if str(text) == NONE:
        return AS_WRITTEN
    if not str(text).isdecimal():
        raise typer.BadParameter(
            f"{text!r} is not a seed: give a number from 0 on, or {NONE}, which is 0"
        )
    return int(text)


Seed = Annotated[
    int,
    option(
        "Varies what a system leaves to chance, such as poses and noise; none, or 0: as the"
        " scene is written.",
        parser=number,
        metavar="N|none",
    ),
]
FirstSeed = Annotated[
    int, option("Of the first run; each next one takes the next.", parser=number, metavar="N|none")
]
