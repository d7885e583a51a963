"""Lines of live.jsonl, by which people's tools follow a run; the monitor writes them."""

import msgspec


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
