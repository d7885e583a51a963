"""Labels as a judge reads them: by the rules of the agents' own conversations
(fipa_codec/test_labels.py).
"""

from fipa_codec import protocols
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import Protocol, Role
from topdown.judge.follow import Followed, TableMessage

INITIATOR, PARTICIPANT = Role.INITIATOR, Role.PARTICIPANT
Line = tuple[Role, P, str, str, Kind]


def line(role: Role, act: P, label: str = "", answers: str = "", kind: Kind = Kind.PLAIN) -> Line:
    """A message: who says it, its m_w and m_t, and the kind by its content."""
    return role, act, label, answers, kind


CALLED = (line(INITIATOR, P.CFP, "R1"), line(PARTICIPANT, P.PROPOSE, "", "R1"))
LIVE = (
    line(INITIATOR, P.SUBSCRIBE, "R1"),
    line(PARTICIPANT, P.AGREE, "", "R1"),
    line(PARTICIPANT, P.INFORM, "", "R1"),
)
REQUESTED, CANCELLED = line(INITIATOR, P.REQUEST), line(INITIATOR, P.CANCEL)
LEGAL: list[tuple[Protocol, tuple[Line, ...]]] = [
    (
        protocols.CFP,
        (*CALLED, line(INITIATOR, P.ACCEPT_PROPOSAL, "R2"), line(PARTICIPANT, P.INFORM, "", "R2")),
    ),
    (
        protocols.CFP,
        (*CALLED, line(INITIATOR, P.ACCEPT_PROPOSAL, "R2"), line(PARTICIPANT, P.INFORM, "", "R1")),
    ),
    (
        protocols.CFP,
        (
            line(INITIATOR, P.CFP),
            line(PARTICIPANT, P.PROPOSE, "R5"),
            line(INITIATOR, P.ACCEPT_PROPOSAL, "", "R5"),
        ),
    ),
    (
        protocols.ICFP,
        (
            line(INITIATOR, P.CFP),
            line(PARTICIPANT, P.PROPOSE),
            line(INITIATOR, P.CFP),
            line(PARTICIPANT, P.REFUSE),
        ),
    ),
    (
        protocols.ICFP,
        (*CALLED, line(INITIATOR, P.CFP, "R2"), line(PARTICIPANT, P.PROPOSE, "", "R2")),
    ),
    (
        protocols.SUBSCRIBE,
        (
            *LIVE,
            line(INITIATOR, P.CANCEL, "R1"),
            line(PARTICIPANT, P.INFORM, "", "R1", Kind.CANCEL),
        ),
    ),
    (
        protocols.SUBSCRIBE,
        (*LIVE, line(INITIATOR, P.CANCEL, "R2"), line(PARTICIPANT, P.INFORM, "", "R2")),
    ),
    (protocols.SUBSCRIBE, (*LIVE, line(INITIATOR, P.CANCEL), line(PARTICIPANT, P.INFORM))),
    (
        protocols.FIPA_REQUEST,
        (
            line(INITIATOR, P.REQUEST, "R1"),
            CANCELLED,
            line(PARTICIPANT, P.FAILURE),
            CANCELLED,
            line(PARTICIPANT, P.INFORM),
        ),
    ),
    (
        protocols.FIPA_REQUEST,
        (REQUESTED, CANCELLED, line(PARTICIPANT, P.INFORM), line(PARTICIPANT, P.FAILURE)),
    ),
]
ILLEGAL: list[tuple[Protocol, tuple[Line, ...], Line]] = [
    (
        protocols.CFP,
        (*CALLED, line(INITIATOR, P.ACCEPT_PROPOSAL, "R2")),
        line(PARTICIPANT, P.INFORM, "", "R9"),
    ),
    (
        protocols.ICFP,
        (*CALLED, line(INITIATOR, P.CFP, "R2")),
        line(PARTICIPANT, P.PROPOSE, "", "R1"),
    ),
    (protocols.ICFP, CALLED, line(INITIATOR, P.CFP, "R1")),
    (
        protocols.CFP,
        (CALLED[0], line(INITIATOR, P.CANCEL, "R2"), line(PARTICIPANT, P.FAILURE, "", "R2")),
        line(INITIATOR, P.CANCEL, "R2"),
    ),
    (
        protocols.FIPA_REQUEST,
        (REQUESTED, CANCELLED, line(PARTICIPANT, P.INFORM), line(PARTICIPANT, P.FAILURE)),
        line(PARTICIPANT, P.FAILURE),
    ),
]


def taken(followed: Followed, one: Line) -> bool:
    """Whether a message is in sequence, its labels included."""
    role, act, label, answers, kind = one
    if followed.mislabelled(role, act, label):
        return False
    said = followed.read(role, act, label, answers, (kind,))
    return not isinstance(said, str) and followed.take(role, said)


def play(protocol: Protocol, lines: tuple[Line, ...]) -> Followed:
    """A conversation after these messages, each of which must be in sequence."""
    followed = Followed(protocol, durable=True)
    for one in lines:
        assert taken(followed, one), (one, followed.states)
    return followed


def test_what_fipa_and_jade_say_is_in_sequence() -> None:
    """Any label of the other side may be answered; a cancel may carry its subscription's; none
    needs one.
    """
    for protocol, lines in LEGAL:
        play(protocol, lines)


def test_a_wrong_label_is_out_of_sequence() -> None:
    """Nobody's label, one of an earlier round, a copy; one answer more than was asked for."""
    for protocol, lines, wrong in ILLEGAL:
        assert not taken(play(protocol, lines), wrong), wrong


def test_a_doubtful_opening_does_not_spoil_what_follows() -> None:
    """One repeated under a wrong label was judged; the right one is still right after it."""
    followed = play(protocols.SUBSCRIBE, LIVE)
    followed.doubt(INITIATOR, TableMessage(P.SUBSCRIBE, label="R9"))
    assert not followed.mislabelled(INITIATOR, P.SUBSCRIBE, "R1")


def test_a_doubtful_round_may_have_begun_or_not() -> None:
    """A proposal to either is not a fault of the bidder."""
    followed = play(protocols.ICFP, CALLED)
    followed.doubt(INITIATOR, TableMessage(P.CFP, label="R2"))
    for answers in ("R1", "R2"):
        assert not isinstance(
            followed.read(PARTICIPANT, P.PROPOSE, "", answers, (Kind.PLAIN,)), str
        )
