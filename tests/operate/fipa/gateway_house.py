"""A gateway before the doors of hi and km, in one thread: a router that hands on at once, and an
outlet that keeps what leaves. What agents answer a test says.
"""

import asyncio
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from msgspec.structs import replace

from agent_runtime.core.wiring import communicate_key, service_key
from agent_runtime.io import guests
from agent_runtime.io.guests import Asked, Door, Visit
from agent_runtime.io.journal import Journal
from companion.design import DESIGN, LANGUAGES
from fipa_codec.acl_string import AclMessage, Aid, parse, render
from fipa_codec.envelope import Envelope, pack, unpack
from fipa_codec.performatives import Performative as P
from operate.guests.fipa_gateway import Gateway, Rights
from operate.guests.fipa_http import AddressError, Reply
from topdown.model.design import Design
from topdown.model.elements import GuestUse

GUEST, SYSTEM = "platform", "x"
BUYER = Aid("buyer@lab:1099/JADE", ("http://127.0.0.1:7778/acc",))
OURS = "http://127.0.0.1:8372/acc"
HI, KM = Aid("hi@x", (OURS,)), Aid("km@x", (OURS,))
Ear = tuple[list[str], Callable[[Any], None]]


class Router:
    """Both sides of it; `said`: each key that was put."""

    def __init__(self) -> None:
        self._ears: list[Ear] = []
        self.said: list[str] = []
        self.cut = ""
        """What of keys is lost."""

    def declare_subscriber(self, key: str, on_sample: Callable[[Any], None]) -> Ear:
        """Hear a key; `*` stands for one part of it, `**` for all the rest."""
        self._ears.append((key.split("/"), on_sample))
        return self._ears[-1]

    def forget(self, ears: Sequence[Ear]) -> None:
        """Who heard so is gone."""
        self._ears = [one for one in self._ears if one not in ears]

    def put(self, key: str, data: bytes, **_: Any) -> None:
        """Hand on."""
        self.said.append(key)
        if self.cut and self.cut in key:
            return
        sample = SimpleNamespace(key_expr=key, payload=SimpleNamespace(to_bytes=lambda: data))
        for pattern, on_sample in tuple(self._ears):
            if _fits(pattern, key.split("/")):
                on_sample(sample)

    def close(self) -> None:
        """As a session."""


def _fits(pattern: list[str], key: list[str]) -> bool:
    if pattern and pattern[-1] == "**":
        pattern, key = pattern[:-1], key[: len(pattern) - 1]
    return len(pattern) == len(key) and all(
        p in ("*", k) for p, k in zip(pattern, key, strict=True)
    )


class Agent:
    """The door of one; `asked`: what reached it, `answer` is called with each."""

    def __init__(
        self, name: str, router: Router, now: Callable[[], float], design: Design = DESIGN
    ) -> None:
        self.name, self._router, self._design = name, router, design
        self.asked: list[Asked] = []
        self.answer: Callable[[Asked], None] = lambda asked: None
        self.door = Door(design, LANGUAGES, name, self, self._asked, now)  # type: ignore[arg-type]

    def _asked(self, asked: Asked) -> None:
        self.asked.append(asked)
        self.answer(asked)

    def hear_guests(self, on_data: Callable[[str, bytes], None]) -> None:
        """As a Post."""
        self._router.declare_subscriber(
            f"roco/{SYSTEM}/*/*/{self.name}/*/*",
            lambda sample: on_data(str(sample.key_expr), sample.payload.to_bytes()),
        )

    def hear(self, kind: str, on_data: Callable[[bytes], None]) -> None:
        """As a Post."""
        self._router.declare_subscriber(
            service_key(SYSTEM, kind, "*", self.name), lambda s: on_data(s.payload.to_bytes())
        )

    def publish(self, kind: str, data: bytes, *peer: str) -> None:
        """As a Post."""
        self._router.put(service_key(SYSTEM, kind, self.name, *peer), data)

    def say_to_guest(self, one: Any) -> None:
        """As a Post."""
        channel = self._design.guest_use(one.receiver, one.sender, one.protocol).channel
        self._router.put(
            communicate_key(SYSTEM, channel, one.sender, one.receiver, one.protocol,
                            one.performative),
            guests.encode(one),
        )  # fmt: skip


class House:
    """Agents, router and gateway; `left`: what the outlet took, `stops`: how often the robot was
    stopped.
    """

    def __init__(
        self,
        folder: Path,
        *,
        agreed: bool = True,
        consent: bool = True,
        more: tuple[GuestUse, ...] = (),
    ) -> None:
        """`more`: further uses of the guest."""
        self.folder, self.agreed, self.now = folder, agreed, 1e9
        self.router = Router()
        self.design = DESIGN
        if more or not consent:
            guest = DESIGN.guests[GUEST]
            uses = tuple(replace(one, consent=one.consent and consent) for one in guest.use)
            file = replace(DESIGN.file, guest=(replace(guest, use=(*uses, *more)),))
            self.design = type(DESIGN)(file, DESIGN.path, DESIGN.text, DESIGN.folder)
        self.hi, self.km = self.agent("hi"), self.agent("km")
        self.left: list[AclMessage] = []
        self.stops, self.fails, self.events = 0, 0, list[tuple[str, dict[str, Any]]]()

    def agent(self, name: str) -> Agent:
        """The door of one, in a new life."""
        return Agent(name, self.router, lambda: self.now, self.design)

    def start(self) -> None:
        """Start a gateway, with what is in its journal."""
        with patch.object(guests, "open_client", lambda *_, **__: self.router):
            self.visit = Visit(self.design, LANGUAGES, GUEST, SYSTEM, "", None)
        self.gateway = Gateway(
            self.design, LANGUAGES, Rights(GUEST, self.agreed, self.stop), self.visit, self,
            Journal(self.folder / "fipa.journal"), SYSTEM, OURS,
            lambda event, **fields: self.events.append((event, fields)), lambda: self.now,
        )  # fmt: skip
        self.gateway.begin()

    def kill(self) -> None:
        """As kill -9: nothing is said, nothing is written."""
        self.router.forget(self.visit._declared)
        for task in self.gateway._tasks:
            task.cancel()
        self.gateway._closed = True
        self.gateway._journal.close()

    def stop(self) -> str:
        """Stop the robot."""
        self.stops += 1
        return "stopped"

    # --- as an outlet -----------------------------------------------------------------------------

    async def usable(self, addresses: Sequence[str]) -> tuple[str, ...]:
        """Those on loopback."""
        found = tuple(one for one in addresses if "127.0.0.1" in one)
        if not found:
            raise AddressError("no address of this machine")
        return found

    async def post(self, addresses: Sequence[str], what: str, body: bytes) -> None:
        """Keep it; while it `fails` nobody takes it."""
        if self.fails:
            self.fails -= 1
            raise OSError("nobody is there")
        envelope, text = unpack(what, body)
        assert envelope.intended == envelope.to
        self.left.append(parse(text))

    # --- as another platform ----------------------------------------------------------------------

    async def say(self, act: P, to: Aid, conversation: str = "c1", **fields: Any) -> Reply:
        """Post a message; wait until what follows at once has left."""
        words = {"reply_with": f"{conversation}-r", "protocol": "fipa-request", **fields}
        message = AclMessage(
            performative=act, receiver=(to,), conversation_id=conversation or None,
            **{"sender": BUYER, **words},
        )  # fmt: skip
        envelope = Envelope(to=(to,), sender=message.sender or BUYER, intended=(to,))
        reply = await self.gateway.receive(*pack(envelope, render(message)))
        await self.settled()
        return reply

    async def ask(self, content: str, to: Aid = HI, conversation: str = "c1", **more: Any) -> Reply:
        """Open a conversation as JADE does: without `:encoding`."""
        words = {"language": "CMD", "content": content, **more}
        return await self.say(P.REQUEST, to, conversation, **words)

    async def query(self, content: str, conversation: str = "q1", **more: Any) -> Reply:
        """Ask km."""
        words = {"language": "WM", "content": content, "protocol": "fipa-query", **more}
        return await self.say(P.QUERY_REF, KM, conversation, **words)

    async def settled(self) -> None:
        """Until nothing waits that could leave now."""
        for _ in range(20):
            await asyncio.sleep(0)

    def acts(self, conversation: str = "c1") -> list[tuple[str, str | None]]:
        """What left in a conversation: act and in-reply-to."""
        return [
            (str(one.performative), one.in_reply_to)
            for one in self.left
            if one.conversation_id == conversation
        ]


def run(test: Any) -> None:
    """Run a test's coroutine, with an end."""

    async def bounded() -> None:
        async with asyncio.timeout(30.0):
            await test

    asyncio.run(bounded())
