"""Answers to questions of people, from what hi knows: the tasks, what became of them, what a look around told last.

Pure. Must not know: HTTP, the grammar.
"""

from collections.abc import Callable

from companion import commands
from companion.languages.cmd import TaskState
from companion.languages.facts import Kind, fact
from companion.sentences import failure, person, state
from services.human_interface.catalogue import can, say
from services.human_interface.memory import Memory
from services.human_interface.wishes import in_words


def _see(memory: Memory, language: str) -> str:
    seen = memory.context.seen
    if seen is None:
        return say(language, "not_seen", in_words((commands.survey(),), language))
    return say(language, "seen", person((fact(Kind.SEEN, *seen) if seen else fact(Kind.SEEN_NOTHING),), language))


def _why(memory: Memory, language: str) -> str:
    """The task that is open and how it is, else the last one that was not done and the reason."""
    if memory.open_tasks:
        line = memory.open_tasks[0]
        why = say(language, "asks") if line.asks else person(line.why, language)
        return say(language, "because", line.said, state(line.state, language), why).rstrip()
    ended = [line for line in memory.tasks if line.state in (TaskState.FAILED, TaskState.CANCELLED)]
    if not ended:
        return say(language, "no_failure")
    line = ended[-1]
    why = failure(line.why, language) if line.state is TaskState.FAILED else person(line.why, language)
    return say(language, "failed", line.said, why or state(line.state, language))


def _help(memory: Memory, language: str) -> str:
    return say(language, "understood", can(language))


def _stopping(memory: Memory, language: str) -> str:
    return say(language, "stopping")


def _greet(memory: Memory, language: str) -> str:
    return say(language, "greet", can(language))


ANSWERS: dict[str, Callable[[Memory, str], str]] = {
    "see": _see,
    "why": _why,
    "help": _help,
    "stopping": _stopping,
    "greet": _greet,
}
"""The rows of the catalogue that are answered from memory."""
