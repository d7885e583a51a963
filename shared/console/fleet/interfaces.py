"""The open interfaces of a fleet for `roco doctor`: who may come in from outside, to say what, and
where that is served now.

Who may is the design's: its guests, each with how it comes in (`by`). A way to come in adds a row
to SERVED, which tells where it is open; a system adds the interfaces for people (Checks).
"""

from collections.abc import Callable, Iterator

from console.fleet import assistants, live_ros, other_agents, platforms
from console.fleet.local import Local
from console.fleet.process_status import Target
from topdown.model.design import Design
from topdown.model.elements import Guest

ON_DEMAND = "served to programs of this user that start `roco mcp`"
AT_ROUTER = "at the router, for programs that have its key"


def on_demand(fleet: Target) -> str:
    """Who may start `roco mcp`: it serves no containers."""
    return ON_DEMAND if isinstance(fleet, Local) else ""


SERVED: dict[str, Callable[[Target], str]] = {
    assistants.WAY.protocol: lambda fleet: assistants.WAY.served(fleet) or on_demand(fleet),
    other_agents.WAY.protocol: other_agents.WAY.served,
    platforms.WAY.protocol: platforms.served,
}
"""How a guest comes in -> where that is open now, "" for nowhere."""


def opened(fleet: Target) -> Iterator[tuple[str, str]]:
    """Each way in of each guest, and each viewer that is open now: its name, and who may do what
    there.
    """
    design = fleet.system.design
    for guest in design.guests.values():
        for by in guest.by:
            where = SERVED[by](fleet) if by in SERVED else AT_ROUTER
            yield f"open: {by}", f"{may(design, guest)}; {where or 'not served'}"
    for by in live_ros.VIEWED_FILES:
        if where := live_ros.viewed(fleet, by):
            yield f"open: {by}", where


def may(design: Design, guest: Guest) -> str:
    """What a guest may do, in words."""
    uses = []
    for row in guest.use:
        use = design.guest_uses[row.name]
        count = sum(len(design.interfaces[name].entries) for name in use.interface)
        asks = ", each with a person's consent" if row.consent else ""
        kinds = "kind" if count == 1 else "kinds"
        uses.append(f"{row.name} of {use.participant} ({count} {kinds}{asks})")
    return f"{guest.name} may say {' and '.join(uses)}, {guest.each_minute} a minute each"
