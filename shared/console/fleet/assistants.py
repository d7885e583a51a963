"""`roco mcp`: tools, resources and prompts of a fleet for a program that speaks the Model Context
Protocol, as its design has them for a guest.
"""

import asyncio
import json
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import msgspec

from console.errors import needing
from console.fleet import targets
from console.fleet.guests import GuestName, Visiting, Way, local, over_http, stopper, visiting
from console.fleet.local import Local
from console.output import Form, Format, RunDir, option, problems
from operate.file_names import LIVE_FILE

if TYPE_CHECKING:
    from operate.guests.errands import Errands
    from operate.guests.mcp_server import McpServer

WAY = Way("MCP", "mcp", "/mcp")
PORT = 8370
LOOK_S = 1.0
"""Between two looks for new events (estimate: a person reads no faster)."""
EVENTS = 100
"""Newest events that can be read."""
TOLD = ("Happened",)
"""Kinds of lines that can be read: no guest reads what agents say to each other."""


def mcp(
    http: Annotated[bool, option("Serve HTTP on loopback, not standard input and output.")] = False,
    port: Annotated[int, option("Of HTTP; 0 for a free one.", min=0, max=65535)] = PORT,
    guest: GuestName = "",
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Offer a running fleet's tools to an assistant that speaks MCP.

    What it may ask for stands in the design (`roco design show`): tools are derived from it, each
    task is judged and recorded, and a person is asked before the robot moves. Without --http it
    serves the program that starts it. With --http it prints the address; the token is in mcp.json
    of the run folder.

    Examples:
      roco mcp
      roco mcp --http
    """
    with problems(form):
        with needing(WAY.verb):
            import mcp.server  # noqa: F401
        fleet = local(target, run_dir, WAY)
        asyncio.run(_served(fleet, guest, port if http else None, form))


async def _served(fleet: Local, wanted: str, port: int | None, form: Format) -> None:
    async with visiting(fleet, WAY, wanted) as at:
        made = _made(fleet, at)
        looking = asyncio.create_task(_look(fleet.run / LIVE_FILE, made.new_events))
        try:
            if port is None:
                await made.server.serve_stdio()
            else:
                await over_http(WAY, fleet.run, port, form, made.server.app)
        finally:
            looking.cancel()
            made.errands.give_up()


class _Made(NamedTuple):
    """The server, and what tells it of new events."""

    server: "McpServer"
    errands: "Errands"
    new_events: Callable[[], None]


def _made(fleet: Local, at: Visiting) -> _Made:
    from console.runs.experiment import installed
    from operate.guests.errands import Errands
    from operate.guests.hosting import Extra, Host, Resource, Served
    from operate.guests.mcp_server import TASKS, McpServer
    from operate.guests.offers import offers

    system, loop = fleet.system, asyncio.get_running_loop()
    offered = offers(system.design, system.languages, at.guest)  # type: ignore[arg-type]
    after: tuple[str, ...] = (TASKS,)

    def tasks_changed() -> None:
        for resource in after:
            server.changed(resource)

    errands = Errands(system, at.visit, tasks_changed)

    def changed(resource: str) -> None:
        loop.call_soon_threadsafe(server.changed, resource)

    by_name = {one.name: one for one in offered}
    added = system.addition("guests")
    host = Host(system, at.name, at.visit, errands, by_name, changed)
    extra: Extra = added(host) if added else Extra()
    after = (TASKS, *extra.after)
    own = (
        Resource(
            "events",
            f"The newest {EVENTS} lines of what happens in the fleet",
            "application/json",
            lambda: asyncio.to_thread(_events, fleet),
        ),
        Resource(
            "recordings",
            "Runs that were recorded, and how they ended",
            "application/json",
            lambda: asyncio.to_thread(_recordings, fleet),
        ),
    )

    served = Served(
        system.name,
        installed(),
        at.guest,
        offered,
        (*own, *extra.resources),
        extra.prompts,
        stopper(fleet),
    )
    server = McpServer(served, errands)
    return _Made(server, errands, lambda: server.changed("events"))


def _events(fleet: Local) -> str:
    from operate.guests.hosting import UNTRUSTED

    lines = (line for line in fleet.recorded(LIVE_FILE).splitlines() if line.endswith(b"}"))
    told = (one for one in map(json.loads, lines) if one["kind"] in TOLD)
    return json.dumps({UNTRUSTED: list(deque(told, EVENTS))})


def _recordings(fleet: Local) -> str:
    from console.runs.catalogue import catalogue
    from operate.guests.hosting import UNTRUSTED

    found = msgspec.to_builtins(catalogue(fleet.run.resolve().parent))
    return json.dumps({UNTRUSTED: found})


async def _look(file: Path, changed: Callable[[], None]) -> None:
    size = 0
    while True:
        now = file.stat().st_size if file.exists() else 0
        if now != size:
            size = now
            changed()
        await asyncio.sleep(LOOK_S)
