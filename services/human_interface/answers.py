"""Answers to questions of people, from what hi knows: the tasks, what became of them, what a look around told last.

Pure. Must not know: HTTP, the grammar.
"""

from collections.abc import Callable

from companion import wording
from companion.languages.cmd import TaskState
from services.human_interface.catalogue import say
from services.human_interface.memory import Memory


def _see(memory: Memory, language: str) -> str:
    seen = memory.context.seen
    return (
        say(language, "seen", wording.plain(seen.removeprefix("seen: ")).rstrip("."))
        if seen
        else say(language, "not_seen")
    )


def _why(memory: Memory, language: str) -> str:
    """The task that is open and how it is, else the last one that was not done and the reason."""
    if memory.open_tasks:
        line = memory.open_tasks[0]
        return say(language, "because", line.said, line.state, f" ({wording.plain(line.text)})" if line.text else "")
    ended = [line for line in memory.tasks if line.state in (TaskState.FAILED, TaskState.CANCELLED)]
    if not ended:
        return say(language, "no_failure")
    return say(language, "failed", ended[-1].said, wording.plain(ended[-1].text or ended[-1].state).rstrip("."))


def _help(memory: Memory, language: str) -> str:
    return say(language, "understood", say(language, "can"))


def _stopping(memory: Memory, language: str) -> str:
    return say(language, "stopping")


def _greet(memory: Memory, language: str) -> str:
    return say(language, "greet", say(language, "can"))


ANSWERS: dict[str, Callable[[Memory, str], str]] = {
    "see": _see,
    "why": _why,
    "help": _help,
    "stopping": _stopping,
    "greet": _greet,
}
"""The rows of the catalogue that are answered from memory."""
