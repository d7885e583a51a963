"""The door of hi: what guests of the design want (topdown.model.elements.Guest), as tasks like
those of people, and what becomes of them.

A guest wishes by a command of CMD. Its task is among all others, so people see and cancel it. It
may ask what a sentence means, and is told a command that it may say; nothing is done by that, but
for a word that stops the robot. Must not know: HTTP, programs that are guests.
"""

import threading
import time
from typing import Any

import msgspec
from msgspec.structs import replace

from agent_runtime.io.devices import Post
from agent_runtime.io.guests import Asked, Door
from companion import commands
from companion.design import DESIGN, LANGUAGES, AgentName, AnyCommand
from companion.languages import cmd
from companion.languages.cmd import BACK, THINGS, TaskReport, TaskState
from companion.languages.values import Side
from companion.loopback_server import Refused, RobotStop
from companion.run_files import TaskLine
from companion.stop_words import stop_words
from fipa_codec.languages import Kind, Reason
from fipa_codec.performatives import Performative as P
from services.human_interface.catalogue import THINGS as KINDS
from services.human_interface.catalogue import say
from services.human_interface.device_messages import Answer, CancelWanted, Shown, Wanted, When
from services.human_interface.grammar import understand
from services.human_interface.interpretation import (
    Act,
    Ask,
    Context,
    Outcome,
    Tell,
    in_words,
    outcome,
)
from services.human_interface.memory import FINAL
from services.human_interface.server import HttpDevice

MOST_BYTES = 600
"""Of hi's words in a refusal, which has at most 1000 bytes with its envelope. hi's own words have
at most 350 (estimate); an unknown word that they quote may have 800.
"""


class HiDevice:
    """The device of hi: people by HTTP, and guests."""

    busy = False

    def __init__(self, post: Post, people: HttpDevice, robot: RobotStop) -> None:
        self._post, self._people, self._robot = post, people, robot
        self._lock = threading.RLock()
        self._tasks: dict[str, str] = {}  # conversation -> task, "" before hi's answer
        self._told: dict[str, TaskReport] = {}
        self._seen: tuple[str, ...] | None = None
        self._door = Door(DESIGN, LANGUAGES, AgentName.HI, post, self._asked)

    def tell(self, content: Any) -> None:
        """Take a message of the agent for people and guests."""
        match content:
            case Answer(ticket=ticket) if ticket in self._tasks:
                self._answered(content)
                return
            case Shown(tasks=tasks, seen=seen):
                self._seen = seen
                self._shown({line.task: line for line in tasks})
        self._people.tell(content)

    def close(self) -> None:
        """Listen no more."""
        self._people.close()

    def _asked(self, asked: Asked) -> None:
        name = asked.conversation
        if isinstance(asked.content, cmd.Sentence):
            self._read(name, asked.content.text)
            return
        with self._lock:
            if asked.content is not None:
                if why := unsayable(asked.content):
                    self._door.say(name, P.REFUSE, Reason(why))
                    return
                self._tasks[name] = ""
                held = self._robot.held
                self._post(Wanted(name, asked.guest, asked.content, held, time.time()))
            elif task := self._tasks.get(name):
                self._post(CancelWanted("", task))

    def _read(self, name: str, text: str) -> None:
        """Tell what a sentence means, or stop the robot as by a person's."""
        match meant(text, self._seen):
            case Act(tasks=(task,)):
                self._door.say(name, P.INFORM_REF, task)
            case Ask(text=why):
                short = why.encode()[:MOST_BYTES].decode(errors="ignore")
                self._door.say(name, P.REFUSE, Reason(short))
            case _:
                try:
                    line = self._people.app.hold(True, text)
                except Refused as error:
                    self._door.say(name, P.FAILURE, Reason(str(error)))
                else:
                    self._door.say(name, P.INFORM_REF, cmd.Stopped(line.text))

    def _answered(self, answer: Answer) -> None:
        with self._lock:
            line, name = answer.line, answer.ticket
            if line is None or not line.task:
                del self._tasks[name]
                self._door.say(
                    name, P.REFUSE, Reason(answer.problem or (line.text if line else ""))
                )
                return
            self._tasks[name] = line.task
            self._told[name] = report = TaskReport(TaskState.WAITING)
            self._door.say(name, P.AGREE, report)
            if self._door.cancelling(name):  # the cancel came before hi knew the task
                self._post(CancelWanted("", line.task))

    def _shown(self, lines: dict[str, TaskLine]) -> None:
        with self._lock:
            for name, task in tuple(self._tasks.items()):
                line = lines.get(task)
                if line is None:
                    continue
                now = reported(line)
                before = self._told.get(name)
                if now == before:
                    continue
                self._told[name] = now
                if now.state in FINAL:
                    del self._tasks[name], self._told[name]
                    self._ended(name, now)
                else:
                    # the steps of a plan are told once
                    same = before is not None and before.steps == now.steps
                    self._door.say(
                        name, P.INFORM, replace(now, steps=()) if same else now, Kind.PROGRESS
                    )

    def _ended(self, name: str, report: TaskReport) -> None:
        """The last word. A cancel is answered by it, or, where it came too late, behind it."""
        done = report.state is TaskState.DONE
        if not self._door.cancelling(name):
            self._door.say(name, P.INFORM if done else P.FAILURE, report)
        elif report.state is TaskState.CANCELLED:
            self._door.say(name, P.INFORM, report, Kind.CANCEL)
        else:
            self._door.say(name, P.FAILURE, report, Kind.CANCEL)


def meant(text: str, seen: tuple[str, ...] | None) -> Outcome:
    """What a guest's sentence means where these things were seen: an Act of one command without a
    time; a Tell where the robot is to stop; else an Ask, which says why it is neither.
    """
    if stop_words(text):
        return Tell("stop")
    meaning = understand(text)
    found = outcome(meaning, Context(seen=seen))
    match found:
        case Ask() | Tell(does="stop"):
            return found
        case Act(tasks=(_,), instead=False) if meaning.when == When():
            return found
    language = meaning.language
    return Ask(say(language, "one_command", commands.example(language)))


def unsayable(task: AnyCommand) -> str:
    """Why no person could say this command, so that no guest may; "" where one could. Its sentence
    is understood as the same command where the things in it are seen.
    """
    for field in (*THINGS, "place"):
        name = getattr(task, field, "")
        known = tuple(one.name for one in KINDS.values() if field != "place" or "put" in one.can)
        left_out = name == "" and not _needed(task, field)
        if not (left_out or (field == "place" and name == BACK) or _named(name, known)):
            return f"{field} is no thing that can be named so; there are {', '.join(known)}"
    side = getattr(task, "side", "")
    if side not in ("", *Side):
        return f"side is none; there are {', '.join(Side)}"
    sentence = in_words((task,))
    seen = tuple(
        name for name in (*task.things, getattr(task, "place", "")) if name not in ("", BACK)
    )
    found = outcome(understand(sentence), Context(seen=seen))
    if isinstance(found, Act) and found.tasks == (task,):
        return ""
    return found.text if isinstance(found, Ask) else f"{sentence!r} is no such wish"


def _needed(task: AnyCommand, field: str) -> bool:
    return any(one.required for one in msgspec.structs.fields(task) if one.name == field)


def _named(name: str, kinds: tuple[str, ...]) -> bool:
    kind, _, number = name.partition("_")
    return kind in kinds and (name == kind or (number.isascii() and number.isdecimal()))


def reported(line: TaskLine) -> TaskReport:
    """What a line tells of its task, in the language of guests."""
    return TaskReport(
        TaskState(line.state),
        why=line.why,
        steps=line.steps,
        at=line.at,
        number=line.number,
        asks=bool(line.asks),
        evidence=line.evidence,
    )
