"""SW (supervised worker), the language of ta's states on channel C1, in protocol coordinate (paper,
5.4 and 5.5).

confirm and cancel name this language and carry no content (formula 4); the inform carries a Report.
"""

from enum import StrEnum

import msgspec

from companion.languages.evidence import Evidence
from companion.languages.facts import Facts
from companion.languages.hfsm import Place
from companion.languages.values import Side


class WorkerState(StrEnum):
    """The states ta reports; the last four end the plan. Waiting, for an operator, is ours."""

    IDLE = "Idle"
    RUNNING = "Running"
    WAITING = "Waiting"
    ERROR = "Error"
    TERMINATING = "Terminating"
    SUCCEEDED = "Succeeded"
    FAILED = "Failed"
    PREEMPTED = "Preempted"
    REPLAN = "Replan"


FINAL = frozenset(
    {WorkerState.SUCCEEDED, WorkerState.FAILED, WorkerState.PREEMPTED, WorkerState.REPLAN}
)


class Report(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True):
    """ta's state, and why. `at`: where in the plan it is, while Waiting what comes next.
    `evidence`: at the end of a plan, what its acts made true, and which senses told. `hands`: what
    each hand holds by the last outcome; None: nothing is told of them.
    """

    state: WorkerState
    at: Place | None = None
    why: Facts = ()
    evidence: tuple[Evidence, ...] = ()
    hands: dict[Side, str] | None = None


Content = Report
