"""A conversation of one agent with one peer: where it stands, what may come, what may be said. No I/O, no clock.

Frozen: `receive` and `send` give a new conversation. It holds its protocol by name and nothing but words and numbers,
so it encodes into a journal and is the same when read back. Deadlines are data for whoever owns a clock.

Which use of a performative a message makes (`Kind`) comes from three places: "in reply to the cancel" from m_t; a
confirm has the kind of the message it confirms; anything else is the word of the content's language, which the caller
passes as `kind` (`Languages.read` yields it for what came in, `Language.kind` for what goes out).
"""

from typing import Self

import msgspec

from fipa_codec.communicate import LABEL, WORD, Communicate, examine, is_label, is_word
from fipa_codec.errors import LocalProtocolError, RemoteProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.protocols import named
from fipa_codec.tables import NOT_UNDERSTOOD, RECEIVE, SEND, START, Protocol, Role, Row, Table, Way

# Before Python 3.12 a member found by its class takes 0.1 us, and a message asks for some twenty.
_COMPLAINT, _CONFIRM, _CANCEL = Performative.NOT_UNDERSTOOD, Performative.CONFIRM, Performative.CANCEL
_INFORM, _FAILURE = Performative.INFORM, Performative.FAILURE
_PLAIN, _OF_CANCEL = Kind.PLAIN, Kind.CANCEL
_INITIATOR, _PARTICIPANT = Role.INITIATOR, Role.PARTICIPANT


class Conversation(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One conversation (m_c = `id`) as `me`, in `role`, sees it.

    `deadline`: reply-by of the newest message that waits for an answer, mine or the peer's [unix s], else None. It
    bounds the next message only: after an agree there is none unless a message sets one (SC00061G). A cancel's
    deadline stands until the cancel is answered. `asked`: m_w of the opening. `cancel`: m_w of the cancel, "" if there
    is none. `unconfirmed`: m_w and kind of every message that is still to be confirmed, oldest first. `past`: m_w of
    earlier rounds and of cancels that failed while the conversation went on: what bears one of them is a copy.
    """

    id: str
    protocol: str
    role: Role
    me: str
    peer: str
    state: str = START
    deadline: float | None = None
    asked: str = ""
    cancel: str = ""
    unconfirmed: tuple[tuple[str, Kind], ...] = ()
    past: tuple[str, ...] = ()

    @classmethod
    def open(cls, protocol: str | Protocol, role: Role, *, id: str, me: str, peer: str) -> Self:
        """A conversation before its first message.

        LocalProtocolError if the protocol is unknown, `id` no label, or `me` or `peer` (unless "") no word.
        """
        if not is_label(id):
            raise LocalProtocolError("conversation", f"is {id!r}, must match {LABEL}")
        if not (is_word(me) and (is_word(peer) or peer == "")):
            raise LocalProtocolError(
                "me" if is_word(peer) else "peer", f"of {me!r} and {peer!r} each must match {WORD}"
            )
        name = protocol.name if isinstance(protocol, Protocol) else named(protocol).name
        return cls(id=id, protocol=name, role=role, me=me, peer=peer)

    @classmethod
    def answering(cls, communicate: Communicate, me: str) -> Self:
        """The participant's conversation for a communicate that belongs to none it knows; `receive` it next.

        It is for openings, and for a cancel that came too late (`request`: answer failure; `coordinate`: drop it).
        RemoteProtocolError if m_c, sender or a known protocol is missing, MalformedError for a text that is no word or
        label: here the names that a peer chose get in, later messages are compared with them.
        """
        examine(communicate)
        if not (communicate.conversation and communicate.sender and communicate.protocol):
            fields = ("conversation", "sender", "protocol")
            field = next(field for field in fields if not getattr(communicate, field))
            raise RemoteProtocolError(field, f"is absent, so {me!r} cannot take part in a conversation")
        try:
            name = named(communicate.protocol).name
        except LocalProtocolError as error:
            raise RemoteProtocolError(error.field, error.reason) from error
        return cls(id=communicate.conversation, protocol=name, role=_PARTICIPANT, me=me, peer=communicate.sender)

    @property
    def table(self) -> Table:
        """The rows of my role."""
        return named(self.protocol).tables[self.role]

    @property
    def ended(self) -> bool:
        """Nothing more is to be said by me; late messages that the table allows may still come."""
        # Not by `table`, here and in `owes`: one function more on a message's way, 0.009 of a get (nine runs by turns).
        return self.state == NOT_UNDERSTOOD or self.state in named(self.protocol).tables[self.role].ended

    @property
    def owes(self) -> bool:
        """I have to send in this very step (confirm, failure in reply to a late cancel) before I take anything."""
        return self.state in named(self.protocol).tables[self.role].urgent

    def late(self, now: float) -> bool:
        """Has the deadline passed? Equal counts as in time (SC00061G)."""
        return self.deadline is not None and now > self.deadline

    def allowed(self, way: Way) -> tuple[str, ...]:
        """What I may send, or take, in this state, in words."""
        return tuple(row.word for row in self.table.allowed(self.state, way))

    def takes(self, communicate: Communicate, kind: Kind = _PLAIN) -> bool:
        """Would `receive` take it?"""
        try:
            self.receive(communicate, kind)
        except (RemoteProtocolError, LocalProtocolError):
            return False
        return True

    def receive(self, communicate: Communicate, kind: Kind = _PLAIN) -> Self:
        """The conversation after this message of the peer; `kind` is what the content's language says.

        RemoteProtocolError if it is not mine, not in sequence, or answers something never asked. LocalProtocolError
        if I owe a message first.
        """
        self._require_mine(communicate)
        if self.state == NOT_UNDERSTOOD:
            return self
        performative, reply_to = communicate.performative, communicate.in_reply_to
        if performative is _COMPLAINT:
            return self._after_not_understood(RECEIVE, reply_to)
        protocol = named(self.protocol)
        table = protocol.tables[self.role]
        if self.state in table.urgent:
            raise LocalProtocolError(
                "performative", f"{self._here} owes {', '.join(self.allowed(SEND))} before it takes"
            )
        try:
            row = self._row(table, RECEIVE, performative, self.kind_of(performative, reply_to, kind))
            self._require_answer(protocol, performative, communicate.reply_with, reply_to)
        except LocalProtocolError as error:
            raise RemoteProtocolError(error.field, error.reason) from None
        return self._after(protocol, table, row, communicate)

    def send(
        self,
        performative: Performative,
        *,
        id: str,
        now: float,
        content: msgspec.Raw | None = None,
        language: str = "",
        ontology: str = "",
        kind: Kind = _PLAIN,
        in_reply_to: str | None = None,
        reply_by: float | None = None,
    ) -> tuple[Self, Communicate]:
        """The conversation after this message of mine, and the message; `id` also is its m_w where one is wanted.

        `in_reply_to` None: what the protocol says (the opening; for a confirm the oldest unconfirmed message; the
        cancel where `kind` is CANCEL or nothing else can be answered here). LocalProtocolError if it is not allowed.
        """
        protocol = named(self.protocol)
        table = protocol.tables[self.role]
        reply_to = self._default_reply(protocol, performative, kind) if in_reply_to is None else in_reply_to
        communicate = Communicate(
            performative=performative,
            content=msgspec.UNSET if content is None else content,
            language=language,
            ontology=ontology,
            protocol=self.protocol,
            reply_by=reply_by,
            reply_with=self._label(protocol, performative, id),
            in_reply_to=reply_to,
            conversation=self.id,
            sender=self.me,
            receiver=self.peer,
            id=id,
            sent=now,
        )
        if performative is _COMPLAINT:
            return self._after_not_understood(SEND, reply_to), communicate
        row = self._row(table, SEND, performative, self.kind_of(performative, reply_to, kind))
        self._require_answer(protocol, performative, communicate.reply_with, reply_to)
        return self._after(protocol, table, row, communicate), communicate

    @property
    def _here(self) -> str:
        return f"conversation {self.id} ({self.protocol}, {self.role} {self.me!r}, state {self.state})"

    def _row(self, table: Table, way: Way, performative: Performative, kind: Kind) -> Row:
        row = table.find(self.state, way, performative, kind)
        if row is None:
            verb = "got" if way is RECEIVE else "would send"
            word = f"{performative}[{kind}]" if kind else performative
            allowed = ", ".join(self.allowed(way)) or "nothing"
            verb_allowed = "takes" if way is RECEIVE else "may send"
            raise LocalProtocolError("performative", f"{self._here} {verb} {word}; this state {verb_allowed} {allowed}")
        return row

    def kind_of(self, performative: Performative, reply_to: str, kind: Kind) -> Kind:
        """The guard word of the row. Only an inform has uses that its content tells apart."""
        if performative is _CONFIRM:
            # First: both sides number their own messages, so the confirmed one may have the label of the cancel.
            known = dict(self.unconfirmed)
            if reply_to not in known:
                expected = ", ".join(known) or "nothing"
                raise LocalProtocolError("in_reply_to", f"{self._here}: {reply_to!r} confirms none of {expected}")
            return known[reply_to]
        if reply_to and reply_to == self.cancel:
            return _OF_CANCEL
        if kind is _OF_CANCEL:
            raise LocalProtocolError("in_reply_to", f"{self._here}: is {reply_to!r}, the cancel is {self.cancel!r}")
        return kind if performative is _INFORM else _PLAIN

    def _require_mine(self, communicate: Communicate) -> None:
        """Sender, receiver, m_c and protocol stay the same throughout."""
        same_talk = communicate.conversation == self.id and communicate.protocol == self.protocol
        if same_talk and communicate.sender == self.peer and communicate.receiver == self.me:
            return  # as nearly always; else it is said what is wrong, or the protocol goes by another of its names
        names = (named(self.protocol).name, *named(self.protocol).aliases)
        checks = (
            ("conversation", communicate.conversation, (self.id,)),
            ("sender", communicate.sender, (self.peer,)),
            ("receiver", communicate.receiver, (self.me,)),
            ("protocol", communicate.protocol, names),
        )
        for field, value, wanted in checks:
            if value not in wanted:
                raise RemoteProtocolError(field, f"{self._here} got {value!r} here, wants {wanted[0]!r}")

    def _require_answer(self, protocol: Protocol, performative: Performative, reply_with: str, reply_to: str) -> None:
        """What must be answerable has its m_w, what answers names something that was asked."""
        numbered = performative is _CANCEL or performative in protocol.rounds
        if (numbered or performative in protocol.confirmed) and not is_label(reply_with):
            what = f"a {performative} needs one that matches {LABEL}, for its answer"
            raise LocalProtocolError("reply_with", f"{self._here}: {what}")
        if numbered:
            if reply_with in (*self.past, self.asked):
                raise LocalProtocolError("reply_with", f"{self._here}: {reply_with!r} was said before, this is a copy")
        elif performative in protocol.openings and self.state != START and reply_with != self.asked:
            raise LocalProtocolError("reply_with", f"{self._here}: asked again with {reply_with!r}, not {self.asked!r}")
        if reply_to in ("", self.asked, self.cancel):
            return
        if all(reply_to != label for label, _ in self.unconfirmed):
            raise LocalProtocolError("in_reply_to", f"{self._here}: {reply_to!r} was never asked here")

    def _label(self, protocol: Protocol, performative: Performative, id: str) -> str:
        """m_w: set where an answer or a confirm is to name the message; asking again keeps the first one."""
        if not is_label(id):
            raise LocalProtocolError("id", f"{self._here}: a message needs an id that matches {LABEL}, not {id!r}")
        if performative in protocol.openings and performative not in protocol.rounds:
            return self.asked or id
        if performative is _CANCEL or performative in protocol.rounds:
            return id
        return id if performative in protocol.confirmed else ""

    def _default_reply(self, protocol: Protocol, performative: Performative, kind: Kind) -> str:
        """m_t: the paper leaves it empty in request, inform and cancel of coordinate, and sets it in confirm."""
        if kind is _OF_CANCEL or (self.cancel and self._only_cancel(performative, kind)):
            return self.cancel
        if performative is _CONFIRM:
            return self.unconfirmed[0][0] if self.unconfirmed else ""
        if self.role is _INITIATOR or performative in protocol.confirmed:
            return ""
        return self.asked

    def _only_cancel(self, performative: Performative, kind: Kind) -> bool:
        find = self.table.find
        return find(self.state, SEND, performative, kind) is None and bool(
            find(self.state, SEND, performative, _OF_CANCEL)
        )

    def _after(self, protocol: Protocol, table: Table, row: Row, communicate: Communicate) -> Self:
        performative, label = communicate.performative, communicate.reply_with
        unconfirmed = self.unconfirmed
        if performative in protocol.confirmed:
            unconfirmed = (*unconfirmed, (label, row.kind))
        elif performative is _CONFIRM:
            unconfirmed = tuple(entry for entry in unconfirmed if entry[0] != communicate.in_reply_to)
        opens = performative in protocol.openings and (self.state == START or performative in protocol.rounds)
        state, deadline = str(row.to), None if row.to in table.ended else communicate.reply_by
        if deadline is None and row.to not in table.ended:
            deadline = self._next_deadline(row)
        plain = row.kind is not _OF_CANCEL and performative is not _CANCEL
        if plain and unconfirmed is self.unconfirmed and not (opens and self.asked):
            asked = label if opens else self.asked
            return msgspec.structs.replace(self, state=state, deadline=deadline, asked=asked)
        return msgspec.structs.replace(
            self,
            state=state,
            deadline=deadline,
            asked=label if opens else self.asked,
            cancel=label if performative is _CANCEL else self._cancel_after(row),
            unconfirmed=unconfirmed,
            past=self._past_after(row, opens),
        )

    def _cancel_after(self, row: Row) -> str:
        """A cancel that failed while the conversation goes on is pending no longer."""
        return "" if row.kind is _OF_CANCEL and row.to not in self.table.ended else self.cancel

    def _past_after(self, row: Row, opens: bool) -> tuple[str, ...]:
        over = self.asked if opens else self.cancel if self._cancel_after(row) != self.cancel else ""
        return (*self.past, over) if over else self.past

    def _next_deadline(self, row: Row) -> float | None:
        """Without a new one an answer clears it; what is asked again, or crosses a cancel, is no answer."""
        cancelling = bool(self.cancel) and self.role is _INITIATOR and row.kind is not _OF_CANCEL
        repeats = row.way is SEND and row.to == self.state
        return self.deadline if cancelling or repeats else None

    def _after_not_understood(self, way: Way, reply_to: str) -> Self:
        """The rule outside the tables: it ends the interaction; as answer to a cancel it is a failed cancel only."""
        if self.ended:
            return self
        if reply_to and reply_to == self.cancel:
            row = self.table.find(self.state, way, _FAILURE, _OF_CANCEL)
            if row is not None:
                cancel, past = self._cancel_after(row), self._past_after(row, opens=False)
                return msgspec.structs.replace(self, state=str(row.to), deadline=None, cancel=cancel, past=past)
        return msgspec.structs.replace(self, state=NOT_UNDERSTOOD, deadline=None, unconfirmed=())
