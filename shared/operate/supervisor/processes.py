"""The processes of the fleet, in one table: what is run, after what, and how long it may take to end.

Loop and agent of ex are siblings: each may die and come back without the other.
"""

import msgspec

ORDERLY_STOP_S = 5.0  # estimate: an agent closes its session and its journal in well under a second
REPORT_S = 120.0  # estimate: when it is stopped the monitor writes report and pictures, perhaps of several robots


class Process(msgspec.Struct, frozen=True):
    """One process: Python runs `-m module`.

    `after`: processes that are ready before it starts, and stop only once it has ended. `optional`: others do not wait
    for it for more than `patience_s`, and the fleet counts as ready without it. `stop_within_s`: then it is killed.
    """

    name: str
    module: str
    after: tuple[str, ...] = ()
    optional: bool = False
    patience_s: float = 10.0
    stop_within_s: float = ORDERLY_STOP_S


# Agents start side by side: each is ready when a ping was answered on each of its channels: they wait for each other.
# They start after the monitor, so that the recording has their first word.
AGENTS = ("router", "monitor")
FLEET = (
    Process("router", "services.router"),
    Process("monitor", "services.monitor", after=("router",), optional=True, stop_within_s=REPORT_S),
    Process("loop", "services.executor.loop"),
    Process("km", "services.knowledge", after=AGENTS),
    Process("pl", "services.planner", after=AGENTS),
    Process("ta", "services.task", after=AGENTS),
    Process("ex", "services.executor", after=(*AGENTS, "loop")),
    Process("co", "services.coordinator", after=AGENTS),
    Process("hi", "services.human_interface", after=AGENTS),
)
