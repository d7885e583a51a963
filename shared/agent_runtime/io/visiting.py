"""The device of an agent that is a guest of an included system: it carries the agent's words there,
and the answers back (agent_runtime.core.outside).

A conversation that the other side has forgotten would never end. So, while one is open, the device
looks whether the agent there lives on under the same incarnation, and says GuestLost where it does
not: within LOOK_S, where another life took its place; within LOOKS times LOOK_S and SEEN_S, where
nothing answers.
"""

import threading
from collections.abc import Callable
from contextlib import suppress
from queue import Empty
from typing import Any, NamedTuple

import msgspec
import zenoh

from agent_runtime.core.outside import GuestHears, GuestLeaves, GuestLost, GuestSays
from agent_runtime.io.devices import Post
from agent_runtime.io.guests import Answer, Visit
from agent_runtime.io.inbox import OneReaderEvent, OneReaderQueue
from fipa_codec.errors import FipaError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from topdown.model.design import Design

LOOK_S = 1.0
"""Between two looks at who lives (estimate: a person does not wait much longer either)."""
LOOKS = 3
"""Looks without an answer after which an agent counts as dead: a killed one is back within seconds,
under another incarnation, and the router may be away for a moment (estimate).
"""


class Open(NamedTuple):
    """A conversation: its name, the visit that has it, the agent there, and by what it lives."""

    name: str
    visit: Visit
    agent: str
    life: str


class Visiting:
    """`name`: of the include; `design`: the included one. `visit` opens a visit of the system as
    it runs now, or raises OSError with what is wrong.
    """

    busy = False

    def __init__(self, post: Post, name: str, design: Design, visit: Callable[[], Visit]) -> None:
        self._post, self._name, self._design, self._find = post, name, design, visit
        self._words = OneReaderQueue[GuestSays | GuestLeaves | None]()
        self._lock = threading.RLock()
        self._visit: Visit | None = None
        self._open: dict[str, Open] = {}
        self._unseen: dict[str, int] = {}
        self._ends = OneReaderEvent()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def tell(self, content: GuestSays | GuestLeaves) -> None:
        """Take a word of the agent."""
        self._words.put(content)

    def close(self) -> None:
        """Leave."""
        self._ends.set()
        self._words.put(None)
        self._thread.join()
        self._leave()

    def visit(self) -> Visit:
        """The visit, opened where there is none. Raise OSError."""
        with self._lock:
            if self._visit is None:
                self._visit = self._find()
            return self._visit

    def renew(self) -> None:
        """Look for the system anew, unless a conversation is open, which finds out by itself."""
        if not self._open:
            self._leave()

    def _leave(self) -> None:
        """End the visit; the next one finds the system where it runs then."""
        with self._lock:
            visit, self._visit = self._visit, None
        if visit is not None:
            visit.close()

    def _run(self) -> None:
        while True:
            try:
                word = self._words.get(LOOK_S if self._open else None)
            except Empty:
                self._look()
                continue
            if word is None:
                return
            if isinstance(word, GuestLeaves):
                with self._lock:
                    if (one := self._open.get(word.use)) and one.name == word.conversation:
                        del self._open[word.use]
                        one.visit.forget(one.name)
                # who is not there has forgotten it
                with suppress(OSError, FipaError, zenoh.ZError):
                    self.visit().call_off(self._there(word.use), word.conversation)
            elif word.act is P.CANCEL:
                if (one := self._open.get(word.use)) is not None and one.name == word.conversation:
                    one.visit.cancel(one.name)
            else:
                self._begin(word)

    def _begin(self, word: GuestSays) -> None:
        use = self._there(word.use)
        agent = self._design.guest_uses[use].participant
        try:
            visit = self.visit()
            if not (life := self._life(visit, agent)):
                raise OSError(f"{agent} of {self._name} does not live")
            with self._lock:  # the answer may be here before the name is kept
                self._open[word.use] = Open(word.conversation, visit, agent, life)
                visit.ask(use, word.act, word.content, self._hearer(word), word.conversation)
        except (OSError, FipaError, zenoh.ZError) as error:
            self._open.pop(word.use, None)
            self._leave()
            self._post(GuestLost(word.use, word.conversation, str(error)))

    def _life(self, visit: Visit, agent: str) -> str:
        """By what the agent lives; one that was just killed has some time to come back."""
        for _ in range(LOOKS):
            if life := visit.lives(agent):
                return life
            if self._ends.wait(LOOK_S):
                break
        return ""

    def _hearer(self, word: GuestSays) -> Callable[[Answer], None]:
        def heard(answer: Answer) -> None:
            with self._lock:
                one = self._open.get(word.use)
                if one is None or one.name != word.conversation:
                    return
                if answer.ended:
                    del self._open[word.use]
            if answer.performative is P.NOT_UNDERSTOOD:
                why = f"{one.agent} of {self._name} did not understand: {answer.content}"
                self._post(GuestLost(word.use, word.conversation, why))
                return
            on_the_way = answer.performative is P.INFORM and not answer.ended
            kind = Kind.PROGRESS if on_the_way else Kind.PLAIN
            kind = Kind.CANCEL if answer.cancelled else kind
            content: Any = msgspec.to_builtins(answer.content)
            told = GuestHears(word.use, word.conversation, answer.performative, kind, content)
            self._post(told)

        return heard

    def _look(self) -> None:
        for use, one in tuple(self._open.items()):
            try:
                life = one.visit.lives(one.agent)
            except zenoh.ZError:
                life = ""
            if life == one.life:
                self._unseen.pop(use, None)
                continue
            unseen = self._unseen[use] = self._unseen.get(use, 0) + 1
            if not life and unseen < LOOKS:
                continue
            self._unseen.pop(use)
            with self._lock:
                lost = self._open.pop(use, None)
            if lost is None:  # it ended meanwhile
                continue
            one.visit.forget(one.name)
            self._leave()
            why = f"{one.agent} of {self._name} " + ("began anew" if life else "is not there")
            self._post(GuestLost(use, one.name, why))

    def _there(self, use: str) -> str:
        """The use as the included design has it."""
        return use.removeprefix(f"{self._name}.")
