"""`roco keys make`: certificates for every identity of a design, and the rules of router and
agents; all expires in a week.

`roco keys revoke`: the router denies all to the name of a stolen key, until there are new keys for
all.
"""

import shutil
import textwrap
from functools import partial
from pathlib import Path
from typing import Annotated

import msgspec

from agent_runtime.io import issuing
from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.secured import RIGHTS, KeysError
from console import completion
from console.errors import ConsoleError, UsageError
from console.output import Form, Format, RunDir, argument, option, tell
from console.runs import folders
from operate.system import here, of_design


def make(
    folder: Annotated[Path, argument("Where to; what is there is replaced.", metavar="DIR")],
    days: Annotated[float, option("How long they hold.", min=0.01)] = issuing.DAYS,
    system: Annotated[
        list[str] | None,
        option(
            "Prefix of every key; several behind one router; else the system's own.",
            complete=completion.systems,
            envvar=["ROCO_SYSTEMS", "ROCO_SYSTEM"],
        ),
    ] = None,
    host: Annotated[
        list[str] | None,
        option(
            "One more name or address of a host of the router, or of agents.", envvar="ROCO_HOSTS"
        ),
    ] = None,
    design: Annotated[Path | None, option("A design file; else that of the system here.")] = None,
    apart: Annotated[
        bool, option("A folder for each identity: each process sees its own alone.")
    ] = False,
    keep: Annotated[
        float | None, option("Leave all as it is where it holds so many days more.", metavar="DAYS")
    ] = None,
    form: Form = Format.TEXT,
) -> None:
    """Make an authority, a certificate per identity and the rules of router and agents, all anew.

    A process needs authority.pem and its own two files, the router rights.json too, an agent its
    <name>.links.json too. The authority's private key is forgotten. Exits with 1 where they cannot
    be written, with 2 where there is no such design.

    Examples:
      roco keys make keys
      roco keys make keys --apart --keep 3.5
      roco keys make keys --system velma1 --system velma2 --host robots.lan
    """
    found = here() if design is None else of_design(design)
    hosts = (*issuing.HOSTS, *found.design.agents, *(host or ()))
    names = [name.strip() for name in ",".join(system or [found.name]).split(",")]
    issue = partial(issuing.issue, folder, found.design, [*filter(None, names)])
    try:
        made = issue(days=days, hosts=hosts, apart=apart, keep_days=keep)
    except UnicodeError as error:
        raise ConsoleError(str(error)) from error
    tell(made, form, keys_text(made, apart=apart))


def keys_text(made: issuing.Issued, *, apart: bool) -> str:
    """Return the keys that now exist, in words for people."""
    named = f"system{'s' * (len(made.systems) > 1)} {', '.join(map(repr, made.systems))}"
    use = "ROCO_TLS_DIR=<an identity's folder>" if apart else f"ROCO_TLS_DIR={made.folder}"
    first = (
        f"{made.folder}: {', '.join(made.identities)}, and {RIGHTS} for the router of {named}"
        f"{'' if made.made_now else ' (kept as they were)'}"
    )
    width = shutil.get_terminal_size().columns
    lines = textwrap.wrap(
        first, width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
    )
    lines.append(f"valid until {made.until:%Y-%m-%d %H:%M} UTC; to use them, set {use}")
    return "\n".join(lines)


class Revoked(msgspec.Struct, frozen=True):
    """Names that the router and the agents of a folder of keys deny everything."""

    folder: str
    revoked: tuple[str, ...]


def revoke(
    name: Annotated[
        str,
        argument(
            "The name in the certificate: an agent, or SYSTEM.AGENT.",
            complete=completion.agents,
            metavar="NAME",
        ),
    ],
    folder: Annotated[
        Path | None,
        option("What `roco keys make` wrote; else the run's keys.", "--keys", metavar="DIR"),
    ] = None,
    undo: Annotated[bool, option("Grant its rights again.", "--undo")] = False,
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Deny everything to whoever has the key of a name: the router listens again within a second.

    Who is so named rightfully is denied, too, until there are new keys for all: `roco down` and
    `roco up`, or `roco keys make`. All others come back by themselves. Exits with 2 where there is
    no such name.

    Examples:
      roco keys revoke AGENT
      roco keys revoke AGENT --undo
      roco keys revoke SYSTEM.AGENT --keys keys
    """
    where = folder or folders.find(run_dir) / KEYS_FOLDER
    try:
        denied = issuing.revoke(where, name, undo=undo)
    except KeysError as error:
        raise UsageError(str(error)) from error
    names = ", ".join(denied) or "none"
    words = f"{where}: revoked are {names}; the router listens again within a second"
    tell(Revoked(str(where), denied), form, words)
