"""A process of a system, and those that every system has."""

import msgspec

ORDERLY_STOP_S = 5.0  # estimate: an agent closes its session and its journal in well under a second
SILENT_S = 6.0  # estimate: six heartbeats
# estimate: the monitor works at a low priority, and reads large content amid its heartbeats
RECORDS_S = 20.0
# estimate: when it is stopped the monitor writes report and pictures, perhaps of several robots
REPORT_S = 120.0


class Process(msgspec.Struct, frozen=True):
    """One process: Python runs `-m module arguments`.

    `forked`: whether the fork server makes it, where there is one; one that locks its memory would
    lock a copy of all that the server imported. `workers`: modules that children of it run.

    `after`: processes that are ready before it starts, and stop only once it has ended. `optional`:
    others do not wait for it for more than `patience_s`, and the fleet counts as ready without it.
    `stop_within_s`: then it is killed. `hangs_s`: silence of its heartbeat after which it is killed
    and started again [s].
    """

    name: str
    module: str
    after: tuple[str, ...] = ()
    optional: bool = False
    patience_s: float = 10.0
    stop_within_s: float = ORDERLY_STOP_S
    hangs_s: float = SILENT_S
    arguments: tuple[str, ...] = ()
    workers: tuple[str, ...] = ()
    forked: bool = True


# Agents start side by side: each is ready when a ping was answered on each of its channels: they
# wait for each other. They end before the monitor, which then has their last word. They do not wait
# until it is ready: it reads their logs.
FIRST = ("router", "monitor")


def around(
    router: str = "operate.router", monitor: str = "operate.recording"
) -> tuple[Process, Process]:
    """The router and the monitor of a system, run by these modules."""
    return (
        Process("router", router),
        Process(
            "monitor",
            monitor,
            after=("router",),
            optional=True,
            patience_s=0.0,
            stop_within_s=REPORT_S,
            hangs_s=RECORDS_S,
        ),
    )


def agents(package: str, *names: str) -> tuple[Process, ...]:
    """Agents that are run as `package.name`."""
    return tuple(Process(name, f"{package}.{name}", after=FIRST) for name in names)
