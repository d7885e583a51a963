"""What a guest asks for, done: a conversation from its opening to its end, awaited.

Who waits and is cancelled has the agent cancel it, too. For one event loop. Must not know: by which
protocol programs come in.
"""

import asyncio
import itertools
from collections.abc import Awaitable, Callable
from typing import Any

import msgspec

from agent_runtime.io.guests import Answer, Visit
from fipa_codec.performatives import Performative
from operate.guests.offers import Offer
from operate.system import System

ANSWER_S = 15.0
"""Longest wait for the first word; estimate: an agent that was killed is back within seconds."""
KEPT = 50
"""Errands that are remembered after their end (estimate)."""


class NoAnswerError(Exception):
    """An agent does not answer."""


class Errand(msgspec.Struct):
    """Something asked for. `state`: the last act of the agent, "" before one; `said`: the last
    content, `words`: that in a few words; `plan`: the newest steps that were told.
    """

    id: str
    name: str
    arguments: dict[str, Any]
    state: str = ""
    words: str = ""
    said: Any = None
    plan: Any = None
    ended: bool = False
    cancelled: bool = False

    @property
    def done(self) -> bool:
        """Whether what was asked for was done, or told."""
        good = (Performative.INFORM, Performative.INFORM_REF)
        return self.ended and not self.cancelled and self.state in good


class Errands:
    """All errands of a guest. `changed` is called in the loop after each word of an agent."""

    def __init__(self, system: System, visit: Visit, changed: Callable[[], None]) -> None:
        self._system, self._visit, self._changed = system, visit, changed
        self._numbers = itertools.count(1)
        self._ending = set[asyncio.Task[None]]()
        self._open = dict[str, str]()  # errand -> conversation
        self.all: dict[str, Errand] = {}

    async def do(
        self,
        offer: Offer,
        content: msgspec.Struct,
        told: Callable[[Errand], Awaitable[None]] | None = None,
        begun: Callable[[Errand], None] | None = None,
    ) -> Errand:
        """Ask, and wait for the end. `begun` gets it once it can be cancelled, `told` each state
        on the way. Raise NoAnswerError.

        Where the waiting is cancelled, so is what was asked for.
        """
        loop, heard = asyncio.get_running_loop(), asyncio.Queue[Answer]()
        errand = Errand(f"{offer.name}-{next(self._numbers)}", offer.name, plain(content))
        if not offer.question:
            self._remember(errand)

        def answered(answer: Answer) -> None:
            loop.call_soon_threadsafe(heard.put_nowait, answer)

        asking = asyncio.to_thread(self._visit.ask, offer.use, offer.act, content, answered)
        opening = loop.create_task(asking)
        try:
            self._open[errand.id] = await asyncio.shield(opening)
            if begun is not None:
                begun(errand)
            while not errand.ended:
                async with asyncio.timeout(None if errand.state else ANSWER_S):
                    answer = await heard.get()
                self._take(errand, answer)
                if told is not None and not errand.ended:
                    await told(errand)
        except TimeoutError:
            self.cancel(errand)
            errand.ended = True
            raise NoAnswerError(
                f"{offer.agent} does not answer within {ANSWER_S:g} s; see `roco status`"
            ) from None
        except asyncio.CancelledError:
            ending = loop.create_task(self._called_off(errand, opening, heard))
            self._ending.add(ending)
            ending.add_done_callback(self._ending.discard)
            raise
        self._open.pop(errand.id, None)
        return errand

    def cancel(self, errand: Errand) -> None:
        """Have the agent cancel it. Who waits for its end hears that."""
        if errand.id in self._open:
            self._visit.cancel(self._open[errand.id])

    def give_up(self) -> None:
        """Cancel all that goes on: who asked for it is gone."""
        for talk in self._open.values():
            self._visit.cancel(talk)
        self._open.clear()

    async def _called_off(
        self, errand: Errand, opening: asyncio.Task[str], heard: asyncio.Queue[Answer]
    ) -> None:
        """Cancel it, also where it is just being opened: the thread that does that goes on. Hear
        what becomes of it, for who looks at all errands.
        """
        self._visit.cancel(await opening)
        self._open.pop(errand.id, None)
        while not errand.ended:
            self._take(errand, await heard.get())

    def _take(self, errand: Errand, answer: Answer) -> None:
        errand.state, errand.ended = str(answer.performative), answer.ended
        errand.cancelled = answer.cancelled
        if answer.content is not None:
            errand.said = plain(answer.content)
            errand.words = self._system.words(answer.content)
            errand.plan = errand.said.get("steps") or errand.plan
        self._changed()

    def _remember(self, errand: Errand) -> None:
        self.all[errand.id] = errand
        over = [one.id for one in self.all.values() if one.ended][: max(0, len(self.all) - KEPT)]
        for one in over:
            del self.all[one]
        self._changed()


def plain(content: Any) -> Any:
    """A content in plain values, each field by its name, also where it travels without names."""
    if isinstance(content, msgspec.Struct):
        tag = content.__struct_config__.tag
        found: dict[str, Any] = {} if tag is None else {"type": tag}
        for field in msgspec.structs.fields(content):
            if (value := getattr(content, field.name)) != field.default:
                found[field.encode_name] = plain(value)
        return found
    if isinstance(content, dict):
        return {str(name): plain(value) for name, value in content.items()}
    if isinstance(content, list | tuple):
        return [plain(one) for one in content]
    return msgspec.to_builtins(content)
