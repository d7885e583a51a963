"""`roco keys make`: certificates for every identity of a design, and the router's rules; all expires in a week."""

import sys
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from agent_runtime.io import issuing, keys
from agent_runtime.io.secured import RIGHTS
from companion.design import DESIGN
from operate.cli.output import Form, Format
from topdown.model.design import load
from topdown.model.errors import DesignError

SYSTEM = "roco"
"""As everywhere where none is named."""


def make(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where to; what is there is replaced.")],
    days: Annotated[float, typer.Option(min=0.01, help="How long they hold.")] = keys.DAYS,
    system: Annotated[
        list[str] | None,
        typer.Option(envvar=["ROCO_SYSTEMS", "ROCO_SYSTEM"], help="Prefix of every key; several behind one router."),
    ] = None,
    host: Annotated[list[str] | None, typer.Option(help="One more name or address of the router's host.")] = None,
    design: Annotated[Path | None, typer.Option(help="Another system's design file.")] = None,
    apart: Annotated[bool, typer.Option(help="A folder for each identity: each process sees its own alone.")] = False,
    keep: Annotated[
        float | None, typer.Option(metavar="DAYS", help="Leave all as it is where it holds so many days more.")
    ] = None,
    linked: Annotated[bool, typer.Option(help="A router for each system, which join each other.")] = False,
    form: Form = Format.TEXT,
) -> None:
    """Make an authority, a certificate per identity and the router's rules, all anew.

    A process needs authority.pem and its own two files; the router rights.json, too. The authority's private key is
    forgotten. Exits with 1 where they cannot be written, or there is no such design.

    Examples:
      roco keys make keys
      roco keys make keys --apart --keep 3.5
      roco keys make keys --system velma1 --system velma2 --host robots.lan
    """
    systems = [name.strip() for names in system or [SYSTEM] for name in names.split(",") if name.strip()]
    hosts = (*keys.HOSTS, *(host or ()))
    try:
        drawn = DESIGN if design is None else load(design)
        made = issuing.issue(folder, drawn, systems, days=days, hosts=hosts, apart=apart, linked=linked, keep_days=keep)
    except (OSError, DesignError, UnicodeError) as error:
        print(f"roco: {error}", file=sys.stderr)
        raise typer.Exit(1) from error
    print(msgspec.json.encode(made).decode() if form is Format.JSON else words(made, apart=apart))


def words(made: issuing.Issued, *, apart: bool) -> str:
    """What is there now, for people."""
    of = "systems" if len(made.systems) > 1 else "system"
    named = f"{of} {', '.join(repr(system) for system in made.systems)}"
    use = "ROCO_TLS_DIR=<an identity's folder>" if apart else f"ROCO_TLS_DIR={made.folder}"
    return (
        f"{made.folder}: {', '.join(made.identities)}, and {RIGHTS} for the router of {named}"
        f"{'' if made.anew else ' (kept as they were)'}\n"
        f"they hold until {made.until:%Y-%m-%d %H:%M} UTC; {use} makes a process use them"
    )
