"""Plans of a run, read off the traffic: how each was made (C3, C4), and how each was carried out
(C1, C5). And the verdicts that tasks have of their own (companion.tasks, part `verdict`): by the
truth, not by what co said.
"""

from collections.abc import Callable, Iterator
from functools import cache

import msgspec

from companion.languages import cmd, hfsm, rc, sw
from companion.languages.evidence import Evidence
from companion.sentences import plain, spaced, why
from companion.tasks import parts
from companion.telemetry import TrueState
from fipa_codec.performatives import Performative
from operate.recording.history import History
from operate.recording.records import Spoken


class Share(msgspec.Struct, frozen=True):
    """The part of the content that the robot believes to have poured, from the weight [kg] that
    left the source in its last pour that was done and what it took the content to weigh; `seen_kg`:
    in the bowl then, null where it was not looked into; `true`: grains in the bowl of all grains.
    """

    believed: float | None
    left_kg: float | None
    content_kg: float | None
    true: float | None
    seen_kg: float | None = None


class Figures(msgspec.Struct, frozen=True):
    """Figures of the main job for report.json; None where the truth was not recorded."""

    poured_fraction: float | None = None
    bowl_tilt_deg: float | None = None
    poured: Share | None = None


class Judge(msgspec.Struct, frozen=True):
    """The verdict of a task. `asked`: its command, `verb` what it asks to do. `against`: why it was
    not done, by the truth at its end. `true`: whether a claim is true, None where the truth does
    not tell. `figures`: those of the main job for report.json; None for another task.
    """

    asked: type[cmd.Command]
    verb: str
    against: Callable[[History, Spoken], Iterator[str]]
    true: Callable[[Evidence, TrueState], bool | None]
    figures: Callable[[History], Figures] | None = None


@cache
def judges() -> tuple[Judge, ...]:
    """Return the verdicts of all tasks."""
    return tuple(part.JUDGE for part in parts("verdict"))


def judge_of(command: object) -> Judge | None:
    """Return the verdict of a command's task, None where it has none."""
    return next((one for one in judges() if isinstance(command, one.asked)), None)


TASK_ENDS = (cmd.TaskState.DONE, cmd.TaskState.FAILED, cmd.TaskState.CANCELLED)
REFUSALS = (Performative.REFUSE, Performative.NOT_UNDERSTOOD)
REFUSED = "refused"


class Made(msgspec.Struct, frozen=True):
    """A plan asked for: `number` counts from 1, `network` names the request, `plan` is the plan's
    id ("": none came).

    `wall_s`, `outcome` and `end` None: no answer came. `queries`: what pl asked km meanwhile;
    `waits`: from each of them to its answer, [(start, end)] in unix seconds; `communicates`: all of
    C4 meanwhile; `outcome`: found, none, cancelled.
    """

    number: int
    network: str
    plan: str
    conversation: str
    task: str
    start: float
    end: float | None
    wall_s: float | None
    queries: int
    waits: tuple[tuple[float, float], ...]
    communicates: int
    bytes: int
    outcome: str | None
    reason: str = ""
    expected_s: float | None = None


class Ran(msgspec.Struct, frozen=True):
    """A plan carried out. `outcome`: ta's last report, None where there is none; `states`: how many
    it reported.
    """

    number: int
    plan: str
    conversation: str
    start: float
    end: float | None
    outcome: sw.WorkerState | None
    reason: str
    states: int


class ActRecord(msgspec.Struct, frozen=True):
    """An act asked of ex: the command, when it was asked, agreed to (the robot moves from then on)
    and answered.

    `done`: whether it was; else `reason`.
    """

    command: rc.Command
    start: float
    agreed: float | None
    end: float | None
    done: bool
    reason: str = ""


def made(history: History) -> tuple[Made, ...]:
    """All requests for a plan, in the order of time; one that pl put off is asked again, and counts
    then.
    """
    return history.once(_all_made)


def _all_made(history: History) -> tuple[Made, ...]:
    asked = [one for one in history.said if isinstance(one.content, hfsm.GroundTaskNetwork)]
    none = (one for one in history.said if isinstance(one.content, hfsm.NoPlan))
    put_off = {one.conversation for one in none if one.content.later}
    asked = [one for one in asked if one.conversation not in put_off]
    return tuple(_made(history, number, one) for number, one in enumerate(asked, start=1))


def ran(history: History) -> tuple[Ran, ...]:
    """All plans given to ta, in the order of time."""
    return history.once(_all_ran)


def _all_ran(history: History) -> tuple[Ran, ...]:
    to_ta = (one for one in history.said if one.channel == "C1")
    asked = [one for one in to_ta if isinstance(one.content, hfsm.HierarchicalPlan)]
    return tuple(_ran(history, number, one) for number, one in enumerate(asked, start=1))


def acts(history: History) -> tuple[ActRecord, ...]:
    """All acts asked of ex, in the order of time."""
    return history.once(_acts)


def _acts(history: History) -> tuple[ActRecord, ...]:
    asked = [one for one in history.said if isinstance(one.content, rc.Command)]
    return tuple(_act(history, one) for one in asked)


def commands(history: History) -> tuple[Spoken, ...]:
    """All commands of people, in the order of time."""
    return history.once(_commands)


def _commands(history: History) -> tuple[Spoken, ...]:
    return tuple(one for one in history.said if isinstance(one.content, cmd.Command))


def asked(command: Spoken) -> str:
    """A command in words: what is to be done with what."""
    name, *of = asked_of(command)
    return plain(" ".join((spaced(name), *of)))


def asked_of(command: Spoken) -> tuple[str, ...]:
    """The class of a command, and what is to be done with what."""
    what = command.content
    general = cmd.Command.__struct_fields__
    fields = [getattr(what, name) for name in what.__struct_fields__ if name not in general]
    return (type(what).__name__, *(one for one in fields if one and isinstance(one, str)))


def task_command(history: History) -> Spoken | None:
    """The first command of a person for a task with a verdict of its own (the main job) that was
    not refused; without one the first for such a task, else the first of any kind; None where there
    is none.
    """
    all_commands = commands(history)
    judged = [one for one in all_commands if judge_of(one.content)]
    taken = [one for one in judged if outcome(task_end(history, one)) != REFUSED]
    return next(iter((*taken, *judged, *all_commands)), None)


def outcome(end: Spoken | None) -> str:
    """Return the end of a command: a state of its task, or that it was refused; "" if it did not
    end.
    """
    if end is None:
        return ""
    if end.performative in REFUSALS:
        return REFUSED
    return str(getattr(end.content, "state", end.performative))


def others_plans(history: History, command: Spoken) -> frozenset[str]:
    """The ids of plans that were asked for, or carried out, for other commands than this one: co
    names them by it.
    """
    others = {one.conversation for one in commands(history)} - {command.conversation}
    marks = tuple(f"{one}-plan" for one in others)
    return frozenset(name for name in history.once(_networks) if name.startswith(marks))


def _networks(history: History) -> tuple[str, ...]:
    """The ids of all plans that were asked for, in the order of time."""
    contents = (one.content for one in history.said)
    return tuple(one.id for one in contents if isinstance(one, hfsm.GroundTaskNetwork))


def task_end(history: History, command: Spoken) -> Spoken | None:
    """co's last word about a command: refuse, failure, or the inform with its result."""
    ends = (*REFUSALS, Performative.FAILURE)
    for one in _answers(history, command):
        if one.performative in ends:
            return one
        if (
            one.performative == Performative.INFORM
            and getattr(one.content, "state", None) in TASK_ENDS
        ):
            return one
    return None


def _answers(history: History, opening: Spoken) -> Iterator[Spoken]:
    for one in history.conversation(opening.conversation):
        if one.sender == opening.receiver:
            yield one


def _made(history: History, number: int, asked: Spoken) -> Made:
    ends = (one for one in _answers(history, asked) if one.performative != Performative.AGREE)
    end = next(ends, None)
    took = None if end is None else history.answered(asked, end)
    until = end.received if end is not None else float("inf")
    talk = [one for one in history.during(asked.received, until) if one.channel == "C4"]
    plan = (
        end.content if end is not None and isinstance(end.content, hfsm.HierarchicalPlan) else None
    )
    return Made(
        number=number,
        network=asked.content.id,
        plan="" if plan is None else plan.id,
        conversation=asked.conversation,
        task=", then ".join(
            plain(" ".join((task.name.replace("_", " "), *task.arguments)))
            for task in asked.content.tasks
        ),
        start=asked.received,
        end=None if end is None else end.received,
        wall_s=took,
        queries=sum(one.performative == Performative.QUERY_REF for one in talk),
        waits=tuple(_waits(history, talk)),
        communicates=len(talk),
        bytes=sum(one.size for one in talk),
        outcome=None if end is None else _outcome(end),
        reason=reason(end),
        expected_s=None if plan is None else plan.duration,
    )


def _waits(history: History, talk: list[Spoken]) -> Iterator[tuple[float, float]]:
    """From each query, as it was taken, as long as its answer took."""
    asked: dict[str, Spoken] = {}
    for one in talk:
        if one.performative == Performative.QUERY_REF:
            asked.setdefault(one.conversation, one)
        elif one.conversation in asked:
            query = asked.pop(one.conversation)
            took = history.answered(query, one)
            if took is not None:
                yield query.received, query.received + took


def _outcome(end: Spoken) -> str:
    if isinstance(end.content, hfsm.HierarchicalPlan):
        return "found"
    return "cancelled" if end.performative == Performative.INFORM else "none"


def _ran(history: History, number: int, asked: Spoken) -> Ran:
    reports = [one for one in _answers(history, asked) if isinstance(one.content, sw.Report)]
    ended = (
        one
        for one in reports
        if one.content.state in sw.FINAL or one.performative == Performative.REFUSE
    )
    end = next(ended, None)
    return Ran(
        number=number,
        plan=asked.content.id,
        conversation=asked.conversation,
        start=asked.received,
        end=None if end is None else end.received,
        outcome=None if end is None else end.content.state,
        reason=reason(end),
        states=len(reports),
    )


def _act(history: History, asked: Spoken) -> ActRecord:
    answers = list(_answers(history, asked))
    agreed = next((one.received for one in answers if one.performative == Performative.AGREE), None)
    end = next((one for one in answers if one.performative != Performative.AGREE), None)
    done = end is not None and isinstance(end.content, rc.Done)
    until = None if end is None else end.received
    return ActRecord(asked.content, asked.received, agreed, until, done, reason(end))


def reason(end: Spoken | None) -> str:
    """Why an answer is as it is, in the operator's words."""
    return "" if end is None else why(end.content)
