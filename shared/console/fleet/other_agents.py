"""`roco a2a`: skills of a fleet for agents that speak the Agent2Agent protocol, as its design has
them for a guest.
"""

import asyncio
from typing import Annotated

from console.errors import needing
from console.fleet import targets
from console.fleet.guests import GuestName, Way, local, over_http, stopper, visiting
from console.fleet.local import Local
from console.output import Form, Format, RunDir, option, problems

WAY = Way("A2A", "a2a", "/a2a")
PORT = 8371


def a2a(
    port: Annotated[int, option("Port; 0 for a free one.", min=0, max=65535)] = PORT,
    guest: GuestName = "",
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Offer a running fleet's skills to other agents that speak A2A.

    What they may ask for stands in the design (`roco design show`): skills are derived from it,
    each task is judged and recorded, and consent is asked for before the robot moves. It serves
    HTTP on loopback and prints the address; the token is in a2a.json of the run folder.

    Examples:
      roco a2a
      roco a2a --port 0
    """
    with problems(form):
        with needing(WAY.verb):
            import a2a.server  # noqa: F401
        asyncio.run(_served(local(target, run_dir, WAY), guest, port, form))


async def _served(fleet: Local, wanted: str, port: int, form: Format) -> None:
    from console.runs.experiment import installed
    from operate.guests.a2a_server import A2aServer
    from operate.guests.errands import Errands
    from operate.guests.hosting import Served
    from operate.guests.offers import offers

    system = fleet.system
    async with visiting(fleet, WAY, wanted) as at:
        offered = offers(system.design, system.languages, at.guest)  # type: ignore[arg-type]
        errands = Errands(system, at.visit, lambda: None)
        served = Served(system.name, installed(), at.guest, offered, (), (), stopper(fleet))
        try:
            await over_http(WAY, fleet.run, port, form, A2aServer(served, errands).app)
        finally:
            errands.give_up()
