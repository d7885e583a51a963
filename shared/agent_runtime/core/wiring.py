"""Wiring of one agent: for each peer and protocol the channel, the role, the delivery and the
languages.

The design file of a system has all this; agent_runtime.core.binding builds the Wiring from it, so
the runtime imports no system. Key expressions:
`roco/<system>/<channel>/<sender>/<receiver>/<protocol>/<performative>` for communicates,
`roco/<system>/_/<kind>/<owner>[/<peer>]` for other traffic (receipts, pings, liveliness).
"""

from collections.abc import Collection
from enum import StrEnum
from functools import cached_property
from typing import Any

import msgspec

from fipa_codec.communicate import WORD, Communicate, is_word, number_of
from fipa_codec.errors import ContentError, LocalProtocolError
from fipa_codec.languages import Language, Languages
from fipa_codec.performatives import Performative
from fipa_codec.protocols import named
from fipa_codec.tables import Role


class Delivery(StrEnum):
    """Delivery guarantee for the communicates of a protocol on a channel."""

    DURABLE = "durable"
    """Numbered stream: taken once, in order, whatever dies (requests, cancels, reports)."""
    VOLATILE = "volatile"
    """Asked again until answered; the answer is a pure function (queries)."""
    LATEST = "latest"
    """The opening is volatile; of the informs each subject's newest is kept until receipted
    (observations).
    """


class Link(msgspec.Struct, frozen=True):
    """This agent's side of one protocol with one peer; `silent`: the language named by acts without
    content.

    `use`: the name the design gives to this use of the protocol, "" where there is no design.
    `awaited`: the agent is ready only when this peer has answered; false for a group, whose end
    nobody of this design runs.

    `says`, `hears`: the interface: LANGUAGE.Class of each content an act may have, () for an act
    without content. Empty tables: not checked (toys).
    """

    peer: str
    channel: str
    protocol: str
    role: Role
    delivery: Delivery
    ontology: str = ""
    silent: str = ""
    use: str = ""
    awaited: bool = True
    says: dict[Performative, tuple[str, ...]] = {}
    hears: dict[Performative, tuple[str, ...]] = {}

    def require_said(self, performative: Performative, content: str) -> None:
        """Raise LocalProtocolError if the interface lacks this act, or this content for it
        (LANGUAGE.Class or "").
        """
        fits = content in self.says.get(performative, ())
        wrong = None if fits else _misfit(self.says, performative, content)
        if wrong is not None:
            raise LocalProtocolError(
                wrong[0], f"{self.protocol} with {self.peer!r} on {self.channel}: {wrong[1]}"
            )

    def require_heard(self, performative: Performative, content: str) -> None:
        """Raise ContentError likewise, for messages of the peer, and where an opening lacks its
        content.
        """
        fits = content in self.hears.get(performative, ())
        wrong = None if fits else _misfit(self.hears, performative, content)
        wanted = self.hears.get(performative)
        if not (wrong or content) and wanted and performative in named(self.protocol).openings:
            wrong = "content", f"{performative} has none; it carries {', '.join(wanted)}"
        if wrong is not None:
            raise ContentError(
                wrong[0], f"{self.protocol} of {self.peer!r} on {self.channel}: {wrong[1]}"
            )


def _misfit(
    table: dict[Performative, tuple[str, ...]], act: Performative, content: str
) -> tuple[str, str] | None:
    """Field and reason, None if it fits. An act with contents may also come without: the tables
    decide that.
    """
    if not table:
        return None
    if act not in table:
        return "performative", f"{act} is not in the design; there are {', '.join(sorted(table))}"
    if content and content not in table[act]:
        carried = ", ".join(table[act]) or "nothing"
        return "content", f"{act} does not carry {content}; it carries {carried}"
    return None


class Wiring(msgspec.Struct, frozen=True, dict=True):
    """All links of `agent` in `system`, and the system's languages. Raises LocalProtocolError for
    an invalid name.

    `guests`: guests of the design that may speak to it -> the channel of each. They are no peers:
    what they say reaches a door of the agent's process, not its inbox (agent_runtime.io.guests).
    """

    system: str
    agent: str
    links: tuple[Link, ...]
    languages: Languages
    guests: dict[str, str] = {}

    def __post_init__(self) -> None:
        """Raise LocalProtocolError for names that cannot stand in a communicate or an address."""
        links = [("peer", link.peer) for link in self.links] + [
            ("protocol", link.protocol) for link in self.links
        ]
        links += [("ontology", link.ontology) for link in self.links if link.ontology]
        for field, name in [("agent", self.agent), *links]:
            if not is_word(name):
                raise LocalProtocolError(field, f"cannot be named {name!r}, must match {WORD}")

    @cached_property
    def _by_peer(self) -> dict[tuple[str, str], Link]:
        return {(link.peer, link.protocol): link for link in self.links}

    @cached_property
    def _by_class(self) -> dict[type, tuple[Language, str]]:
        named = [self.languages.named(name) for name in self.languages.names]
        kinds = ((language, kind) for language in named for kind in language.classes)
        return {kind: (spoken, f"{spoken.name}.{kind.__name__}") for spoken, kind in kinds}

    @cached_property
    def peers(self) -> tuple[str, ...]:
        return tuple(sorted({link.peer for link in self.links}))

    def link(self, peer: str, protocol: str) -> Link | None:
        """The link, or None where the design has none."""
        return self._by_peer.get((peer, protocol))

    def required(self, peer: str, protocol: str) -> Link:
        """The link. Raises LocalProtocolError, which lists those there are."""
        link = self._by_peer.get((peer, protocol))
        if link is None:
            known = ", ".join(f"{p}:{name}" for p, name in self._by_peer)
            raise LocalProtocolError(
                "protocol", f"{self.agent!r} has no {protocol!r} with {peer!r}, it has {known}"
            )
        return link

    def language(self, content: Any) -> Language:
        """The language of a content's class. Raises LocalProtocolError if it has none."""
        return self.spoken(content)[0]

    def spoken(self, content: Any) -> tuple[Language, str]:
        """The language, and LANGUAGE.Class, as the interfaces of a design name it."""
        found = self._by_class.get(type(content))
        if found is None:
            raise LocalProtocolError(
                "content", f"{type(content).__name__} belongs to none of {self.languages.names}"
            )
        return found

    def key(self, communicate: Communicate) -> str:
        """The key expression on which this agent puts a communicate."""
        link = self.required(communicate.receiver, communicate.protocol)
        system, channel = self.system, link.channel
        performative = communicate.performative
        return communicate_key(system, channel, self.agent, link.peer, link.protocol, performative)

    @cached_property
    def groups(self) -> frozenset[str]:
        """The peers that are groups, not agents. A process that speaks for a group is connected to
        the router.
        """
        return frozenset(link.peer for link in self.links if not link.awaited)

    def inbox_keys(self, peers: Collection[str]) -> tuple[str, ...]:
        """The key expressions on which this agent hears these peers, one per channel and peer."""
        pairs = sorted({(link.channel, link.peer) for link in self.links if link.peer in peers})
        return tuple(
            f"roco/{self.system}/{channel}/{peer}/{self.agent}/*/*" for channel, peer in pairs
        )


def communicate_key(
    system: str, channel: str, sender: str, receiver: str, protocol: str, performative: Performative
) -> str:
    return f"roco/{system}/{channel}/{sender}/{receiver}/{protocol}/{performative}"


def life(incarnation: int, journal: str) -> str:
    """The last chunk of a liveliness token's key: which life of the agent, by the name of its
    journal.
    """
    return f"{incarnation}.{journal}" if journal else str(incarnation)


def parse_life(chunk: str) -> tuple[int, str] | None:
    """Incarnation and journal from the last chunk of a token's key; None where it is none."""
    text, _, journal = chunk.partition(".")
    number = number_of(text)
    return None if number is None else (number, journal)


HOUSE = "_"
"""Chunk of a key that is not a communicate's, in the place of the channel."""


def service_key(system: str, kind: str, owner: str, *peer: str) -> str:
    """The key of the runtime's own messages: `alive`, `receipt`, `ping`, `pong`."""
    return "/".join(("roco", system, HOUSE, kind, owner, *peer))
