"""What each process does, in words for people: its state of design.toml, the loop's act, or how far its start is."""

from operate.cli.terminal.run_state import View
from operate.run_folder import ProcessState, ProcessStatus

WORDS = {
    "hi": {"listening": "listens", "interpreting": "makes sense of a sentence", "telling": "tells the person"},
    "co": {
        "trigger": "waits for news",
        "procReq": "takes a task",
        "compSP": "asks for a plan",
        "schedule": "decides what is next",
        "switch": "hands over a plan",
    },
    "pl": {
        "idle": "waits for a task",
        "initialize": "asks what is there",
        "search": "searches a plan",
        "finalize": "writes the plan",
    },
    "km": {"idle": "knows", "questionAnswering": "answers", "knowledgeSaving": "learns"},
    "ta": {
        "idle": "waits for a plan",
        "surveying": "has ex look around",
        "running": "carries out the plan",
        "stopping": "stops",
        "securing": "has things put down",
        "closing": "ends the plan",
        "finished": "waits for co's word",
    },
    "ex": {
        "recovering": "sees where it stands",
        "idle": "waits for an act",
        "preparing": "works out an act",
        "acting": "acts",
        "stopping": "stops",
        "reporting": "reports",
    },
    "loop": {
        "": "holds still",
        "motion": "holds still",
        "damping": "damps the joints",
        "hold": "holds the joints",
        "stopped": "stopped by a person",
        "MoveJoint": "moves an arm",
        "MoveCartesian": "pulls straight",
        "Grasp": "grasps",
        "Release": "puts down",
        "Look": "looks",
        "Pour": "pours",
        "Home": "moves an arm home",
    },
    "router": {"": "carries the words"},
    "monitor": {"": "records"},
}
COLOURS = {
    "ready": "green",
    "done": "green",
    "running": "cyan",
    "planning": "cyan",
    "starting": "yellow",
    "waiting": "dim",
    "backing-off": "red",
    "given-up": "bold red",
    "failed": "bold red",
    "refused": "red",
    "cancelled": "yellow",
}
AT_REST = {"waits", "holds", "knows", "listens", "carries", "records"}


def doing(status: ProcessStatus, view: View) -> tuple[str, str]:
    """Words and style of what a process does; as the supervisor sees it while it does not serve."""
    seen = view.agents.get(status.name)
    if status.state is not ProcessState.READY:
        return status.state, COLOURS.get(status.state, "")
    if seen is not None and not seen.alive:
        return "not reachable", "bold red"
    state = seen.state if seen is not None else ""
    words = WORDS.get(status.name, {}).get(state) or state or "ready"
    return words, "dim" if words.split()[0] in AT_REST and state not in ("hold", "stopped") else "cyan"


def waited_for(processes: tuple[ProcessStatus, ...]) -> str:
    """Which processes the start still waits for; "" when all that are needed are ready."""
    needed = [status for status in processes if not status.optional]
    starting = [status.name for status in needed if status.state is not ProcessState.READY]
    if not starting:
        return ""
    return f"starting: {len(needed) - len(starting)} of {len(needed)} ready, waiting for {', '.join(starting)}"
