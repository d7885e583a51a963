"""A conversation of one agent with one peer: its state, and which messages it allows. No I/O, no
clock.

A `Conversation` is immutable: `receive` and `send` return the next one. It has its protocol by
name, and otherwise strings and numbers only, so it can be encoded in a journal and decoded to an
equal one. Deadlines are data; the caller compares them with its clock.

The kind of a message (`Kind`) is determined in three ways: a reply to the cancel by m_t; a confirm
by the message that it confirms; any other message by the language of its content. The last one is
passed by the caller as `kind` (from `Languages.read` for received messages, from `Language.kind`
for outgoing ones).
"""

from contextlib import suppress
from enum import StrEnum
from functools import lru_cache
from typing import Self

import msgspec

from fipa_codec import deadlines
from fipa_codec.communicate import LABEL, WORD, Communicate, check_text, is_label, is_word
from fipa_codec.errors import LocalProtocolError, RemoteProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.protocols import named
from fipa_codec.tables import NOT_UNDERSTOOD, RECEIVE, SEND, START, Protocol, Role, Row, Table, Way

# --- Rules for reply-with and in-reply-to of a message: one table for agents and for judges. Pure -
# A label is what a message has as reply-with. FIPA lets any message carry one (SC00061G), and each
# may be answered as long as the conversation goes on. Both sides choose their own labels, so one
# label can stand for a message of either side. Of FIPA's protocols every label at every step is
# explored with both (tests/topdown/test_labels_explored.py).


class Needs(StrEnum):
    """Requirement on the reply-with of a message."""

    NOTHING = "nothing"
    """It may have one (SC00061G: the parameter is optional)."""
    OWN = "own"
    """It may have one, but none of an earlier round or of a failed cancel, whose copy it would
    be.
    """
    SAME = "same"
    """Said again, it has that of the first time: it is the same question."""
    ANY = "any"
    """It needs one: each of these messages is confirmed."""
    NEW = "new"
    """It may have one; a new round is not the copy of an earlier one."""


@lru_cache(maxsize=1024)
def needs(protocol: Protocol, performative: Performative) -> Needs:
    """What a message of this protocol needs; looked up once for each act, since it is asked of
    every message.

    FIPA requires a reply-with of no act (SC00061G): a cfp may have none. So may a cancel, or it has
    that of the opening it cancels: JADE's SubscriptionInitiator sends both kinds.
    """
    if performative is Performative.CANCEL:
        return Needs.OWN
    if performative in protocol.confirmed:
        return Needs.ANY
    if performative in protocol.rounds:
        return Needs.NEW
    return Needs.SAME if performative in protocol.openings else Needs.NOTHING


# --- A conversation of one agent with one peer ----------------------------------------------------


# Before Python 3.12 access to a member by its class takes 0.1 us; a message needs about twenty.
_ACT_NOT_UNDERSTOOD, _CONFIRM, _CANCEL = (
    Performative.NOT_UNDERSTOOD,
    Performative.CONFIRM,
    Performative.CANCEL,
)
_INFORM, _FAILURE = Performative.INFORM, Performative.FAILURE
_PLAIN, _OF_CANCEL = Kind.PLAIN, Kind.CANCEL
_INITIATOR, _PARTICIPANT = Role.INITIATOR, Role.PARTICIPANT
_NOTHING, _SAME, _NEW, _ANY = Needs.NOTHING, Needs.SAME, Needs.NEW, Needs.ANY
MOST_HEARD = 16
"""Labels of the peer that are kept to be answered. Estimate: of the numbered messages of a long
subscription nobody answers an older one.
"""


class Conversation(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One side of a conversation (m_c = `id`): that of agent `me` in `role`.

    `due`: the answers that are due, of either side, and their deadlines (`deadlines.py`, SC00061G):
    the answer to the cancel has one of its own. `asked`: m_w of
    the opening. `cancel`: m_w of the pending cancel, "" if there is none or it has none.
    `unconfirmed`: m_w and kind of the messages not yet confirmed, oldest first. `past`: m_w of
    earlier rounds, and of cancels that failed without ending the conversation, but for that of the
    opening; a message with one of these is a copy. `heard`: m_w of the peer's other messages,
    oldest first, at most MOST_HEARD: each may be answered (SC00061G).
    """

    id: str
    protocol: str
    role: Role
    me: str
    peer: str
    state: str = START
    due: deadlines.Due = ()
    asked: str = ""
    cancel: str = ""
    unconfirmed: tuple[tuple[str, Kind], ...] = ()
    past: tuple[str, ...] = ()
    heard: tuple[str, ...] = ()

    @classmethod
    def open(cls, protocol: str | Protocol, role: Role, *, id: str, me: str, peer: str) -> Self:
        """A conversation before its first message.

        Raise LocalProtocolError if the protocol is unknown, `id` is not a label, or `me` or `peer`
        (if not "") is not a word.
        """
        if not is_label(id):
            raise LocalProtocolError("conversation", f"is {id!r}, must match {LABEL}")
        for field, name in (("me", me), ("peer", peer or me)):
            if not is_word(name):
                raise LocalProtocolError(field, f"is {name!r}, must match {WORD}")
        name = protocol.name if isinstance(protocol, Protocol) else named(protocol).name
        return cls(id=id, protocol=name, role=role, me=me, peer=peer)

    @classmethod
    def answering(cls, communicate: Communicate, me: str) -> Self:
        """The participant's conversation for a communicate of no known conversation; then `receive`
        it.

        For openings, and for a cancel that came too late (`request`: answer failure; `coordinate`:
        drop it). Raise RemoteProtocolError if m_c, the sender or a known protocol is missing,
        MalformedError for text that is not a valid word or label: this conversation takes over
        names chosen by the peer.
        """
        check_text(communicate)
        if not (communicate.conversation and communicate.sender and communicate.protocol):
            fields = ("conversation", "sender", "protocol")
            field = next(field for field in fields if not getattr(communicate, field))
            raise RemoteProtocolError(field, f"is absent, so {me!r} cannot open a conversation")
        try:
            name = named(communicate.protocol).name
        except LocalProtocolError as error:
            raise RemoteProtocolError(error.field, error.reason) from error
        peer = communicate.sender
        return cls(id=communicate.conversation, protocol=name, role=_PARTICIPANT, me=me, peer=peer)

    @property
    def table(self) -> Table:
        """The table of this role."""
        return named(self.protocol).tables[self.role]

    @property
    def ended(self) -> bool:
        """Whether this side has nothing more to send; late messages that the table allows may still
        arrive.
        """
        # Without `table`, here and in `owes`: one call less per message, 0.9 % of a get (nine runs,
        # alternating).
        return (
            self.state == NOT_UNDERSTOOD
            or self.state in named(self.protocol).tables[self.role].ended
        )

    @property
    def owes(self) -> bool:
        """Whether this side must send (a confirm, the failure of a late cancel) in the same step,
        before receiving.
        """
        return self.state in named(self.protocol).tables[self.role].urgent

    @property
    def deadline(self) -> float | None:
        """Until when the newest question of either side is to be answered [unix s]; None: at any
        time.
        """
        return self.due[-1].by if self.due and not self.ended else None

    def late(self, now: float, communicate: Communicate | None = None, kind: Kind = _PLAIN) -> bool:
        """Whether the deadline has passed at `now` [unix s]: that of a message before it is
        received, or after `send` made it from this conversation; without one, that of the newest
        question.

        Equal is in time, no deadline never passes (SC00061G). `kind` as for `receive` and `send`. A
        message out of sequence answers nothing, so it is not late.
        """
        until = self.deadline if communicate is None else self._deadline(communicate, kind)
        return until is not None and now > until

    def _deadline(self, communicate: Communicate, kind: Kind) -> float | None:
        if not self.due:
            return None
        way = SEND if communicate.sender == self.me else RECEIVE
        word = self._word(way, communicate, kind)
        found = deadlines.answered(self.due, named(self.protocol), word)
        return None if found is None else found.by

    def _word(self, way: Way, communicate: Communicate, kind: Kind) -> deadlines.Word:
        """A message in this state, as the rule of deadlines sees it; `kind` by its language."""
        performative, reply_to = communicate.performative, communicate.in_reply_to
        if performative is _ACT_NOT_UNDERSTOOD:
            kind = _OF_CANCEL if reply_to and reply_to == self.cancel else _PLAIN
        elif performative is not _CONFIRM:
            with suppress(LocalProtocolError):  # it is out of sequence: `receive` says why
                kind = self.kind_of(performative, reply_to, kind)
        return deadlines.Word(
            self.role if way is SEND else self.role.other,
            performative,
            (kind,),
            communicate.reply_with,
            reply_to,
            again=self.state != START and needs(named(self.protocol), performative) is _SAME,
        )

    def allowed(self, way: Way) -> tuple[str, ...]:
        """The messages that this side may send, or must accept, in this state, as words for
        people.
        """
        return tuple(row.word for row in self.table.allowed(self.state, way))

    def takes(self, communicate: Communicate, kind: Kind = _PLAIN) -> bool:
        """Whether `receive` accepts this message."""
        try:
            self.receive(communicate, kind)
        except (RemoteProtocolError, LocalProtocolError):
            return False
        return True

    def receive(self, communicate: Communicate, kind: Kind = _PLAIN) -> Self:
        """The conversation after a message of the peer; `kind` is the kind by the content's
        language.

        It has no clock, and takes a late answer like any other: ask `late(now)` before. A
        not-understood ends the conversation, or in reply to the cancel only fails that (SC00037J);
        after it everything is taken and ignored.

        Raise RemoteProtocolError, with the performative to answer with, if conversation-id,
        protocol, sender or receiver are not those of this conversation, no row of the protocol's
        table allows the act in this state, the reply-with is missing or that of an earlier message,
        or in-reply-to names no message that waits for an answer (SC00061G). Raise
        LocalProtocolError if this side `owes` a message, or the act is not a Performative.
        """
        self._require_mine(communicate)
        if self.state == NOT_UNDERSTOOD:
            return self._ended_by_not_understood(RECEIVE, communicate, kind)
        performative, reply_to = communicate.performative, communicate.in_reply_to
        if type(performative) is not Performative:
            raise LocalProtocolError(
                "performative", f"is {performative!r}, must be a Performative; decode() gives one"
            )
        if performative is _ACT_NOT_UNDERSTOOD:
            return self._after_not_understood(RECEIVE, communicate)
        protocol = named(self.protocol)
        table = protocol.tables[self.role]
        if self.state in table.urgent:
            raise LocalProtocolError(
                "performative",
                f"{self._here} must send {', '.join(self.allowed(SEND))} before it receives",
            )
        try:
            row = self._row(
                table, RECEIVE, performative, self.kind_of(performative, reply_to, kind)
            )
            need = needs(protocol, performative)
            self._require_labels(need, RECEIVE, performative, communicate.reply_with, reply_to)
        except LocalProtocolError as error:
            raise RemoteProtocolError(error.field, error.reason) from None
        return self._after(row, need, communicate)

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
        """The conversation after a message of this side, and the message, which the caller
        transmits.

        `id` is the message's label, and its reply-with if it needs one. `now`: when it is sent;
        `reply_by`: until when its answer should come (SC00061G) [unix s, UTC]. `content` is
        encoded, in `language`. `in_reply_to` None: the newest message of the peer that has a
        reply-with; for a confirm the oldest unconfirmed message; the cancel if `kind` is CANCEL or
        only the cancel can be answered in this state.

        Raise LocalProtocolError if no row of the protocol's table allows the act in this state,
        `id` is not a label or that of an earlier round, `in_reply_to` names no message that waits
        for an answer, the performative is not one of SC00037J, or a not-understood would be said in
        a conversation that has ended.
        """
        if type(performative) is not Performative:
            performative = _act(performative)
        protocol = named(self.protocol)
        table = protocol.tables[self.role]
        need = needs(protocol, performative)
        reply_to = (
            self._default_reply(need, performative, kind) if in_reply_to is None else in_reply_to
        )
        communicate = Communicate(
            performative=performative,
            content=msgspec.UNSET if content is None else content,
            language=language,
            ontology=ontology,
            protocol=self.protocol,
            reply_by=reply_by,
            reply_with=self._label(need, id),
            in_reply_to=reply_to,
            conversation=self.id,
            sender=self.me,
            receiver=self.peer,
            id=id,
            sent=now,
        )
        if performative is _ACT_NOT_UNDERSTOOD:
            if self.ended:
                raise LocalProtocolError(
                    "performative",
                    f"{self._here} has ended; drop what came, or two agents answer each other for"
                    " ever",
                )
            return self._after_not_understood(SEND, communicate), communicate
        row = self._row(table, SEND, performative, self.kind_of(performative, reply_to, kind))
        self._require_labels(need, SEND, performative, communicate.reply_with, reply_to)
        return self._after(row, need, communicate), communicate

    @property
    def _here(self) -> str:
        return (
            f"conversation {self.id} ({self.protocol}, {self.role} {self.me!r}, state {self.state})"
        )

    def _row(self, table: Table, way: Way, performative: Performative, kind: Kind) -> Row:
        row = table.find(self.state, way, performative, kind)
        if row is None:
            verb, may = ("got", "accepts") if way is RECEIVE else ("cannot send", "may send")
            word = f"{performative}[{kind}]" if kind else performative
            allowed = ", ".join(self.allowed(way)) or "nothing"
            raise LocalProtocolError(
                "performative", f"{self._here} {verb} {word}; this state {may} {allowed}"
            )
        return row

    def kind_of(self, performative: Performative, reply_to: str, kind: Kind) -> Kind:
        """The kind of the row for a message. Only informs are distinguished by their content."""
        if performative is _CONFIRM:
            # First: each side chooses its own labels, so the confirmed message may have the label
            # of the cancel.
            known = dict(self.unconfirmed)
            if reply_to not in known:
                expected = ", ".join(known) or "nothing"
                raise LocalProtocolError(
                    "in_reply_to",
                    f"{self._here}: {reply_to!r} is not one of the unconfirmed: {expected}",
                )
            return known[reply_to]
        # "": a cancel without a label, or none: the tables know
        if kind is _OF_CANCEL and reply_to != self.cancel:
            raise LocalProtocolError(
                "in_reply_to", f"{self._here}: is {reply_to!r}, the cancel is {self.cancel!r}"
            )
        if kind is _OF_CANCEL or (
            reply_to and reply_to == self.cancel and not self._means_the_opening(performative)
        ):
            return _OF_CANCEL
        return kind if performative is _INFORM else _PLAIN

    def _require_mine(self, communicate: Communicate) -> None:
        """Raise RemoteProtocolError if sender, receiver, m_c or protocol is not that of this
        conversation.
        """
        same = communicate.conversation == self.id and communicate.protocol == self.protocol
        if same and communicate.sender == self.peer and communicate.receiver == self.me:
            # the usual case; otherwise find the wrong field, unless only an alias of the protocol
            # is used
            return
        names = (named(self.protocol).name, *named(self.protocol).aliases)
        checks = (
            ("conversation", communicate.conversation, (self.id,)),
            ("sender", communicate.sender, (self.peer,)),
            ("receiver", communicate.receiver, (self.me,)),
            ("protocol", communicate.protocol, names),
        )
        for field, value, wanted in checks:
            if value not in wanted:
                raise RemoteProtocolError(
                    field, f"{self._here} got {value!r}, expected {wanted[0]!r}"
                )

    def _require_labels(
        self, need: Needs, way: Way, performative: Performative, reply_with: str, reply_to: str
    ) -> None:
        """Raise LocalProtocolError if m_w is missing or was used before, or m_t is not an m_w of
        the other side.
        """
        if need is not _NOTHING:
            self._require_label(need, performative, reply_with)
        if not reply_to or reply_to == self.cancel or reply_to in self._answerable(way):
            return
        if all(reply_to != label for label, _ in self.unconfirmed):
            raise LocalProtocolError(
                "in_reply_to",
                f"{self._here}: {reply_to!r} is not a message that waits for an answer",
            )

    def _require_label(self, need: Needs, performative: Performative, reply_with: str) -> None:
        if need is _SAME:
            if self.state != START and reply_with != self.asked:
                raise LocalProtocolError(
                    "reply_with", f"{self._here}: repeated with {reply_with!r}, not {self.asked!r}"
                )
        elif not is_label(reply_with) and (reply_with or need is _ANY):
            what = f"a {performative} needs one that matches {LABEL}, so that it can be answered"
            raise LocalProtocolError("reply_with", f"{self._here}: {what}")
        elif (
            need is not _ANY
            and reply_with
            and reply_with in (*self.past, self.asked if need is _NEW else "")
        ):
            raise LocalProtocolError(
                "reply_with", f"{self._here}: {reply_with!r} was used before, this is a copy"
            )

    def _answerable(self, way: Way) -> tuple[str, ...]:
        """M_w that a message of the sender may answer: those of the other side."""
        if way is SEND:
            return (self.asked, *self.heard) if self.role is _PARTICIPANT else self.heard
        return (self.asked,) if self.role is _INITIATOR else ()

    def _means_the_opening(self, performative: Performative) -> bool:
        """Whether an answer to the cancel's label answers the opening, which has the same: as the
        state allows.
        """
        return self.cancel == self.asked and not self._answers_only_cancel(performative, _PLAIN)

    def _label(self, need: Needs, id: str) -> str:
        """M_w, "" if nothing will refer to the message; a repeated opening has that of the first
        one.
        """
        if not is_label(id):
            raise LocalProtocolError(
                "id", f"{self._here}: a message needs an id that matches {LABEL}, not {id!r}"
            )
        if need is _SAME:
            return self.asked or id
        return "" if need is _NOTHING else id

    def _default_reply(self, need: Needs, performative: Performative, kind: Kind) -> str:
        """M_t. In coordinate the paper leaves it empty in request, inform and cancel, and sets it
        in confirm.
        """
        if kind is _OF_CANCEL or (self.cancel and self._answers_only_cancel(performative, kind)):
            return self.cancel
        if performative is _CONFIRM:
            return self.unconfirmed[0][0] if self.unconfirmed else ""
        if need is _ANY:
            return ""
        if self.heard:
            return self.heard[-1]
        return "" if self.role is _INITIATOR else self.asked

    def _answers_only_cancel(self, performative: Performative, kind: Kind) -> bool:
        find = self.table.find
        return find(self.state, SEND, performative, kind) is None and bool(
            find(self.state, SEND, performative, _OF_CANCEL)
        )

    def _after(self, row: Row, need: Needs, communicate: Communicate) -> Self:
        performative, label = communicate.performative, communicate.reply_with
        unconfirmed = self.unconfirmed
        if need is _ANY:
            unconfirmed = (*unconfirmed, (label, row.kind))
        elif performative is _CONFIRM:
            unconfirmed = tuple(
                entry for entry in unconfirmed if entry[0] != communicate.in_reply_to
            )
        opens = need is _NEW or (need is _SAME and self.state == START)
        state = str(row.to)
        due = self._due_after(row, communicate)
        heard = self.heard
        if opens:
            heard = ()  # those of an earlier round
        elif label and row.way is RECEIVE and need is _NOTHING:
            heard = (*heard, label)[-MOST_HEARD:]
        plain = row.kind is not _OF_CANCEL and performative is not _CANCEL and heard is self.heard
        if plain and unconfirmed is self.unconfirmed and not (opens and self.asked):
            asked = label if opens else self.asked
            return msgspec.structs.replace(self, state=state, due=due, asked=asked)
        return msgspec.structs.replace(
            self,
            state=state,
            due=due,
            asked=label if opens else self.asked,
            cancel=label if performative is _CANCEL else self._cancel_after(row),
            unconfirmed=unconfirmed,
            past=self._past_after(row, opens),
            heard=heard,
        )

    def _cancel_after(self, row: Row) -> str:
        """M_w of the pending cancel; none after a cancel that failed without ending the
        conversation.
        """
        return "" if row.kind is _OF_CANCEL and row.to not in self.table.ended else self.cancel

    def _past_after(self, row: Row, opens: bool) -> tuple[str, ...]:
        if opens:
            return (*self.past, *filter(None, (self.asked,)), *self.heard)
        over = self.cancel if self._cancel_after(row) != self.cancel else ""
        return (*self.past, over) if over and over != self.asked else self.past

    def _due_after(self, row: Row, communicate: Communicate) -> deadlines.Due:
        if not self.due and communicate.reply_by is None:  # the usual case
            return self.due
        word = self._word(row.way, communicate, row.kind)
        return deadlines.after(self.due, named(self.protocol), word, communicate.reply_by)

    def _ended_by_not_understood(self, way: Way, communicate: Communicate, kind: Kind) -> Self:
        """After the message that ends it, and after one that was on its way then: what its sender
        says next answers no question.
        """
        due, word = self.due, self._word(way, communicate, kind)
        if due:
            due = deadlines.after(due, named(self.protocol), word, None)
        return msgspec.structs.replace(self, state=NOT_UNDERSTOOD, due=due, unconfirmed=())

    def _after_not_understood(self, way: Way, communicate: Communicate) -> Self:
        """Apply the rule outside the tables: it ends the conversation; in reply to a cancel, only
        the cancel fails.
        """
        if self.ended:
            return self
        if communicate.in_reply_to and communicate.in_reply_to == self.cancel:
            row = self.table.find(self.state, way, _FAILURE, _OF_CANCEL)
            if row is not None:
                return msgspec.structs.replace(
                    self,
                    state=str(row.to),
                    due=self._due_after(row, communicate),
                    cancel=self._cancel_after(row),
                    past=self._past_after(row, opens=False),
                )
        return self._ended_by_not_understood(way, communicate, _PLAIN)


def _act(performative: Performative | str) -> Performative:
    """The performative, also of its name. Raise LocalProtocolError where there is no such act."""
    if type(performative) is Performative:
        return performative
    try:
        return Performative(performative)
    except ValueError:
        acts = ", ".join(Performative)
        raise LocalProtocolError(
            "performative", f"is {performative!r}, must be one of {acts}"
        ) from None
