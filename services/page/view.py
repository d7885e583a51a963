"""View that a browser shows, in its language, made from hi and the robot's telemetry. Pure. Must
not know: HTTP.
"""

import math

import msgspec

from companion.languages.cmd import TaskState
from companion.languages.evidence import unchecked
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.run_files import HiEvent, InWords, TaskLine, Wish
from companion.sentences import Reader, catalogue, failure, person, place, please, state, step
from companion.telemetry import Camera

# --- The words of the page, from the catalogue of its language (companion.sentences) --------------


LANGUAGES = ("en", "pl")
WORDS = {language: catalogue(Reader(language)).page for language in LANGUAGES}


def say(language: str, row: str, *parts: object) -> str:
    """Return a sentence of the page."""
    return WORDS[language][row].format(*parts)


def preferred(accepted: str) -> str:
    """Return the language for an Accept-Language header: the first in it that is known, English
    where none is.
    """
    for one in accepted.lower().split(","):
        if (language := one.strip()[:2]) in LANGUAGES:
            return language
    return LANGUAGES[0]


# --- View that a browser shows, in its language, made from hi and the robot's telemetry -----------


ENDED = (TaskState.DONE, TaskState.FAILED, TaskState.CANCELLED)
ACTIVE = (TaskState.RUNNING, TaskState.PLANNING)
MOST_ENDED = 30
"""Tasks of the history (estimate: those of a day)."""
PICTURES = tuple(Camera)
"""Names of the pictures: by the head camera, and of the robot in its room."""


class Heard(msgspec.Struct, frozen=True):
    """Knowledge of the page. `hi`: whether hi answers; `mode`: of the control loop, "" where nobody
    told; `hands`: what each hand holds, None where nobody told.
    """

    hi: bool = False
    held: bool = False
    mode: str = ""
    tasks: tuple[TaskLine, ...] = ()
    wishes: tuple[Wish, ...] = ()
    news: tuple[HiEvent, ...] = ()
    hands: dict[Side, str] | None = None


class TaskView(msgspec.Struct, frozen=True):
    """A task. `why`: the reason of its state. `asks`: the state of its plan that waits for a
    person, `asks_says` in words. `unchecked`: what nobody has checked of a task that was done.
    `again`: the sentence that asks for the same.

    Shown by a browser by its own clock [unix s], 0 for none: `deadline`; `start`, before which it
    does not begin; `until`, when it is expected to be done; `since`, when it got its state.
    """

    task: str
    says: str
    state: str
    word: str
    note: str = ""
    why: str = ""
    asks: str = ""
    asks_says: str = ""
    deadline: float = 0.0
    unchecked: str = ""
    start: float = 0.0
    until: float = 0.0
    since: float = 0.0
    again: str = ""


class ThingView(msgspec.Struct, frozen=True):
    """A thing, and the sentences that are about it."""

    thing: str
    says: tuple[str, ...]


class Announcement(msgspec.Struct, frozen=True):
    """The last thing that is said aloud; `n`: its number. `last`: how the last task ended, which is
    the same text if that was said last.
    """

    n: int = 0
    text: str = ""
    last: str = ""


class View(msgspec.Struct, frozen=True):
    """All that a browser shows but the picture. `please`: what the person is asked to do, which is
    also spoken; `hands`: what they hold; `alone`: sentences that are about no thing.
    """

    hi: bool
    held: bool
    now: str
    please: str
    active: TaskView | None
    step: str
    next: str
    hands: str
    queue: tuple[TaskView, ...]
    ended: tuple[TaskView, ...]
    alone: tuple[str, ...]
    things: tuple[ThingView, ...]
    told: Announcement


def view(heard: Heard, language: str) -> View:
    """Return what a browser shows."""
    waiting = sorted((line for line in heard.tasks if line.state not in ENDED), key=_order)
    active = waiting.pop(0) if waiting and waiting[0].state in ACTIVE else None
    ended = [line for line in heard.tasks if line.state in ENDED]
    now, then = _steps(active, language) if active else ("", "")
    return View(
        hi=heard.hi,
        held=heard.held,
        now=_now(heard, active, language),
        please=_please(heard, active, language),
        active=_task(active, language) if active else None,
        step=now,
        next=then,
        hands=_hands(heard, language),
        queue=tuple(_task(line, language) for line in waiting),
        ended=tuple(_task(line, language) for line in ended[: -MOST_ENDED - 1 : -1]),
        alone=tuple(in_language(one.says, language) for one in heard.wishes if not one.thing.en),
        things=_object_views(heard.wishes, language),
        told=_announcement(heard, language),
    )


def _order(line: TaskLine) -> tuple[bool, int, float]:
    """Return the sort key of a task: active first, then as the coordinator takes them, by urgency
    and deadline.

    Of equal keys the sort keeps the order in which they were said.
    """
    return line.state not in ACTIVE, -line.urgency, line.deadline or math.inf


def _now(heard: Heard, active: TaskLine | None, language: str) -> str:
    if heard.held:
        return say(language, "stopped")
    if not heard.hi:
        return say(language, "no_hi")
    if active is not None and active.asks:
        return say(language, "asks_you", _asks(active, language))
    return _upper(_says(active, language)) + "." if active else say(language, "idle")


def _hands(heard: Heard, language: str) -> str:
    if heard.hands is None:
        return ""
    held = [fact(Kind.HOLDS, side, name) for side, name in heard.hands.items()]
    return person(held or (fact(Kind.HANDS_EMPTY),), language)


def _please(heard: Heard, active: TaskLine | None, language: str) -> str:
    """What the person is asked to do now."""
    if heard.held or not heard.hi or active is None or active.at is None or active.asks:
        return ""
    return please(active.at, Reader(language))


def _steps(line: TaskLine, language: str) -> tuple[str, str]:
    """The step of the plan that is done now, and the one after it."""
    at = line.at.step if line.at is not None else None
    if at is None or not line.steps:
        return state(line.state, language), ""
    if not 0 < line.number <= len(line.steps):
        return step(at, Reader(language)), ""
    after = line.steps[line.number : line.number + 1]
    numbers = line.before + line.number, line.before + len(line.steps)
    now = say(language, "step", *numbers, step(at, Reader(language)))
    return now, say(language, "next", step(after[0], Reader(language))) if after else say(
        language, "last_step"
    )


def _task(line: TaskLine, language: str) -> TaskView:
    return TaskView(
        line.task,
        _says(line, language),
        line.state,
        state(Kind.SO_ALREADY if was_so(line) else line.state, language),
        say(language, "urgent") if line.urgency else "",
        "" if line.asks else _why(line, language),
        line.asks,
        _asks(line, language),
        line.deadline,
        _unchecked(line, language),
        line.start,
        line.until,
        line.since,
        in_language(line.wish, language) if line.wish else "",
    )


def was_so(line: TaskLine) -> bool:
    """Whether a task is done since there was nothing to do."""
    return line.state == TaskState.DONE and any(one.kind is Kind.SO_ALREADY for one in line.why)


def _why(line: TaskLine, language: str) -> str:
    """What the person is told of a task; of one that is done what its own acts tell, not how long
    it took.
    """
    if line.state == TaskState.FAILED:
        return failure(line.why, language)
    done = line.state == TaskState.DONE
    return person((one for one in line.why if not (done and isinstance(one.kind, Kind))), language)


def _asks(line: TaskLine, language: str) -> str:
    return place(line.at, Reader(language)) if line.asks and line.at is not None else ""


def _unchecked(line: TaskLine, language: str) -> str:
    claims = unchecked(line.evidence) if line.state == TaskState.DONE else ()
    return person((fact(Kind.NOT_CHECKED, one.claim, one.of) for one in claims), language)


def _says(line: TaskLine, language: str) -> str:
    return in_language(line.wish, language) if line.wish else line.said or line.task


def in_language(words: InWords, language: str) -> str:
    """Return the words in a language."""
    return str(getattr(words, language))


def _object_views(wishes: tuple[Wish, ...], language: str) -> tuple[ThingView, ...]:
    found: dict[str, list[str]] = {}
    for one in wishes:
        if not one.thing.en:
            continue
        found.setdefault(in_language(one.thing, language), []).append(
            in_language(one.says, language)
        )
    return tuple(ThingView(thing, tuple(says)) for thing, says in found.items())


def _announcement(heard: Heard, language: str) -> Announcement:
    """The last event that is worth a word: of a task that it enters a state, not each step of its
    plan.
    """
    lines = {line.task: line for line in heard.tasks}
    before: dict[str, str] = {}
    told = Announcement()
    for event in heard.news:
        row, last = f"told_{event.name}", before.get(event.task)
        repeated = bool(event.task) and last in (None, event.name)
        before[event.task] = event.name
        if row not in WORDS[language] or repeated:
            continue
        line = lines.get(event.task)
        row = "told_so" if line and event.name == TaskState.DONE and was_so(line) else row
        text = say(language, row, _says(line, language) if line else event.task)
        if line and event.name == line.state == TaskState.FAILED:
            text = f"{text} {failure(line.why, language)}"
        told = Announcement(event.n, text, text if event.name in ENDED else told.last)
    return told


def _upper(text: str) -> str:
    return text[:1].upper() + text[1:]
