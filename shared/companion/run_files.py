"""The files of a run folder that only this system has: the loop's slots, a_hi's address; and a_hi's words over HTTP.

docs/http.md is the contract of a_hi, docs/run-folder.md says which process writes which file. Names and types only.
"""

from typing import Annotated

import msgspec

HI_FILE = "hi.json"
REFUSED = "refused"
"""The state of a line on a sentence that never became a task."""
QUESTION, ANSWERED = "question", "answered"
"""The state of a line that asks back, so that no task came of the sentence yet, and of one that answers a question."""
STOPPED, RELEASED = "stopped", "released"
"""The state of a line on a stop, which no agent needs to hear of, and on its end."""
HELD = "stopped: the loop holds the robot until `roco release`"
LET_GO = "released: the loop leaves the stop by its own rules"
LONGEST_WITHIN_S = 86_400.0
"""Until the deadline of a task, or its time to begin; estimate: who says more means neither."""
SLOTS_FILE = "loop.slots"  # where ex's agent and its loop meet


class HiAddress(msgspec.Struct, frozen=True):
    """hi.json (mode 0600), written by hi once it listens on 127.0.0.1."""

    port: int
    token: str


class Say(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """POST /say: a sentence. `urgency`: higher comes first; `within_s`, `later_s`: seconds until it should be done, and
    until it may begin, 0 for none.
    """

    text: str
    urgency: Annotated[int, msgspec.Meta(ge=0, le=9)] = 0
    within_s: Annotated[float, msgspec.Meta(ge=0, le=LONGEST_WITHIN_S)] = 0.0
    later_s: Annotated[float, msgspec.Meta(ge=0, le=LONGEST_WITHIN_S)] = 0.0


class Cancel(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """POST /cancel: this task, or with "" the oldest one that has not ended."""

    task: str = ""


class TaskLine(msgspec.Struct, frozen=True, omit_defaults=True):
    """A task as hi knows it. `state`: a companion.languages.cmd.TaskState, or one of the words above.

    `then`: the tasks that follow, where a sentence has several wishes. `accepted`: the coordinator took it.
    """

    task: str
    state: str
    text: str
    said: str = ""
    since: float = 0.0
    then: tuple[str, ...] = ()
    accepted: bool = False


class Tasks(msgspec.Struct, frozen=True):
    """GET /tasks: all tasks of this run, oldest first."""

    tasks: tuple[TaskLine, ...]


class HiEvent(msgspec.Struct, frozen=True, omit_defaults=True):
    """Something hi tells people; `n` counts from 1 without gaps. `t`: unix time [s]."""

    n: int
    t: float
    agent: str
    name: str
    text: str
    task: str = ""


class Events(msgspec.Struct, frozen=True):
    """GET /events: events with n > since; `next` is what to ask with the next time."""

    next: int
    events: tuple[HiEvent, ...]


class Problem(msgspec.Struct, frozen=True):
    """Body of every answer that is not 200: what was wrong and what would have been right."""

    error: str
