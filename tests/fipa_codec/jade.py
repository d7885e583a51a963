"""JADE's three initiators, by ACL text: as 4.6.5 was observed on loopback (2026-11-22), and as its
source has them.

What one says is text as JADE prints it, what it is told is read by its parameters. Each keeps a
session for each reply-with it sent, and finds it by in-reply-to; all else it logs as
OUT-OF-SEQUENCE, and never answers.
"""

import re
from typing import ClassVar

from fipa_codec.acl_string import AclMessage, Aid, At, parse
from fipa_codec.acl_string.message import print_date
from fipa_codec.performatives import Performative as P

ME = Aid(name="buyer@lab:1099/JADE", addresses=("http://lab:7778/acc",))
INIT, AGREED, LIVE, OVER = "init", "agreed", "live", "over"
Rows = dict[tuple[str, P], str]


def rows(state: str, to: str, *acts: P) -> Rows:
    """Transitions of a session."""
    return {(state, act): to for act in acts}


WHITE = "".join(map(chr, range(33)))
"""Characters removed by Java's trim()."""


# --- its codec ------------------------------------------------------------------------------------


def quoted(text: str) -> str:
    """A string; a backslash at its end is not escaped."""
    return '"' + text.replace('"', '\\"') + '"'


def expression(text: str) -> str:
    """Bare where it is a word or what Java takes for a double."""
    word = re.fullmatch(r'[^\x00-\x20()"#0-9\-][^\x00-\x20()"]*', text)
    return text if word or re.fullmatch(r"[+-]?\d+(\.\d*)?[dDfF]?", text) else quoted(text)


def as_jade(message: AclMessage) -> str:
    """Return the message as JADE prints it: act in capitals, two blanks, content trimmed, what is
    empty left out.
    """

    def aid(one: Aid) -> str:
        addresses = f" :addresses (sequence {' '.join(one.addresses)} )" if one.addresses else ""
        return f"( agent-identifier :name {one.name} {addresses})"

    def several(aids: tuple[Aid, ...]) -> str:
        return f"(set {' '.join(map(aid, aids))} )" if aids else ""

    def expressions(*fields: str) -> dict[str, str]:
        found = {field: getattr(message, field) for field in fields}
        return {f"  :{name}": f"{expression(text)} " for name, text in found.items() if text}

    content = message.content.strip(WHITE) if isinstance(message.content, str) else ""
    parts = {
        " :sender": aid(message.sender) if message.sender else "",
        " :receiver": several(message.receiver),
        " :reply_to": several(message.reply_to),
        " :content": f"{quoted(content)} " if content else "",
        **expressions("reply_with", "in_reply_to", "encoding", "language", "ontology"),
        "  :reply_by": f"{print_date(message.reply_by)} " if message.reply_by else "",
        "  :protocol": f"{message.protocol} " if message.protocol else "",
        **expressions("conversation_id"),
    }
    standard = [f"{name.replace('_', '-')}  {text}" for name, text in parts.items() if text]
    own = [f"  :{name} {expression(text)}" for name, text in message.user.items() if text]
    return "\n".join([f"({message.performative.upper()}", *standard, *own, ")"])


# --- its initiators -------------------------------------------------------------------------------


class Initiator:
    """Sessions by reply-with. `heard`: acts it took, by sender; `lost`: those it logged as
    OUT-OF-SEQUENCE.

    `clock_ms` stands still unless the test moves it: labels have its milliseconds, so they repeat
    within one.
    """

    takes: ClassVar[Rows] = {}

    def __init__(
        self, protocol: str, opening: P, responders: tuple[Aid, ...], reply_by: At | None = None
    ) -> None:
        self.protocol, self.opening = protocol, opening
        self.responders, self.reply_by = responders, reply_by
        self.clock_ms = 1_763_900_000_000
        self.sessions: dict[str, str] = {}
        self.heard: dict[str, list[P]] = {one.name: [] for one in responders}
        self.lost: list[P] = []

    def opens(self) -> list[tuple[str, str]]:
        """Texts to each responder, by its name: all in one conversation."""
        return [(to.name, self.begins(self.opening, to, n)) for n, to in enumerate(self.responders)]

    def begins(self, act: P, to: Aid, number: int, **fields: str) -> str:
        """A message with a session of its own."""
        label = f"R{self.clock_ms}_{number}"
        self.sessions[label] = INIT
        return self.says(act, to, reply_with=label, reply_by=self.reply_by, **fields)

    def says(self, act: P, to: Aid, **fields: object) -> str:
        """Text of one message."""
        fields |= {"content": "(go)", "language": "fipa-sl0", "protocol": self.protocol}
        fields |= {"conversation_id": "C12_1763900000000", "receiver": (to,)}
        return as_jade(AclMessage(performative=act, sender=ME, **fields))

    def hears(self, text: bytes) -> None:
        """Take a text, if it is of a session and in sequence there."""
        message = parse(text)
        label = message.in_reply_to or ""
        state = self.takes.get((self.sessions.get(label, ""), message.performative))
        if state is None or message.receiver != (ME,):
            self.lost.append(message.performative)
            return
        self.sessions[label] = state
        if state == OVER:
            del self.sessions[label]
        assert message.sender is not None
        self.heard[message.sender.name].append(message.performative)


class AchieveREInitiator(Initiator):
    """Of fipa-request, fipa-query: the first inform is the result, what follows is lost."""

    takes: ClassVar[Rows] = {
        **rows(INIT, AGREED, P.AGREE),
        **rows(INIT, OVER, P.REFUSE, P.NOT_UNDERSTOOD, P.INFORM, P.FAILURE),
        **rows(AGREED, OVER, P.INFORM, P.FAILURE),
    }


class SubscriptionInitiator(Initiator):
    """Of fipa-subscribe: a failure is one more notification; a cancel has the subscription's
    reply-with, or none.
    """

    takes: ClassVar[Rows] = {
        **rows(INIT, AGREED, P.AGREE),
        **rows(INIT, OVER, P.REFUSE, P.NOT_UNDERSTOOD),
        **rows(INIT, LIVE, P.INFORM, P.FAILURE),
        **rows(AGREED, LIVE, P.INFORM, P.FAILURE),
        **rows(LIVE, LIVE, P.INFORM, P.FAILURE),
    }

    def cancels(self, to: Aid, *, ignores: bool) -> str:
        """A cancel; with `ignores` its session is over at once, and nothing asks for an answer."""
        (label,) = self.sessions
        if ignores:
            del self.sessions[label]
        return self.says(P.CANCEL, to) if ignores else self.says(P.CANCEL, to, reply_with=label)

    def cancellation_completed(self) -> None:
        """Take the call of its program, made once it has seen that a notification was the answer to
        its cancel.
        """
        self.sessions.clear()


class ContractNetInitiator(Initiator):
    """Of fipa-contract-net: each accept-proposal has a new reply-with and a new session, which its
    result must name.

    The proposals it chooses are accepted when all have answered, the others rejected.
    """

    takes = rows(INIT, OVER, P.PROPOSE, P.REFUSE, P.NOT_UNDERSTOOD, P.FAILURE)
    results = rows(INIT, OVER, P.INFORM, P.NOT_UNDERSTOOD, P.FAILURE)

    def __init__(
        self, responders: tuple[Aid, ...], chosen: frozenset[str], reply_by: At | None = None
    ) -> None:
        super().__init__("fipa-contract-net", P.CFP, responders, reply_by)
        self.chosen = chosen

    def decides(self) -> list[tuple[str, str]]:
        """Texts to each that proposed; whoever has not answered by now (its time-out) is passed
        over.
        """
        self.sessions.clear()
        self.takes = self.results
        proposed = [one for one in self.responders if self.heard[one.name] == [P.PROPOSE]]
        accepted = [one for one in proposed if one.name in self.chosen]
        label = f"{ME.name}{self.clock_ms}"
        texts = {
            one.name: self.begins(P.ACCEPT_PROPOSAL, one, number)
            for number, one in enumerate(accepted)
        }
        for one in proposed:
            if one not in accepted:
                texts[one.name] = self.says(P.REJECT_PROPOSAL, one, reply_with=label)
        return list(texts.items())
