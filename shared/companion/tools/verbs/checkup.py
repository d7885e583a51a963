"""Checks of `roco doctor` for this robot: libraries, whether real time can be held, a_hi."""

import os
import resource
from collections.abc import Iterator
from functools import partial

from companion.tools.verbs import pace
from companion.tools.verbs.hi import HI, tasks
from operate.cli.errors import ConsoleError
from operate.cli.fleet import checkup_machine, running_fleets
from operate.cli.fleet.checkup import Check, Checks, Level
from operate.cli.fleet.process_status import Look
from operate.cli.fleet.targets import Target

NEEDED = (*checkup_machine.NEEDED, "knowledge", "planner", "executor")
"""The extras that the whole fleet on one machine needs."""
IMPORTS = (*checkup_machine.IMPORTS, "pinocchio", "coal", "ompl", "mujoco")
"""Libraries with parts that are not Python: installed is not yet loadable."""
MEMORY = 1 << 30
"""Bytes that the fleet uses: 975 MiB resident before its first task (measured 2026-11-21)."""


def person(fleet: Target, now: Look) -> Iterator[Check]:
    """Whether a_hi answers."""
    if not any(one.name == HI and one.status.pid for one in now.seen):
        return
    try:
        count = len(tasks(fleet))
        yield Check("hi", Level.FINE, f"answers; {count} task{'s' * (count != 1)} so far")
    except ConsoleError as error:
        yield Check("hi", Level.WRONG, str(error), "`roco agent restart hi`")


def real_time() -> Iterator[Check]:
    """Whether the loop holds 500 Hz with what runs now, and whether it may ask for SCHED_FIFO.

    Timed only where no fleet runs here: its own loop would be in the way, and tells its timing in the report.
    """
    measured = None if running_fleets.here() else pace.measure()
    if measured is not None and measured.held:
        yield Check("real time", Level.FINE, f"{measured.words}: real time is held")
    elif measured is not None:
        remedy = "end other programs, or start with `--speed max`, which needs no real time"
        yield Check("real time", Level.WRONG, f"{measured.words}: real time cannot be held", remedy)
    _, most = resource.getrlimit(resource.RLIMIT_RTPRIO)
    if most > 0 or most == resource.RLIM_INFINITY or os.geteuid() == 0:
        yield Check("real time", Level.FINE, "the loop may ask for a real-time priority")
    else:
        remedy = "only for a real robot: rtprio and memlock in /etc/security/limits.conf, or deploy/compose.rt.yaml"
        yield Check("real time", Level.NOTE, "no right to a real-time priority: the loop runs without", remedy)


CHECKS = Checks(
    machine={
        "libraries": partial(checkup_machine.libraries, NEEDED),
        "imports": partial(checkup_machine.imports, IMPORTS),
        "memory": partial(checkup_machine.memory, MEMORY),
        "real time": real_time,
    },
    fleet={"hi": person},
)
