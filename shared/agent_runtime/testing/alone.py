"""One agent by itself, for tests: its peers' words go in, what it says comes out, and time is
pretended.

The peers hold real conversations, so whatever the agent says out of sequence raises; they receipt
at once and never say anything by themselves. A whole fleet in memory is
agent_runtime.testing.memory_bus.
"""

from typing import Any

from agent_runtime.core.agent import Agent
from agent_runtime.core.events import (
    AnyEvent,
    Arrived,
    Effects,
    Local,
    LogLine,
    Next,
    PeerChanged,
    Receipted,
    Started,
    Tick,
)
from agent_runtime.core.step import Core
from agent_runtime.core.wiring import Delivery, Wiring
from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative


class Alone:
    """`said`: every communicate, newest last; `told`: words for its devices; `logs`; `state`,
    `memory`: where it is.
    """

    def __init__(self, agent: Agent[Any], wiring: Wiring, *, now: float = 1_000_000.0) -> None:
        """Start the agent with all its peers there."""
        self.wiring, self.now = wiring, now
        self.said: list[Communicate] = []
        self.told: list[Any] = []
        self.logs: list[LogLine] = []
        self.talks: dict[str, Conversation] = {}
        self._core, self._numbers = Core(agent, wiring), dict.fromkeys(wiring.peers, 0)
        self._state = self._core.boot(None)
        self._wake_at: float | None = None
        self._happen(Started())
        for peer in wiring.peers:
            self._happen(PeerChanged(peer, 1))

    @property
    def state(self) -> str:
        return self._state.state

    @property
    def memory(self) -> Any:
        return self._state.memory

    @property
    def waiting(self) -> int:
        """Entries of its inbox that it has not taken."""
        return len(self._state.soft.inbox)

    def ask(
        self, peer: str, protocol: str, performative: Performative, content: Any = None, **more: Any
    ) -> str:
        """Open a conversation as `peer`; its id. `more` as for Conversation.send: reply_by ..."""
        link = self.wiring.required(peer, protocol)
        name = f"{peer}-1-{len(self.talks) + 1}"
        self.talks[name] = Conversation.open(
            protocol, link.role.other, id=name, me=peer, peer=self.wiring.agent
        )
        self.answer(name, performative, content, **more)
        return name

    def answer(
        self, conversation: str, performative: Performative, content: Any = None, **more: Any
    ) -> None:
        """Say something as the peer of an open conversation."""
        talk = self.talks[conversation]
        link = self.wiring.required(talk.me, talk.protocol)
        language = None if content is None else self.wiring.language(content)
        if link.delivery is Delivery.DURABLE:
            self._numbers[talk.me] += 1
        number = (
            self._numbers[talk.me]
            if link.delivery is Delivery.DURABLE
            else f"{talk.me}-1-{len(self.said)}"
        )
        self.talks[conversation], communicate = talk.send(
            performative,
            id=str(number),
            now=self.now,
            content=None if language is None else language.encode(content),
            language=language.name if language else link.silent,
            kind=language.kind(content) if language else Kind.PLAIN,
            **more,
        )
        self._happen(Arrived(communicate))

    def post(self, content: Any) -> None:
        """A word of its own side."""
        self._happen(Local(content))

    def wait(self, seconds: float) -> None:
        """Let time pass; whatever is due happens on the way."""
        end = self.now + seconds
        while self._wake_at is not None and self._wake_at <= end:
            self.now = max(self.now, self._wake_at)
            self._happen(Tick())
        self.now = end

    def seen(self, peer: str, incarnation: int) -> None:
        """A peer appears: as a new life, or the same one again, as after an outage of the
        router.
        """
        self._happen(PeerChanged(peer, incarnation))

    def answers(self, conversation: str) -> tuple[Performative, ...]:
        """The acts the agent has said in a conversation."""
        return tuple(one.performative for one in self.said if one.conversation == conversation)

    def content(self, communicate: Communicate) -> Any:
        return self.wiring.languages.read(communicate)[0]

    def _happen(self, event: AnyEvent) -> None:
        pending: list[AnyEvent] = [event]
        while pending:
            self._state, effects = self._core.step(self._state, pending.pop(0), self.now)
            self._wake_at = effects.wake_at
            self.logs += effects.logs
            self.told += effects.tells
            pending += [*self._receipts(effects), *([Next()] if effects.more else [])]

    def _receipts(self, effects: Effects) -> list[AnyEvent]:
        """Hear what it says, once; durable words are receipted."""
        receipts: list[AnyEvent] = []
        for communicate in effects.sends:
            link = self.wiring.required(communicate.receiver, communicate.protocol)
            if communicate in self.said:
                continue
            self.said.append(communicate)
            talk = self.talks.get(communicate.conversation) or Conversation.answering(
                communicate, link.peer
            )
            _, kind = self.wiring.languages.read(communicate)
            self.talks[communicate.conversation] = talk.receive(communicate, kind)
            if link.delivery is Delivery.DURABLE:
                receipts.append(Receipted(link.peer, int(communicate.id)))
        return receipts
