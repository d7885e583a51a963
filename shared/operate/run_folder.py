"""Exchanges of people's tools with the fleet outside the protocol: files of a run folder, hi's words over HTTP.

None of it is a communicate. docs/run-folder.md says who writes which file, docs/http.md is the contract of hi. Names
and types only: files are read and written in the rooms that use them.
"""

from enum import StrEnum

import msgspec

LATEST = "latest"  # runs/latest: symbolic link to the newest run folder
FLEET_FILE = "fleet.json"
LIVE_FILE = "live.jsonl"
VERDICTS_FILE = "verdicts.jsonl"
TRAFFIC_FILE = "traffic.mcap"
REPORT_FILE = "report.json"
RRD_FILE = "run.rrd"
VIEW_FILE = "view.json"
OFF_SUFFIX = ".off"  # <name>.off: the supervisor keeps this process down as long as the file is there


class _Line(msgspec.Struct, frozen=True, tag_field="kind", tag=True, omit_defaults=True):
    """One line of live.jsonl, written by the monitor. `t`: unix time [s]."""

    t: float


class Sent(_Line, frozen=True):
    """A communicate went by; `bytes`: its whole size; `text`: its content in a few words, where that helps a person.

    `id` to `use` are what it can be judged by afterwards: m_w, m_t, t_b, LANGUAGE.Class of its content, and which use
    of its performative that makes.
    """

    channel: str
    sender: str
    receiver: str
    protocol: str
    performative: str
    bytes: int
    language: str = ""
    conversation: str = ""
    text: str = ""
    id: str = ""
    reply_with: str = ""
    in_reply_to: str = ""
    reply_by: float | None = None
    sent: float = 0.0
    ontology: str = ""
    content: str = ""
    use: str = ""


class Again(_Line, frozen=True):
    """A re-sent copy of this communicate was heard."""

    sender: str
    receiver: str
    id: str


class Against(_Line, frozen=True):
    """A communicate that is not as designed: `verdict` (topdown.judge.verdicts.Verdict), and why."""

    verdict: str
    channel: str
    sender: str
    receiver: str
    performative: str
    why: str


class AgentIn(_Line, frozen=True):
    """An agent (or the loop) entered a state of its FSM; `alive` False: its token is gone."""

    agent: str
    state: str
    alive: bool = True
    incarnation: int = 0


class PlanSeen(_Line, frozen=True):
    """A plan left pl: its id and all its states as paths "machine/state", in the order of the tree."""

    plan: str
    task: str
    states: tuple[str, ...]


class PlanAt(_Line, frozen=True):
    """ta entered this state of the plan (path as in PlanSeen), or ended the plan with `outcome`."""

    at: str
    outcome: str = ""


class Happened(_Line, frozen=True):
    """An event worth a line for a person: jar grasped, plan 2 ready, bowl on the table."""

    name: str
    text: str = ""


LiveLine = Sent | Again | Against | AgentIn | PlanSeen | PlanAt | Happened


class Judged(msgspec.Struct, frozen=True, omit_defaults=True):
    """One line of verdicts.jsonl, written by the monitor: a communicate as it was judged (topdown.judge.verdicts).

    `t`: when it was heard [unix s]; a line may come later than others that were heard later. `initiator` and
    `participant`: their states after it. `text`: its content in a few words. `key`: only where it is not the design's.
    `violation`: the verdict is against the design.
    """

    t: float
    verdict: str
    bytes: int
    channel: str = ""
    sender: str = ""
    receiver: str = ""
    protocol: str = ""
    performative: str = ""
    conversation: str = ""
    id: str = ""
    language: str = ""
    text: str = ""
    initiator: str = ""
    participant: str = ""
    why: str = ""
    key: str = ""
    violation: bool = False


class ProcessState(StrEnum):
    """A process as the supervisor sees it."""

    WAITING = "waiting"
    STARTING = "starting"
    READY = "ready"
    BACKING_OFF = "backing-off"
    STOPPING = "stopping"
    STOPPED = "stopped"
    GIVEN_UP = "given-up"


class ProcessStatus(msgspec.Struct, frozen=True, omit_defaults=True):
    """One process: its pid (0: none), how often it was restarted, why it ended last.

    `optional`: the others do not need it. `module`: what Python runs.
    """

    name: str
    state: ProcessState
    pid: int = 0
    restarts: int = 0
    note: str = ""
    optional: bool = False
    module: str = ""


class Fleet(msgspec.Struct, frozen=True):
    """fleet.json, rewritten whole by the supervisor whenever something changes.

    `entry`, `project`: the system (operate.system): `module:NAME`, and the folder it is imported from.
    """

    system: str
    connect: str
    supervisor: int
    started: float
    processes: tuple[ProcessStatus, ...]
    entry: str = ""
    project: str = ""


class ViewAddress(msgspec.Struct, frozen=True):
    """view.json, written by the monitor: where Rerun's pictures of this run are served (gRPC), and its page (HTTP)."""

    grpc: int
    web: int
