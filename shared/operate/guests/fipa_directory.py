"""Our agents in the directory facilitator of another platform (SC00023K, 4.1), as long as a gateway
serves them: register, deregister; answers are told.

The contents are in SL0, as JADE's directory reads and answers them.
"""

import asyncio
import secrets
from collections.abc import Iterator

from fipa_codec.acl_string import AclMessage, Aid, render_aid
from fipa_codec.performatives import Performative as P
from operate.guests.fipa_gateway import Gateway, Told
from topdown.model.design import Design
from topdown.model.elements import Guest

ONTOLOGY, LANGUAGE, PROTOCOL = "fipa-agent-management", "fipa-sl0", "fipa-request"
LEAVE_S = 2.0
"""Longest wait for answers to deregister (estimate: they take milliseconds)."""


class Directory:
    """One directory: `df` with its address."""

    def __init__(self, df: Aid, gateway: Gateway, design: Design, guest: Guest, told: Told) -> None:
        self._df, self._gateway, self._told = df, gateway, told
        self._entries = dict(_entries(design, guest, gateway.names))
        self._answered = asyncio.Event()
        self._waiting = set[str]()
        self._loop = asyncio.get_running_loop()

    def register(self) -> None:
        """Have each agent registered."""
        for agent, entry in self._entries.items():
            self._ask("register", agent, entry)

    async def deregister(self) -> None:
        """Have each agent deregistered, and wait a moment for the answers."""
        self._answered.clear()
        for agent, aid in self._gateway.names.items():
            entry = f"(df-agent-description :name {render_aid(aid)})"
            self._ask("deregister", agent, entry)
        try:
            async with asyncio.timeout(LEAVE_S):
                await self._answered.wait()
        except TimeoutError:
            self._told("directory", directory=self._df.name, act="no answer")

    def _ask(self, what: str, agent: str, entry: str) -> None:
        conversation = f"df-{secrets.token_hex(6)}"
        self._waiting.add(conversation)

        def answered(message: AclMessage) -> None:
            # a failure `already-registered` is of a life that was killed
            act, content = str(message.performative), str(message.content or "")
            self._told("directory", directory=self._df.name, what=what, receiver=agent, act=act,
                       content=content)  # fmt: skip
            self._loop.call_soon_threadsafe(self._over, conversation, message.performative)

        self._gateway.ask(
            self._df,
            AclMessage(
                performative=P.REQUEST,
                sender=self._gateway.names[agent],
                receiver=(self._df,),
                content=f"((action {render_aid(self._df)} ({what} {entry})))",
                language=LANGUAGE,
                ontology=ONTOLOGY,
                protocol=PROTOCOL,
                conversation_id=conversation,
                reply_with=f"{conversation}-1",
            ),
            answered,
        )

    def _over(self, conversation: str, act: P) -> None:
        if act is not P.AGREE:
            self._waiting.discard(conversation)
        if not self._waiting:
            self._answered.set()


def _entries(design: Design, guest: Guest, names: dict[str, Aid]) -> Iterator[tuple[str, str]]:
    """Each agent and its df-agent-description: what it may be asked for are its services."""
    for agent, aid in names.items():
        services, protocols, languages = list[str](), list[str](), list[str]()
        for row in (row for row in guest.use if row.agent == agent):
            use = design.guest_uses[row.name]
            protocols.append(f"fipa-{use.follows}")
            languages.append(use.message[0].language)
            kind, lists = row.like or row.name, _lists(protocols[-1:], languages[-1:])
            services.append(f"(service-description :name {row.name} :type {kind} {lists})")
        yield (
            agent,
            f"(df-agent-description :name {render_aid(aid)}"
            f" :services (set {' '.join(services)}) {_lists(protocols, languages)})",
        )


def _lists(protocols: list[str], languages: list[str]) -> str:
    def in_order(names: list[str]) -> str:
        return " ".join(dict.fromkeys(names))

    return f":protocols (set {in_order(protocols)}) :languages (set {in_order(languages)})"
