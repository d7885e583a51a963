"""Until when each answer of a conversation is due (reply-by, SC00061G): one rule for both roles and
for judges. Pure; times are data.

A reply-by binds the other side, and only the answer to the message that has it. So at most these
answers are due at one time, each under its name:

- `initiator`, `participant`: what this role says next, in answer to the other side's last question
- `cancel`: the answer to the cancel, beside that to the question which is cancelled
- `confirm LABEL`: the confirm of that message, in protocols that confirm each one

Messages cross only if none answers the other, and then they are under different names. So a role
that has not taken the other's last message yet, its peer, and a judge that hears both in any order
say the same of each message (tests/topdown/test_deadlines_explored.py).
"""

from functools import lru_cache
from typing import NamedTuple

from fipa_codec.exploration import reached
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Role


class Answer(NamedTuple):
    """An answer that is due: its name, its deadline [unix s], and the reply-with of the question,
    "" if it has none.
    """

    name: str
    by: float
    label: str


Due = tuple[Answer, ...]
"""The answers that are due; that to the newest question last."""

CANCEL = "cancel"
CONFIRM = "confirm {}"
NONE = ""


class Word(NamedTuple):
    """A message as the rule sees it. `kinds`: the uses that it may be (more than one: a judge does
    not know which); `label`: its reply-with; `again`: an opening said again, under the same label.
    """

    role: Role
    performative: Performative
    kinds: tuple[Kind, ...] = (Kind.PLAIN,)
    label: str = ""
    answers: str = ""
    again: bool = False


class Bounds(NamedTuple):
    """The answer that a message is, the one that its reply-by bounds, and those that are not due
    after it, by their names; "" where there is none.
    """

    answers: str
    asks: str
    settles: tuple[str, ...]


def answered(due: Due, protocol: Protocol, word: Word) -> Answer | None:
    """The answer that this message is, if it was due at some time; equal to its deadline is in
    time. Of several uses that the message may be the latest deadline counts.
    """
    if not due:
        return None
    uses = [bounds(protocol, word, kind) for kind in word.kinds]
    if word.performative is Performative.NOT_UNDERSTOOD:
        # It may be said at any point, so also before its sender read the question: its label tells.
        named = (one for one in due if word.answers and one.label == word.answers)
        return next((one for one in named if one.name == uses[0].answers), None)
    known = {one.name: one for one in due}
    found = [known[use.answers] for use in uses if use.answers in known]
    return max(found, key=lambda one: one.by) if len(found) == len(uses) else None


def after(due: Due, protocol: Protocol, word: Word, reply_by: float | None) -> Due:
    """What is due after this message, which has this reply-by [unix s] or none."""
    if not due and reply_by is None:
        return due
    settled = {name for kind in word.kinds for name in bounds(protocol, word, kind).settles}
    left = tuple(one for one in due if one.name not in settled)
    asks = asked(protocol, word)
    return (*left, Answer(asks, reply_by, word.label)) if asks and reply_by is not None else left


def asked(protocol: Protocol, word: Word) -> str:
    """The answer that a reply-by of this message bounds; "" if it asks for none."""
    found = (bounds(protocol, word, kind).asks for kind in word.kinds)
    return next(filter(None, found), NONE)


def bounds(protocol: Protocol, word: Word, kind: Kind) -> Bounds:
    """The rule for one use of a message."""
    if word.again:
        return _AGAIN
    role, performative = word.role, word.performative
    if performative is Performative.CONFIRM and protocol.confirmed:
        name = CONFIRM.format(word.answers)
        return Bounds(name, NONE, (name,))
    if performative in protocol.confirmed:
        rule = _bounds(protocol, role, performative, kind)
        return rule._replace(asks=CONFIRM.format(word.label))
    return _bounds(protocol, role, performative, kind)


_AGAIN = Bounds(NONE, NONE, ())
"""It is the same question: the reply-by of the first time stands, and once it is answered, its
copies ask for nothing by any time.
"""


@lru_cache(maxsize=1024)
def _bounds(protocol: Protocol, role: Role, performative: Performative, kind: Kind) -> Bounds:
    mine, yours = role.value, role.other.value
    if performative is Performative.CANCEL:  # it answers nothing, so it is never late
        return Bounds(NONE, CANCEL, (CANCEL,))
    all_mine = (mine, CANCEL) if role is Role.PARTICIPANT else (mine,)
    if kind is Kind.CANCEL and role is Role.PARTICIPANT and _answers_cancels(protocol):
        return Bounds(CANCEL, NONE, all_mine if performative is Performative.INFORM else (CANCEL,))
    if performative is Performative.NOT_UNDERSTOOD:  # the other side may still say what is late
        return Bounds(mine, NONE, all_mine)
    settles = all_mine if (performative, kind) in _last_words(protocol) else (mine,)
    if not _asks(protocol, role, performative, kind):
        return Bounds(mine, NONE, settles)
    return Bounds(mine, yours, (*settles, yours))


def _answers_cancels(protocol: Protocol) -> bool:
    return any(row.kind is Kind.CANCEL for table in protocol.tables.values() for row in table)


@lru_cache(maxsize=256)
def _last_words(protocol: Protocol) -> frozenset[tuple[Performative, Kind]]:
    """Words of the participant after which nobody waits for the answer to a cancel, where a cancel
    has no answer of its own (a design's protocol): those that end what is cancelled. They may have
    crossed the cancel, so its reply-by does not make them late.
    """
    if _answers_cancels(protocol):
        return frozenset()
    table = protocol.tables[Role.INITIATOR]
    cancelling = {row.to for row in table if row.performative is Performative.CANCEL}
    return frozenset(
        (row.performative, row.kind)
        for row in table
        if row.state in cancelling
        and row.way is RECEIVE
        # from where it leads, no state of an unanswered cancel is reached
        and not cancelling & reached([row.to], lambda at: (r.to for r in table if r.state == at))
    )


def _asks(protocol: Protocol, role: Role, performative: Performative, kind: Kind) -> bool:
    """Whether the other side may have to say something to this: an agree, a result, a notification
    and a rejection ask for nothing.
    """
    table = protocol.tables[role.other]
    taken = (row.to for row in table if row[1:4] == (RECEIVE, performative, kind))
    return any(
        not row.free and row.kind is not Kind.CANCEL
        for state in taken
        if state != START
        for row in table.allowed(state, SEND)
    )
