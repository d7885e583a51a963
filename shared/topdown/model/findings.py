"""Findings of checks: name of the fault, place, fault, correction."""

from enum import StrEnum

import msgspec

from topdown.model.loading import Path_, line_of


class Kind(StrEnum):
    """The names of faults."""

    OLD_FORMAT = "older format"
    TWICE = "defined twice"
    UNDEFINED = "undefined"
    UNUSED = "unused"
    BAD_NAME = "name that cannot be"
    NO_INCLUDE = "include that cannot be"
    # requirements
    NO_TREE = "requirements are no tree"
    NOT_COVERED = "requirement not covered"
    NO_EVIDENCE = "evidence that cannot be"
    COVERED_TWICE = "requirement covered twice"
    CHILD_FIRST = "requirement before its parent"
    # steps
    NO_REQUIREMENT = "step without a requirement"
    DIVIDED_TWICE = "group divided twice"
    NEVER_INTRODUCED = "group never introduced"
    NO_TASK = "group without a task"
    SAME_TASK = "two groups with one task"
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
    ONE_KEY = "two signals with one key"
    KEY_LACKS = "key that lacks a word"
    NO_RECEIPT = "receipt that nobody may write"
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
    TOO_SMALL = "budget below the smallest message"
    OVER_BUDGET = "typical figure above its budget"
    BAD_FIGURE = "figure that cannot be"
    AT_ODDS = "fields that exclude each other"
    WITHIN_ITSELF = "opened within itself"
    NO_PART = "opened within a use of others"
    OUTLIVES = "durable within volatile"
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
    NEVER_HOLDS = "condition that never holds"
    RESERVED = "reserved word"
    NO_REST = "rest in the middle of work"
    NO_DEADLINE = "wait without an end"
    NEVER_TOLD = "peer that is never told"
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


MAY_FOLLOW = (
    frozenset((Kind.UNREACHABLE, Kind.NEVER_HOLDS, Kind.NO_REST, Kind.NEVER_TOLD, Kind.WAITS)),
    frozenset(
        (
            Kind.UNUSED,
            Kind.NOT_COVERED,
            Kind.NO_EVIDENCE,
            Kind.LEFT_OVER,
            Kind.SILENT_CHANNEL,
            Kind.NO_OPENING,
            Kind.NEVER_SAID,
            Kind.NO_WAY_TO_THE_END,
            Kind.SENT_NOT_RECEIVED,
            Kind.RECEIVED_NOT_SENT,
            Kind.NO_TASK,
            Kind.NOT_ASKED,
            Kind.NOT_OFFERED,
            Kind.NO_ANSWER,
            Kind.NO_TALK,
        )
    ),
)
"""Kinds of what never happens, then of what is not there: a wrong word elsewhere may have caused
them, and is told first.
"""


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
    """The same findings with their lines in the design file's `text`, in the file's order; those
    that may follow from another (MAY_FOLLOW) come last.
    """

    def follows(one: Finding) -> int:
        own = one.at[:1] == ("table",)  # all else of a use follows from its table
        ranks = (rank for rank, kinds in enumerate(MAY_FOLLOW, 1) if one.kind in kinds and not own)
        return next(ranks, 0)

    if not text:
        return tuple(sorted(findings, key=follows))
    placed = [
        msgspec.structs.replace(one, line=line_of(text, one.at)) if one.at else one
        for one in findings
    ]
    return tuple(sorted(placed, key=lambda one: (follows(one), one.line is None, one.line or 0)))
