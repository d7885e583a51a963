"""An MCP server of the companion's guest before agents that answer as a test says, and its clients:
of the newest protocol, and of the one before.
"""

import asyncio
import contextlib
from collections.abc import Callable
from typing import Any

import mcp_types as types
from mcp import Client
from msgspec.structs import replace

from agent_runtime.io.guests import Answer
from companion.design import DESIGN, LANGUAGES
from companion.languages.cmd import Sentence, Stopped, TaskReport, TaskState
from companion.tools.assistant import PROMPTS
from companion.tools.system import SYSTEM
from fipa_codec.languages import Reason
from fipa_codec.performatives import Performative as P
from operate.guests.errands import Errands
from operate.guests.hosting import Resource, Served
from operate.guests.mcp_server import TASKS, McpServer
from operate.guests.offers import offers
from services.human_interface.guests import meant
from services.human_interface.interpretation import Act, Ask

GUEST = "assistant"
MODES = ("2026-07-28", "legacy")
AGREED = (
    Answer(P.AGREE, TaskReport(TaskState.WAITING), False, False),
    Answer(P.INFORM, TaskReport(TaskState.RUNNING), False, False),
    Answer(P.INFORM, TaskReport(TaskState.DONE), True, False),
)


def understood(sentence: Sentence) -> Answer:
    """What hi answers, where it has seen two jars and a bowl."""
    match meant(sentence.text, ("jar_1", "jar_2", "bowl_1")):
        case Act(tasks=(task,)):
            return Answer(P.INFORM_REF, task, True, False)
        case Ask(text=why):
            return Answer(P.REFUSE, Reason(why), True, False)
    return Answer(P.INFORM_REF, Stopped("stopped"), True, False)


class Agents:
    """What hears the guest in place of a Visit: `says` gives the answers to a content,
    `understands` that to a sentence; `read`: sentences that hi was asked about, with its answers.
    """

    def __init__(
        self,
        says: Callable[[Any], tuple[Answer, ...]] = lambda content: AGREED,
        understands: Callable[[Sentence], Answer] = understood,
    ) -> None:
        self.says, self.understands = says, understands
        self.asked: list[tuple[str, Any]] = []
        self.read: list[tuple[str, Any]] = []
        self.cancelled: list[str] = []
        self._talks: dict[str, Callable[[Answer], None]] = {}

    def ask(self, use: str, act: P, content: Any, on_answer: Callable[[Answer], None]) -> str:
        """Note it, and answer."""
        if isinstance(content, Sentence):
            answer = self.understands(content)
            self.read.append((content.text, answer.content))
            on_answer(answer)
            return "sentence"
        name = f"talk-{len(self.asked)}"
        self.asked.append((use, content))
        self._talks[name] = on_answer
        for answer in self.says(content):
            on_answer(answer)
        return name

    def cancel(self, conversation: str) -> None:
        """Note it; the agent says that it has ended."""
        self.cancelled.append(conversation)
        report = TaskReport(TaskState.CANCELLED)
        self._talks[conversation](Answer(P.INFORM, report, True, True))


class Person:
    """Answers what the client asks; `words`: what was asked."""

    def __init__(self, action: str = "accept", agrees: Any = True) -> None:
        self.words: list[str] = []
        self._action, self._agrees = action, agrees

    async def __call__(self, _: Any, params: Any) -> types.ElicitResult:
        self.words.append(params.message)
        content = {"agree": self._agrees} if self._action == "accept" else None
        return types.ElicitResult(action=self._action, content=content)  # type: ignore[arg-type]


class House:
    """Server and agents; `stops`: how often the robot was stopped; `sentences`: hi takes those."""

    def __init__(
        self, agents: Agents | None = None, *, consent: bool = True, sentences: bool = True
    ) -> None:
        self.agents, self.stops = agents or Agents(), 0
        design = DESIGN
        if not (consent and sentences):
            guest = DESIGN.guests[GUEST]
            uses = tuple(
                replace(one, consent=one.consent and consent)
                for one in guest.use
                if sentences or one.name != "sentence"
            )
            file = replace(DESIGN.file, guest=(replace(guest, use=uses),))
            design = type(DESIGN)(file, DESIGN.path, DESIGN.text, DESIGN.folder)

        async def seen() -> str:
            return "{}"

        self.errands = Errands(SYSTEM, self.agents, lambda: self.server.changed(TASKS))  # type: ignore[arg-type]
        self.served = Served(
            "roco",
            "0",
            GUEST,
            offers(design, LANGUAGES, GUEST),
            (Resource("seen", "what is seen", "application/json", seen),),
            PROMPTS,
            self.stop,
        )
        self.server = McpServer(self.served, self.errands)

    def stop(self) -> str:
        """Stop the robot."""
        self.stops += 1
        return "stopped"

    @contextlib.asynccontextmanager
    async def client(self, mode: str, person: Any = None, **more: Any) -> Any:
        """A client of this protocol; without a person it cannot ask one."""
        async with Client(
            self.server.server, mode=mode, elicitation_callback=person, **more
        ) as made:
            yield made


def run(test: Any) -> None:
    """Run a test's coroutine, with an end."""

    async def bounded() -> None:
        async with asyncio.timeout(30.0):
            await test

    asyncio.run(bounded())
