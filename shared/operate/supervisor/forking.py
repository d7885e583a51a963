"""A fleet whose processes are forked from one that has imported what they share (agent_runtime.io.fork_server).

It is one more process of the fleet, ready before the others: it is watched, restarted and given up like them. Where it
is not ready they are started without it, each by an interpreter of its own.
"""

import msgspec

from agent_runtime.io import forked
from agent_runtime.io.secured import ROUTER
from operate.supervisor.processes import RECORDS_S, Process

PATIENCE_S = 30.0  # estimate: its imports take 2 s, and 12 s on a slow machine at a load of 3
FORKS = Process(forked.FORKS, "agent_runtime.io.fork_server", optional=True, patience_s=PATIENCE_S, hangs_s=RECORDS_S)
FORKS_FILE = "forks.sock"


def forking(processes: tuple[Process, ...]) -> tuple[Process, ...]:
    """Return the processes with the fork server before those that it makes.

    The router, which others wait for, starts beside it.
    """
    made = [one for one in processes if one.forked and one.name != ROUTER]
    if len(made) < 2:
        return processes
    modules = (name for one in made for name in (program(one), *one.workers))
    server = msgspec.structs.replace(FORKS, arguments=tuple(dict.fromkeys(modules)))
    behind = (msgspec.structs.replace(one, after=(*one.after, FORKS.name)) if one in made else one for one in processes)
    return (server, *behind)


def program(process: Process) -> str:
    """Return the module that Python runs for a process."""
    return f"{process.module}.__main__"
