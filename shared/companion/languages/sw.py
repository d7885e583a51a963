"""SW (supervised worker), the language of ta's states on channel C1, in protocol coordinate (paper, 5.4 and 5.5).

confirm and cancel name this language and carry no content (formula 4); the inform carries a Report.
"""

from enum import StrEnum

import msgspec


class WorkerState(StrEnum):
    """The states ta reports; the last four end the plan."""

    IDLE = "Idle"
    RUNNING = "Running"
    ERROR = "Error"
    TERMINATING = "Terminating"
    SUCCEEDED = "Succeeded"
    FAILED = "Failed"
    PREEMPTED = "Preempted"
    REPLAN = "Replan"


FINAL = frozenset({WorkerState.SUCCEEDED, WorkerState.FAILED, WorkerState.PREEMPTED, WorkerState.REPLAN})


class Report(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True):
    """ta's state; while Running, the path of the plan's current state; the reason in words where there is one."""

    state: WorkerState
    at: str = ""
    reason: str = ""


Content = Report
