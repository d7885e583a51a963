"""`roco keys make`: certificates for every identity of a design, and the router's rules; all expires in a week."""

import datetime as dt
import os
import sys
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from agent_runtime import keys
from agent_runtime.secured import RIGHTS, Rights
from companion.design import DESIGN
from companion.run_folder import KEYS_FOLDER
from services.console.forms import Form, Format
from topdown.design import Design, load
from topdown.errors import DesignError
from topdown.rights import ROUTER, access_control, identities

SYSTEM = "roco"
"""As everywhere where none is named."""


class Made(msgspec.Struct, frozen=True):
    """What was written where, and until when it holds."""

    folder: str
    system: str
    identities: tuple[str, ...]
    until: dt.datetime


app = typer.Typer(no_args_is_help=True, help="Certificates of a fleet, and the router's rules.")


@app.callback()
def keys_() -> None:
    """Certificates of a fleet, and the router's rules."""


@app.command()
def make(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where to; what is there is replaced.")],
    days: Annotated[float, typer.Option(min=0.01, help="How long they hold.")] = keys.DAYS,
    system: Annotated[str, typer.Option(envvar="ROCO_SYSTEM", help="Prefix of every key, as the fleet's.")] = SYSTEM,
    host: Annotated[list[str] | None, typer.Option(help="One more name or address of the router's host.")] = None,
    design: Annotated[Path | None, typer.Option(help="Another system's design file.")] = None,
    form: Form = Format.TEXT,
) -> None:
    """Make an authority, a certificate per identity and the router's rules, all anew.

    A process needs authority.pem and its own two files; the router rights.json, too. The authority's private key is
    forgotten. Exits with 1 where they cannot be written, or there is no such design.
    """
    try:
        made = written(folder, DESIGN if design is None else load(design), system, days=days, hosts=tuple(host or ()))
    except (OSError, DesignError, UnicodeError) as error:
        print(f"roco: {error}", file=sys.stderr)
        raise typer.Exit(1) from error
    if form is Format.JSON:
        print(msgspec.json.encode(made).decode())
        return
    print(f"{made.folder}: {', '.join(made.identities)}, and {RIGHTS} for the router of system {made.system!r}")
    print(f"they hold until {made.until:%Y-%m-%d %H:%M} UTC; ROCO_TLS_DIR={made.folder} makes a process use them")


def written(folder: Path, design: Design, system: str, *, days: float = keys.DAYS, hosts: tuple[str, ...] = ()) -> Made:
    """Make them and say so. Raises OSError."""
    names = identities(design)
    rights = Rights(system, access_control(design, system))
    until = keys.make(folder, names, ROUTER, rights, days=days, hosts=(*keys.HOSTS, *hosts))
    return Made(str(folder), system, names, until)


def of_run(run: Path) -> Made:
    """Keys of one run, in its folder."""
    return written(run / KEYS_FOLDER, DESIGN, os.environ.get("ROCO_SYSTEM", SYSTEM))
