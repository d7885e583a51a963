"""JADE's AchieveREInitiator asks our participants: it takes the first inform as the result, and drops what follows.

As JADE 4.6.5 was observed on loopback (2026-11-22). Its other two initiators are in test_labels.py.
"""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import SEND, Role, Row

OPENINGS = {"fipa-request": P.REQUEST, "fipa-query": P.QUERY_REF, "request": P.REQUEST}
FIRST = {P.AGREE: "agreed", P.REFUSE: "refused", P.FAILURE: "failed", P.INFORM: "done"}
AFTER_AGREE = {P.FAILURE: "failed", P.INFORM: "done"}


class AchieveREInitiator:
    """The peer: its state, the acts it took, and those it logged as OUT-OF-SEQUENCE."""

    def __init__(self, opening: P, protocol: str) -> None:
        self.request = Communicate(
            performative=opening,
            protocol=protocol,
            reply_with="jade1763900000000",
            conversation="C1",
            sender="jade",
            receiver="ta",
        )
        self.state, self.out_of_sequence = "asked", []

    def takes(self, said: Communicate) -> None:
        """Take one message; it is matched by its in-reply-to."""
        rows = {"asked": FIRST, "agreed": AFTER_AGREE}.get(self.state, {})
        if said.in_reply_to == self.request.reply_with and said.performative in rows:
            self.state = rows[said.performative]
        else:
            self.out_of_sequence.append(said.performative)


def answered(protocol: str, choose: st.DataObject) -> tuple[AchieveREInitiator, Conversation]:
    """Return the peer and our participant, which sends what its table allows until it has ended."""
    jade = AchieveREInitiator(OPENINGS[protocol], protocol)
    ours = Conversation.answering(jade.request, "ta").receive(jade.request)
    for number in range(4):
        rows = [row for row in ours.table.allowed(ours.state, SEND) if number < 3 or row.to in ours.table.ended]
        if ours.ended:
            break
        row: Row = choose.draw(st.sampled_from(rows))
        ours, said = ours.send(row.performative, id=f"ta-{number}", now=1.0, kind=row.kind)
        jade.takes(said)
    return jade, ours


@pytest.mark.parametrize("protocol", ["fipa-request", "fipa-query"])
@given(data=st.data())
def test_it_understands_all_that_we_say(protocol: str, data: st.DataObject) -> None:
    """Both end in the same state."""
    jade, ours = answered(protocol, data)
    assert not jade.out_of_sequence
    assert jade.state == ours.state
    assert ours.ended


def test_progress_would_be_taken_for_the_result() -> None:
    """Which is why the book's request has none, and the paper's is not for a standard peer."""
    jade = AchieveREInitiator(P.REQUEST, "request")
    ours = Conversation.answering(jade.request, "ta").receive(jade.request)
    for act, kind in ((P.AGREE, Kind.PLAIN), (P.INFORM, Kind.PROGRESS), (P.INFORM, Kind.PLAIN)):
        ours, said = ours.send(act, id="ta-1", now=1.0, kind=kind)
        jade.takes(said)
    assert (jade.state, jade.out_of_sequence) == ("done", [P.INFORM])
    assert Role.PARTICIPANT is ours.role
