"""The state of a fleet as `roco status` tells it: processes, tasks, and what is wrong."""

import time
from collections.abc import Iterator

import msgspec

from operate.cli.fleet import tasks
from operate.cli.fleet.process_status import Look, stuck, trouble
from operate.cli.fleet.targets import Target
from operate.cli.fleet.tasks import Task
from operate.run_folder import Fleet


class Status(msgspec.Struct, frozen=True):
    """The fleet, the tasks, whether the robot is held; `problem`: why no task is known; `troubles`: by process.

    `unheard`: who is not heard by whom, a sentence each; `paused`: agents that take no step. `stuck`: processes that
    are frozen or hang; `unkept`: why nobody looks after the fleet.
    """

    run: str
    fleet: Fleet | None
    tasks: tuple[Task, ...]
    stop_held: bool
    problem: str = ""
    troubles: dict[str, str] = {}
    unheard: tuple[str, ...] = ()
    paused: tuple[str, ...] = ()
    stuck: tuple[str, ...] = ()
    unkept: str = ""


def state_of(fleet: Target) -> Status:
    """Return the state of a run; a missing source of tasks is reported in it, not raised."""
    told, problem = tasks.of(fleet)
    now = fleet.look()
    troubles = {one.name: words for one in now.seen if one.status.pid and (words := trouble(one))}
    paused = tuple(one.name for one in now.seen if one.status.pid and one.beat is not None and one.beat.paused)
    late = tuple(one.name for one in now.seen if one.status.pid and stuck(one))
    return Status(
        fleet.where, now.fleet, told, now.stop_held, problem, troubles, tuple(unheard(now)), paused, late, now.unkept
    )


def unheard(now: Look) -> Iterator[str]:
    """Yield a sentence for each agent that another does not hear, though both run."""
    found = [(one.name, line) for one in now.seen if one.beat and one.status.pid for line in one.beat.unheard]
    if found:
        from agent_runtime.core import unheard as of_agents

        for name, line in found:
            yield of_agents.words(name, of_agents.Unheard(line.peer, line.channel, line.what, line.since), time.time())
