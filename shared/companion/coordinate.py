"""`coordinate`, the system's own protocol on channel C1: co hands ta a plan and is told of its states (paper, 5.4).

formula (4), Figure 8: request(plan), then inform(state) answered by confirm each time; cancel. Ours: refuse, and what
crosses on the way. One conversation is one plan. Rules, found by exploring both roles (tests/companion):
co confirms every inform in the step that takes it, also after its cancel; ta never waits for the confirm of a report
that is not final; an accepted plan has exactly one final report, and that (or a refuse) answers a cancel, which has no
answer of its own; nothing follows the confirm of the final report. Which report is final is said by language SW. A
reply-by that passes at co has no row: co cancels, and the same conversation goes on.
"""

from enum import StrEnum

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import register
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Row, Table

PLAIN, PROGRESS, FINAL = Kind.PLAIN, Kind.PROGRESS, Kind.FINAL


class State(StrEnum):
    """States of both roles of coordinate."""

    START = START
    ASKED = "asked"
    """ta: reports Running, or refuses, in the same step."""
    RUNNING = "running"
    REPORTED = "reported"
    """co: owes the confirm of a report that is not final."""
    CANCELLING = "cancelling"
    CANCELLING_REPORTED = "cancelling-reported"
    CONCLUDED = "concluded"
    """co: owes the confirm of the final report."""
    STOPPING = "stopping"
    """ta: cancelled, makes things safe."""
    FINISHED = "finished"
    """ta: waits for the confirm of its final report."""
    DONE = "done"
    REFUSED = "refused"


S = State


_co = Table(
    [
        Row(S.START, SEND, P.REQUEST, PLAIN, S.RUNNING),
        Row(S.RUNNING, RECEIVE, P.INFORM, PROGRESS, S.REPORTED),
        Row(S.RUNNING, RECEIVE, P.INFORM, FINAL, S.CONCLUDED),
        Row(S.RUNNING, RECEIVE, P.REFUSE, PLAIN, S.REFUSED),
        Row(S.RUNNING, SEND, P.CANCEL, PLAIN, S.CANCELLING),
        Row(S.REPORTED, SEND, P.CONFIRM, PROGRESS, S.RUNNING),
        Row(S.CANCELLING, RECEIVE, P.INFORM, PROGRESS, S.CANCELLING_REPORTED),
        Row(S.CANCELLING, RECEIVE, P.INFORM, FINAL, S.CONCLUDED),
        Row(S.CANCELLING, RECEIVE, P.REFUSE, PLAIN, S.REFUSED),
        Row(S.CANCELLING_REPORTED, SEND, P.CONFIRM, PROGRESS, S.CANCELLING),
        Row(S.CONCLUDED, SEND, P.CONFIRM, FINAL, S.DONE),
    ],
    ended=(S.DONE, S.REFUSED),
    urgent=(S.REPORTED, S.CANCELLING_REPORTED, S.CONCLUDED),
)

_ta = Table(
    [
        Row(S.START, RECEIVE, P.REQUEST, PLAIN, S.ASKED),
        Row(S.ASKED, SEND, P.INFORM, PROGRESS, S.RUNNING),
        Row(S.ASKED, SEND, P.REFUSE, PLAIN, S.REFUSED),
        Row(S.RUNNING, SEND, P.INFORM, PROGRESS, S.RUNNING),
        Row(S.RUNNING, SEND, P.INFORM, FINAL, S.FINISHED),
        Row(S.RUNNING, RECEIVE, P.CONFIRM, PROGRESS, S.RUNNING),
        Row(S.RUNNING, RECEIVE, P.CANCEL, PLAIN, S.STOPPING),
        Row(S.STOPPING, SEND, P.INFORM, PROGRESS, S.STOPPING),
        Row(S.STOPPING, SEND, P.INFORM, FINAL, S.FINISHED),
        Row(S.STOPPING, RECEIVE, P.CONFIRM, PROGRESS, S.STOPPING),
        Row(S.FINISHED, RECEIVE, P.CONFIRM, PROGRESS, S.FINISHED),
        Row(S.FINISHED, RECEIVE, P.CONFIRM, FINAL, S.DONE),
        # The cancel crossed the final report, or the refuse (start: a refuse nobody remembers); that answered it.
        Row(S.FINISHED, RECEIVE, P.CANCEL, PLAIN, S.FINISHED),
        Row(S.REFUSED, RECEIVE, P.CANCEL, PLAIN, S.REFUSED),
        Row(S.START, RECEIVE, P.CANCEL, PLAIN, S.REFUSED),
    ],
    ended=(S.DONE, S.REFUSED),
    urgent=(S.ASKED,),
)

COORDINATE = register(Protocol("coordinate", initiator=_co, participant=_ta, confirmed=(P.INFORM,)))
