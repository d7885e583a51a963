"""State of each process in words for people: as the design or the system names it, or the progress
of its start.
"""

from console.terminal.run_state import View
from operate.fleet_file import ProcessState, ProcessStatus
from operate.system import System

AROUND = {"router": {"": "serves tools"}, "monitor": {"": "records"}}
"""Of the processes that every system has."""
COLOURS = {
    "ready": "green",
    "done": "green",
    "running": "cyan",
    "planning": "cyan",
    "starting": "yellow",
    "waiting": "dim",
    "suspended": "yellow",
    "backing-off": "red",
    "given-up": "bold red",
    "failed": "bold red",
    "refused": "red",
    "cancelled": "yellow",
}
AT_REST = {"waits", "holds", "knows", "listens", "carries", "records"}


def state_text(system: System, name: str, state: str) -> str:
    """Return what a process does in a state, in words; "" where nobody says it."""
    agent = system.design.agents.get(name)
    if agent is not None:
        return next((one.says for one in agent.state if one.name == state), "")
    return (AROUND | system.says).get(name, {}).get(state, "")


def doing(status: ProcessStatus, view: View, system: System) -> tuple[str, str]:
    """Words and style of what a process does; as the supervisor sees it while it does not serve."""
    seen = view.agents.get(status.name)
    if status.state is not ProcessState.READY:
        return status.state, COLOURS.get(status.state, "")
    if seen is not None and not seen.alive:
        return "not reachable", "bold red"
    state = seen.state if seen is not None else ""
    words = state_text(system, status.name, state) or state or "ready"
    rests = words.split()[0] in AT_REST and state not in ("hold", "stopped")
    return words, "dim" if rests else "cyan"


def waited_for(processes: tuple[ProcessStatus, ...]) -> str:
    """Return the processes that the start still waits for; "" when all needed ones are ready."""
    needed = [status for status in processes if not status.optional]
    starting = [status.name for status in needed if status.state is not ProcessState.READY]
    if not starting:
        return ""
    ready = f"{len(needed) - len(starting)} of {len(needed)} ready"
    return f"starting: {ready}, waiting for {', '.join(starting)}"
