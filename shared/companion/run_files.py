"""The files of a run folder that only this system has: the loop's slots, a_hi's address; and a_hi's words over HTTP.

docs/http.md is the contract of a_hi, docs/run-folder.md says which process writes which file. Names and types only.
"""

import msgspec

HI_FILE = "hi.json"
REFUSED = "refused"
"""The state of a line on a sentence that never became a task."""
SLOTS_FILE = "loop.slots"  # where ex's agent and its loop meet


class HiAddress(msgspec.Struct, frozen=True):
    """hi.json (mode 0600), written by hi once it listens on 127.0.0.1."""

    port: int
    token: str


class Say(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """POST /say: a sentence of a person."""

    text: str


class Cancel(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """POST /cancel: this task, or with "" the oldest one that has not ended."""

    task: str = ""


class TaskLine(msgspec.Struct, frozen=True, omit_defaults=True):
    """A task as hi knows it. `state`: a companion.languages.cmd.TaskState, or REFUSED."""

    task: str
    state: str
    text: str
    said: str = ""
    since: float = 0.0


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
