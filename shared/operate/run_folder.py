"""Exchanges of people's tools with the fleet outside the protocol: files of a run folder.

None of it is a communicate. docs/run-folder.md says who writes which file. Names
and types only: files are read and written in the rooms that use them.
"""

from enum import StrEnum
from typing import Any, TypeVar

import msgspec

LATEST = "latest"  # runs/latest: symbolic link to the newest run folder
FLEET_FILE = "fleet.json"
# held (flock) by the supervisor as long as it lives, with its pid in it
LOCK_FILE = "supervisor.lock"
LIVE_FILE = "live.jsonl"
VERDICTS_FILE = "verdicts.jsonl"
TRAFFIC_FILE = "traffic.mcap"
STEPS = "steps"  # folder of the agents' step logs, and the ending of their names
REPORT_FILE = "report.json"
RRD_FILE = "run.rrd"
VIEW_FILE = "view.json"
FAULTS_FILE = "faults.jsonl"
# <name>.off: the supervisor keeps this process down as long as the file is there
OFF_SUFFIX = ".off"


S = TypeVar("S", bound=msgspec.Struct)


def alike(kind: type[S], one: object, /, **more: Any) -> S:
    """A Struct of this kind with the fields that it shares with another object, and `more`."""
    names = (name for name in kind.__struct_fields__ if name not in more and hasattr(one, name))
    return kind(**{name: getattr(one, name) for name in names}, **more)


class NothingToRead(Exception):
    """There is nothing to work on where it was looked for; the message says what would be right."""


class _Line(msgspec.Struct, frozen=True, tag_field="kind", tag=True, omit_defaults=True):
    """One line of live.jsonl, written by the monitor. `t`: unix time [s]."""

    t: float


class Sent(_Line, frozen=True):
    """A communicate went by; `bytes`: its whole size; `text`: its content in a few words, where
    that helps a person.

    `id` to `use` are what it can be judged by afterwards: m_w, m_t, t_b, LANGUAGE.Class of its
    content, and which use of its performative that makes.
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
    """A communicate that is not as designed: `verdict` (topdown.judge.verdicts.Verdict), and
    why.
    """

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


class Task(msgspec.Struct, frozen=True):
    """What a plan is for: the name of the task, and its arguments."""

    name: str
    arguments: tuple[str, ...] = ()


class Step(msgspec.Struct, frozen=True, omit_defaults=True):
    """A state of a plan. `path`: names of states from below the root to it, an id that nobody takes
    apart.

    `does`: what is done there, with which `things` and which hand (`side`); "" where it is no step.
    `act`: class of the act by which a leaf does it; "" for none.
    """

    path: tuple[str, ...]
    does: str = ""
    things: tuple[str, ...] = ()
    side: str = ""
    act: str = ""


class PlanSeen(_Line, frozen=True):
    """A plan left pl: its id, its tasks, and all its states in the order of the tree."""

    plan: str
    tasks: tuple[Task, ...]
    states: tuple[Step, ...]


class PlanAt(_Line, frozen=True):
    """ta entered this state of the plan, or ended the plan with `outcome`."""

    at: Step | None = None
    outcome: str = ""


class Happened(_Line, frozen=True):
    """An event worth a line for a person: what happened, to which things, numbers or outcomes;
    `text`: why.

    `again`: other lines tell it, too.
    """

    name: str
    of: tuple[str, ...] = ()
    text: str = ""
    again: bool = False


LiveLine = Sent | Again | Against | AgentIn | PlanSeen | PlanAt | Happened


class Judged(msgspec.Struct, frozen=True, omit_defaults=True):
    """One line of verdicts.jsonl, written by the monitor: a communicate as it was judged
    (topdown.judge.verdicts).

    `t`: when it was heard [unix s]; a line may come later than others that were heard later.
    `initiator` and `participant`: their states after it. `text`: its content in a few words. `key`:
    only where it is not the design's. `violation`: the verdict is against the design.
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


class Dead(StrEnum):
    """Reasons why nobody took a communicate."""

    NO_RECEIVER = "no such receiver"
    NO_RIGHT = "not in the design"
    """Its sender may not say this to that receiver."""
    NO_COMMUNICATE = "no communicate"
    TOO_LARGE = "too large"
    TURNED_AWAY = "turned away"
    """Its receiver does not know the sender or the number, or had too much waiting."""
    NOT_UNDERSTOOD = "not understood"
    OVER = "conversation over"
    """Its receiver has no such conversation, or that has ended."""
    NOT_HEARD = "not heard"
    """A volatile one, sent, that never reached its receiver."""
    NOT_RECEIPTED = "not receipted"
    """A durable one that its sender still keeps: it was not taken up to now, or up to the end of
    the run.
    """


class DeadLetter(msgspec.Struct, frozen=True, omit_defaults=True):
    """A communicate that nobody took. `t`: when it was sent, or turned away [unix s]; `why`: in
    words.

    `bytes` 0: not known. `text`: its content in a few words.
    """

    t: float
    reason: Dead
    why: str
    sender: str = ""
    receiver: str = ""
    protocol: str = ""
    performative: str = ""
    conversation: str = ""
    id: str = ""
    bytes: int = 0
    text: str = ""
    key: str = ""


class Fault(msgspec.Struct, frozen=True, omit_defaults=True, kw_only=True):
    """One line of faults.jsonl, written by `roco fault`: a fault on purpose. A later line replaces
    those of its id.

    `t`: when the line was written; `began`: 0 while it waits for its moment `at`; `ended`: None
    while it goes on [unix s]. `text`: what came of it. `pid`, `start`: the process that was hit,
    and when that started [ticks after boot]. `by`, `by_start`: the command that heals it, likewise;
    where it is gone, the next `roco fault list` or `heal` does. `amount`, `speaker`: of kinds that
    have one (docs/faults.md). `neighbour`: of a fault of one link, whom that leads to. `what`: of a
    kind that only this system has, what is done to which part, in words; `target` is then the
    process that does it.
    """

    id: str
    kind: str
    target: str
    t: float
    began: float = 0.0
    ended: float | None = None
    at: str = ""
    text: str = ""
    pid: int = 0
    start: int = 0
    by: int = 0
    by_start: int = 0
    amount: float = 0.0
    speaker: str = ""
    neighbour: str = ""
    what: str = ""

    @property
    def wire(self) -> str:
        """The name of the wires that it is done to: all of the target, or its link with a
        neighbour, as co-pl.
        """
        return f"{self.target}-{self.neighbour}" if self.neighbour else self.target

    @property
    def words(self) -> str:
        """Kind and target, amount, speaker and moment: "delay pl by 0.2 at pl:searching"."""
        by = f" by {self.amount:g}" if self.amount else ""
        of = f" as {self.speaker}" if self.speaker else ""
        return f"{self.kind} {self.what or self.wire}{by}{of}{f' at {self.at}' if self.at else ''}"


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

    `entry`, `project`: the system (operate.system): `module:NAME`, and the folder it is imported
    from. `agents`: where each agent is reached.
    """

    system: str
    connect: str
    supervisor: int
    started: float
    processes: tuple[ProcessStatus, ...]
    entry: str = ""
    project: str = ""
    agents: dict[str, str] = {}


class ViewAddress(msgspec.Struct, frozen=True):
    """view.json, written by the monitor: where Rerun's pictures of this run are served (gRPC), and
    its page (HTTP).
    """

    grpc: int
    web: int


class ExperimentSetting(msgspec.Struct, frozen=True):
    """experiment.json: what is repeated, with which seeds, and where. `timeout_s`: wall time of one
    run; `most_load`: a run waits until the machine's load is not above it, 0: it does not. A file
    of another version may lack a field.
    """

    task: str = ""
    runs: int = 0
    seed: int = 0
    speed: str = ""
    scene: str = ""
    timeout_s: float = 0.0
    most_load: float = 0.0
    began: float = 0.0
    version: str = ""
    commit: str = ""
    machine: str = ""
    cores: int = 0
    python: str = ""
