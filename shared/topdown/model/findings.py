"""Findings of checks: name of the fault, place, fault, correction."""

from enum import StrEnum

import msgspec

from topdown.model.loading import Path_, line_of


class Kind(StrEnum):
    """The names of faults."""

    TWICE = "defined twice"
    UNDEFINED = "undefined"
    UNUSED = "unused"
    # requirements
    NO_TREE = "requirements are no tree"
    NOT_COVERED = "requirement not covered"
    NO_EVIDENCE = "evidence that cannot be"
    COVERED_TWICE = "requirement covered twice"
    # steps
    DIVIDED_TWICE = "group divided twice"
    NEVER_INTRODUCED = "group never introduced"
    NO_TASK = "group without a task"
    LEFT_OVER = "group left over"
    STOP = "stop decision"
    NOT_REALLOCATED = "channel not reallocated"
    MOVED_WRONGLY = "channel reallocated wrongly"
    HANGING = "channel at a dead group"
    RENUMBERED = "channel renumbered"
    NUMBER_TAKEN = "channel number used again"
    SPLIT_WRONGLY = "channel split wrongly"
    UNKNOWN_CHANNEL = "unknown channel"
    OUTCOME = "outcome is not that of the steps"
    # channels, protocols, messages
    ONE_END = "channel with one end"
    SECOND_CHANNEL = "second channel of a pair"
    NO_OWNER = "key without its owner"
    SILENT_CHANNEL = "channel without a protocol"
    NO_END = "no end of the channel"
    NO_OPENING = "conversation that nobody opens"
    NO_ROW = "act without a row"
    NEVER_SAID = "act that can never be said"
    NOT_ASKED_AGAIN = "lost and not asked again"
    NO_WAY_TO_THE_END = "conversation that cannot end"
    SENT_NOT_RECEIVED = "sent but never received"
    RECEIVED_NOT_SENT = "received but never sent"
    TWO_FORMS = "one act in two forms"
    MACRO_ACT = "macro act performed"
    NO_BUDGET = "no budget"
    # languages, interfaces
    NOT_ASKED = "query that nobody can ask"
    NO_ANSWER = "answer that nobody gives"
    NOT_OFFERED = "content that no interface takes"
    # design and code
    CODE = "design and code differ"
    NOT_SUPPORTED = "query not supported"
    # state machines
    NO_MACHINE = "agent without a state machine"
    UNREACHABLE = "state unreachable"
    NO_WAY_OUT = "state without a way out"
    DEAD_ARC = "arc never taken"
    BAD_ROW = "row that cannot be"
    NO_TALK = "protocol without a state"
    WAITS = "agents that wait for each other"
    PARAMETER = "parameter that cannot be"
    # recordings
    TOO_LARGE = "size budget exceeded"
    TOO_LATE = "latency budget exceeded"
    NO_CHANNEL = "traffic without a channel"
    NOT_DESIGNED = "traffic the design does not have"
    NEVER_HEARD = "never heard in the run"
    UNBALANCED = "messages that do not add up"


class Finding(msgspec.Struct, frozen=True):
    """Something inconsistent. `at`: the entry's path in the file; `line`: where that is, None: not
    known.
    """

    kind: StrEnum
    where: str
    wrong: str
    right: str
    at: Path_ = ()
    line: int | None = None

    def __str__(self) -> str:
        return f"{self.where}: {self.wrong}; {self.right}"


def located(findings: tuple[Finding, ...], text: str) -> tuple[Finding, ...]:
    """The same findings with their lines in the design file's `text`, in the file's order; all
    others after them.
    """
    if not text:
        return findings
    placed = [
        msgspec.structs.replace(one, line=line_of(text, one.at)) if one.at else one
        for one in findings
    ]
    return tuple(sorted(placed, key=lambda one: (one.line is None, one.line or 0)))
