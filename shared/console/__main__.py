"""`roco`: bring a fleet of agents up and down, watch it, ask what was said. `roco --help` lists it
all.

The verbs are in console.verbs; docs/errors.md has the exit codes, which are the same for all.
"""

import os
import sys
from contextlib import suppress
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated

import typer

from console.guarded import UNSHOWN
from console.lazy import Verbs

TEXT = "The operator's command line: a fleet of agents brought up, watched, asked, recorded."
app = typer.Typer(cls=Verbs, no_args_is_help=True, help=TEXT, name="roco")


def tell_version(asked: bool) -> None:
    """Print the installed version, and end."""
    if asked:
        from console.runs.experiment import installed

        print(f"roco {installed()}")
        raise typer.Exit


@app.callback()
def roco(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=tell_version, is_eager=True, help="Show the version, and end."
        ),
    ] = False,
) -> None:
    """A fleet of agents brought up, watched, asked, recorded."""


def main() -> None:
    """Entry point of `roco`. Who reads its output by a pipe gets each line at once."""
    with Path(os.devnull).open("w") as nowhere:
        # a shell closes them by >&-
        sys.stdout, sys.stderr = sys.stdout or nowhere, sys.stderr or nowhere
        streams = [one for one in (sys.stdout, sys.stderr) if isinstance(one, TextIOWrapper)]
        for stream in streams:
            stream.reconfigure(line_buffering=True, errors=UNSHOWN)
        # libraries start Python, too: glfw, of mujoco, to look for itself
        os.environ["PYTHONSAFEPATH"] = "1"
        try:
            app()
        finally:
            for stream in streams:
                _given_up(stream)


def _given_up(stream: TextIOWrapper) -> None:
    """Close a stream that cannot be written, which was told; else Python tries again at its end,
    and shows that.
    """
    try:
        stream.flush()
    except OSError:
        with suppress(OSError):
            stream.close()


if __name__ == "__main__":
    main()
