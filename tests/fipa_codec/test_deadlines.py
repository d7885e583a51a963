"""Until when an answer is due: a reply-by binds the other side, and the answer to its own message.

Exhaustively, with a judge: tests/topdown/test_deadlines_explored.py.
"""

import re

import pytest
from dialogue import Dialogue
from rows import each_row

from fipa_codec import deadlines
from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import CFP, FIPA_REQUEST, ICFP, PROTOCOLS, SUBSCRIBE
from fipa_codec.tables import Role

SAID = re.compile(r"([ip])([:>])([a-z-]+)(\[cancel\])?@([\d.]+)(?:<([\d.]+))?(!?)")
"""A step of a story with the time at which it is said and its reply-by; `!`: it is late."""

LINES = """
request: i:request@0 p:agree@1<5 p:inform@20
request: i:request@0<5 p:agree@5 p:inform@20
request: i:request@0<5 p:agree@5.1! p:inform@20
request: i:request@0<5 p:not-understood@5.1!
request: i:request@0 i>cancel@1<20 p>inform@2 p< i< p:failure[cancel]@30!
request: i:request@0<5 i:cancel@6 p:inform[cancel]@7
subscribe: i:subscribe@0<1 i:cancel@.5 p:inform[cancel]@2
subscribe: i:subscribe@0<1 i:cancel@.5<1.5 p:inform[cancel]@2!
subscribe: i:subscribe@0<1 i>cancel@.5 p>agree@2! p< i< p:inform[cancel]@3
fipa-subscribe: i:subscribe@0 p:agree@1 i:cancel@2<4 p:inform@5 p:failure[cancel]@6! p:inform@7
cfp: i:cfp@0<4 i>cancel@3 p>refuse@6! p< i< p:failure[cancel]@7
cfp: i:cfp@0<4 i:cancel@1 p:failure[cancel]@2 p:propose@6!
cfp: i:cfp@0<4 p:propose@3<8 i:accept-proposal@9<20! p:inform@21!
cfp: i:cfp@0<4 p:propose@3<8 i:cancel@9<12 p:inform[cancel]@12
cfp: i:cfp@0<4 p:propose@3 i:accept-proposal@9 p:inform@21
icfp: i:cfp@0<4 p:propose@3 i:cfp@5<9 p:propose@10!
icfp: i:cfp@0<4 p:propose@3 i:cfp@5 p:propose@10
query: i:query-ref@0<5 i:query-ref@4<9 p:inform@6!
query: i:query-ref@0<5 i>query-ref@4<9 p>inform@3 p< i< p:inform@10
"""


def played(text: str) -> None:
    """Sender and receiver find each message late where the line says so."""
    protocol, _, steps = text.partition(": ")
    both = Dialogue(protocol)
    verdicts: dict[Role, list[bool]] = {role: [] for role in Role}

    def take(role: Role) -> None:
        side, late = both.sides.get(role), verdicts[role].pop(0)
        message = both.take(role)
        assert (side is not None and side.late(message.sent, message)) == late, message

    for step in steps.split():
        if step.endswith("<"):
            take(Role.INITIATOR if step[0] == "i" else Role.PARTICIPANT)
            continue
        said = SAID.fullmatch(step)
        assert said is not None, step
        role = Role.INITIATOR if said[1] == "i" else Role.PARTICIPANT
        side, kind = both.sides[role], Kind.CANCEL if said[4] else Kind.PLAIN
        at, by = float(said[5]), float(said[6]) if said[6] else None
        message = both.say(role, P(said[3]), kind, now=at, reply_by=by)
        assert side.late(at, message, kind) == bool(said[7]), step
        verdicts[role.other].append(bool(said[7]))
        if said[2] == ":":
            take(role.other)


def test_each_answer_has_the_deadline_of_what_it_answers() -> None:
    """Whatever crossed, and whoever looks at it."""
    each_row(((text,) for text in LINES.split("\n") if text), played)


def test_only_what_is_answered_has_a_deadline() -> None:
    """An agree, a result, a notification and a rejection ask for nothing; a cancel, a question and
    a proposal do.
    """
    asking = {
        row.performative
        for protocol in PROTOCOLS
        for role, table in protocol.tables.items()
        for row in table
        if row.kind is Kind.PLAIN
        and deadlines.asked(protocol, deadlines.Word(role, row.performative))
    }
    assert asking == {
        P.ACCEPT_PROPOSAL, P.CANCEL, P.CFP, P.PROPOSE, P.PROXY, P.QUERY_IF, P.QUERY_REF, P.REQUEST,
        P.REQUEST_WHEN, P.SUBSCRIBE,
    }  # fmt: skip


@pytest.mark.parametrize("protocol", [FIPA_REQUEST, SUBSCRIBE, CFP, ICFP], ids=lambda p: p.name)
def test_a_cancel_is_never_late(protocol) -> None:
    """It answers nothing, whatever is due when it is said."""
    due = tuple(deadlines.Answer(name, 0.0, "") for name in (*Role, deadlines.CANCEL))
    for role in Role:
        assert deadlines.answered(due, protocol, deadlines.Word(role, P.CANCEL)) is None


def test_a_not_understood_answers_what_its_label_names() -> None:
    """Without one it may have crossed the question: that is no proof that it was read."""
    call = Conversation.open("cfp", Role.INITIATOR, id="C", me="ina", peer="pit")
    call, _ = call.send(P.CFP, id="R1", now=0.0)
    offer = Communicate(
        performative=P.PROPOSE, protocol="cfp", reply_by=8.0, reply_with="P1", in_reply_to="R1",
        conversation="C", sender="pit", receiver="ina",
    )  # fmt: skip
    call = call.receive(offer)
    for answers, late in (("P1", True), ("", False)):
        _, message = call.send(P.NOT_UNDERSTOOD, id="R2", now=9.0, in_reply_to=answers)
        assert call.late(9.0, message) == late
