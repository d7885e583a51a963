"""All three layers of the proof of a design, one verdict after the other.

Layer 1: the durable stream, and a physical act, in micro-steps. Layer 2: each use of a protocol
with copies and receipts explicit. Layer 3: the composed system of all agents' rows. Last stand the
simplifications of layer 3, and what is not proven. Must not know: how verdicts are printed, who
waits for them.
"""

from collections.abc import Callable, Collection, Iterator
from enum import StrEnum
from functools import partial
from typing import NamedTuple

from topdown.model.design import Design
from topdown.model.machines import machines
from topdown.prove.causes import causes
from topdown.prove.engine import WRONG, Exploration, Finding, Move, explore
from topdown.prove.fleet import ANY, Faults, Fleet, among_groups, composed, ruled
from topdown.prove.pairs import changed_channels, explore_use
from topdown.prove.stream import explore_stream

# --- Layer 1, besides: one physical act between an agent and the process that moves, in
# micro-steps, under any deaths The agent records the intent, commands the loop with the act's key
# in a slot, records the outcome, reports it. The loop begins what the slot says, once, and writes
# the phase there. After a death of the agent with an intent and no outcome the slot decides: this
# key is waited for or taken, anything else is an outcome `unknown`; a new loop has an empty slot. A
# command between intent and slot that is lost gives `unknown` as well: the act happens once at
# most, not exactly once.


AGENT, LOOP = "agent", "loop"


class Variant(StrEnum):
    """The scheme, and what one might have built instead."""

    RIGHT = "as designed"
    FORGETS = "the act is forgotten by a death"
    BEGINS_AGAIN = "the act is begun again after a death"
    MOVES_FIRST = "commanded before the intent is recorded"
    ASSUMES_DONE = "taken for done after a death"


class At(StrEnum):
    """The agent's next action (RAM)."""

    IDLE = "idle"
    INTENDS = "has recorded the intent"
    COMMANDED = "has commanded, and recorded nothing"
    WAITS = "waits for the loop"
    KNOWS = "has recorded the outcome"
    TOLD = "has reported"
    FORGOTTEN = "knows of no act"


class Phase(StrEnum):
    """The slot's content for this act's key."""

    EMPTY = "empty"
    WANTED = "wanted"
    RUNS = "runs"
    DONE = "done"


NOTHING, INTENT, DONE, UNKNOWN = "nothing", "intent", "done", "unknown"


class Place(NamedTuple):
    """State of the whole. `journal` is on disk; `begun`: how often the arm began; `ended`: it came
    to the act's end.
    """

    agent: At = At.IDLE
    journal: str = NOTHING
    slot: Phase = Phase.EMPTY
    begun: int = 0
    ended: bool = False


class ActModel:
    """The model, for engine.explore."""

    def __init__(self, variant: Variant = Variant.RIGHT) -> None:
        self.variant, self.start = variant, Place()

    def moves(self, state: Place) -> Iterator[Move]:
        """Of agent and loop, then the deaths of each."""
        yield from self._agent(state)
        if state.slot is Phase.WANTED:
            runs = state._replace(slot=Phase.RUNS, begun=state.begun + 1)
            yield Move(LOOP, "begins the act", runs)
        elif state.slot is Phase.RUNS:
            yield Move(LOOP, "ends the act", state._replace(slot=Phase.DONE, ended=True))
        yield Move(AGENT, "dies and comes back", self._restored(state), fault=True)
        if state.slot is not Phase.EMPTY:
            yield Move(LOOP, "dies and comes back", state._replace(slot=Phase.EMPTY), fault=True)

    def at_rest(self, state: Place) -> bool:
        """The outcome is told."""
        return state.agent is At.TOLD

    def wrong(self, state: Place) -> str:
        """Twice, or a lie."""
        if state.begun > 1:
            return "the act was begun twice"
        lies = state.agent is At.TOLD and state.journal == DONE and not state.ended
        return "an act is told as done that was not" if lies else ""

    def describe(self, state: Place) -> dict[str, str]:
        """For drawings."""
        return {AGENT: f"{state.agent}; journal: {state.journal}", LOOP: f"slot: {state.slot}"}

    def _agent(self, state: Place) -> Iterator[Move]:
        match state.agent:
            case At.IDLE if self.variant is Variant.MOVES_FIRST:
                begun = state._replace(agent=At.COMMANDED, slot=Phase.WANTED)
                yield Move(AGENT, "takes the request; act -> loop", begun)
            case At.IDLE:
                intends = _recorded(state, At.INTENDS, INTENT)
                yield Move(AGENT, "takes the request, records the intent", intends)
            case At.COMMANDED:
                yield Move(AGENT, "records the intent", _recorded(state, At.WAITS, INTENT))
            case At.INTENDS:
                yield Move(AGENT, "act -> loop", state._replace(agent=At.WAITS, slot=Phase.WANTED))
            case At.WAITS if state.slot is Phase.DONE:
                yield Move(AGENT, "done <- loop; records it", _recorded(state, At.KNOWS, DONE))
            case At.WAITS if state.slot is Phase.EMPTY:
                knows = _recorded(state, At.KNOWS, UNKNOWN)
                yield Move(AGENT, "finds a new loop; records unknown", knows)
            case At.KNOWS:
                yield Move(AGENT, f"reports {state.journal}", state._replace(agent=At.TOLD))

    def _restored(self, state: Place) -> Place:
        """Moves of the agent after a death, by its journal and the slot."""
        if state.journal == NOTHING:
            return state._replace(agent=At.IDLE)
        if state.journal != INTENT:
            return state._replace(agent=At.KNOWS if state.agent is not At.TOLD else At.TOLD)
        match self.variant:
            case Variant.FORGETS:
                return state._replace(agent=At.FORGOTTEN)
            case Variant.BEGINS_AGAIN:
                return state._replace(agent=At.INTENDS)
            case Variant.ASSUMES_DONE:
                return _recorded(state, At.KNOWS, DONE)
        return state._replace(agent=At.WAITS)


def _recorded(state: Place, then: At, word: str) -> Place:
    return state._replace(agent=then, journal=word)


def explore_act(variant: Variant = Variant.RIGHT) -> Exploration:
    """Everything that can happen to an act; where something is wrong, the shortest way there."""
    return explore(ActModel(variant))


# --- All three layers of the proof of a design, one verdict after the other -----------------------


LAYERS = (1, 2, 3)
Progress = Callable[[int, int], None]


class Verdict(NamedTuple):
    """`faults` None: any number. `open`: what is not proven though nothing was found. `notes`:
    nothing wrong. `beyond`: what this design may do and the model leaves out.
    """

    layer: int
    what: str
    faults: int | None
    states: int
    edges: int
    seconds: float
    findings: tuple[Finding, ...]
    open: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    beyond: tuple[str, ...] = ()
    cpu_s: float = 0.0

    @property
    def holds(self) -> bool:
        """Nothing was found, and nothing is open."""
        return not self.findings and not self.open


class Task(NamedTuple):
    """A verdict to be had; `run(progress)` works it out."""

    layer: int
    what: str
    run: Callable[[Progress | None], Verdict]


def tasks(
    design: Design,
    *,
    faults: int | None = 1,
    layers: Collection[int] = LAYERS,
    step: int | None = None,
    gone: Collection[str] = (),
    seconds: float | None = None,
    skip_start: bool = False,
    alone: bool = False,
) -> Iterator[Task]:
    """The proofs to run, in order. `step`: only channels which that step of the design created or
    changed (layer 2). `gone`: agents that may die for good, besides. `seconds` of CPU time limit
    each. `skip_start`: the start of all agents is not explored by itself. `alone`: in layer 3, not
    all agents together, but each by itself, and those of each rule. Raises NoSuchEntry, IndexError,
    ValueError.
    """
    channels = None if step is None else changed_channels(design, step)
    if 1 in layers and step is None:
        if any(use.durable for use in design.file.protocol):
            yield _micro("durable stream", explore_stream)
        if any(row.moves for agent in design.file.agent for row in agent.row):
            yield _micro("physical act", explore_act)
    if 2 in layers:
        for use in design.file.protocol:
            if use.follows in design.tables and (channels is None or use.channel in channels):
                what = f"{use.channel} {use.name}"
                yield Task(2, what, partial(_pair, design, what, use.name, faults, seconds))
    if 3 in layers and step is None and alone:
        for kept in _kept(design):
            what = f"{' and '.join(kept)} alone"
            # from the boot on: where all rest first depends on all of them
            wish = Faults(ANY if faults is None else faults, boot=True)
            yield Task(3, what, partial(_alone, design, what, kept, wish, seconds))
    elif 3 in layers and step is None:
        wishes = {} if skip_start else {"all agents, starting": Faults(0, boot=True)}
        wishes["all agents"] = Faults(ANY if faults is None else faults)
        for name in gone:
            dead = Faults(0, gone=name, waiting=waiting(design, name))
            wishes[died(name)] = dead
        for what, wish in wishes.items():
            yield Task(3, what, partial(_fleet, design, what, wish, seconds))


def died(name: str) -> str:
    """`Verdict.what` where an agent may die for good."""
    return f"{name} dies for good"


def _verdict(
    layer: int,
    what: str,
    faults: int | None,
    found: Exploration,
    *loud: str,
    notes: tuple[str, ...] = (),
    beyond: tuple[str, ...] = (),
) -> Verdict:
    """What an exploration says; `loud`: what else is open where nothing was found."""
    unproven = (found.unproven,) if found.unproven and not found.findings else ()
    counts = found.states, found.edges, found.seconds
    unsure, cpu_s = (*unproven, *loud), found.cpu_s
    return Verdict(layer, what, faults, *counts, found.findings, unsure, notes, beyond, cpu_s)


def _micro(what: str, explored: Callable[[], Exploration]) -> Task:
    return Task(1, what, lambda _: _verdict(1, what, None, explored()))


def _pair(
    design: Design,
    what: str,
    use: str,
    faults: int | None,
    seconds: float | None,
    _: Progress | None,
) -> Verdict:
    result = explore_use(design, use, faults, seconds=seconds)
    notes = tuple(f"never reached: {state}" for state in result.unreached)
    return _verdict(2, what, faults, result.exploration, notes=notes)


def _fleet(
    design: Design, what: str, faults: Faults, seconds: float | None, progress: Progress | None
) -> Verdict:
    most = None if faults.most == ANY else faults.most
    silent = [name for name, machine in machines(design).items() if not machine.rows]
    if silent:
        missing = f"agents without rows cannot be composed: {', '.join(silent)}"
        return Verdict(3, what, most, 0, 0, 0.0, (), (missing,))
    fleet = Fleet(design, faults)
    found = explore(fleet, seconds=seconds, progress=progress)
    told = tuple(one._replace(causes=causes(fleet, one)) for one in found.findings)
    found = found._replace(findings=told)
    loud = fleet.not_silent() if not found.findings else ()
    whole = not (faults.gone or faults.boot or found.findings)
    notes, beyond = (fleet.unused(), fleet.endless()) if whole else ((), ())
    return _verdict(3, what, most, found, *loud, notes=notes, beyond=beyond)


def _kept(design: Design) -> Iterator[tuple[str, ...]]:
    """Each agent with rows, then the agents of each rule that is about several."""
    yield from ((one.name,) for one in design.file.agent if one.row)
    together = (tuple(sorted(ruled(rule))) for rule in design.file.never)
    yield from dict.fromkeys(names for names in together if len(names) > 1)


def _alone(
    design: Design,
    what: str,
    kept: tuple[str, ...],
    faults: Faults,
    seconds: float | None,
    progress: Progress | None,
) -> Verdict:
    """Safety of some agents: nothing unforeseen, no act twice, no rule broken, whatever the others
    say.
    """
    fleet = Fleet(among_groups(design, kept), faults)
    found = explore(fleet, seconds=seconds, progress=progress, first=False)
    wrong = tuple(one for one in found.findings if one.kind == WRONG)
    loud = fleet.not_silent() if not wrong else ()
    most = None if faults.most == ANY else faults.most
    return _verdict(3, what, most, found._replace(findings=wrong), *loud, beyond=(ALONE,))


ALONE = (
    "with --alone: deadlocks, whether rest can be reached, and how long queues get; and a finding"
    " may need messages that the other agents never send"
)


def waiting(design: Design, gone: str) -> tuple[str, ...]:
    """All agents that must come to rest though `gone` never comes back: those that persons talk to,
    or, where persons talk to none, all the others. Raises NoSuchEntry; ValueError where persons
    talk to `gone` alone.
    """
    composed(design).agent(gone)
    agents = design.file.agent
    told = [one.name for one in agents if any(row.on.startswith("person ") for row in one.row)]
    left = tuple(name for name in told or design.agents if name != gone)
    if not left:
        wrong = (
            f"--gone {gone}: {gone} alone has `person` rows, so nobody is left whose wish could end"
        )
        others = ", ".join(name for name in design.agents if name != gone)
        raise ValueError(f"{wrong}; name another agent: {others or 'there is none'}")
    return left


# --- Simplifications of the composed model: why each is safe, and the evidence for it -------------
# `roco design verify --long` prints this table; a reader who doubts a verdict begins here.


class Abstraction(NamedTuple):
    """`what` is done to the running system to get the model; `why` no error is hidden by it;
    `shown` by what.
    """

    what: str
    why: str
    shown: str


ABSTRACTIONS = (
    Abstraction(
        "contents of messages are dropped",
        "a row offers every reaction that some content may cause, so the model does more than the"
        " agents, never less",
        "each step of a running agent is compared with its rows (topdown.judge.steps)",
    ),
    Abstraction(
        "words that change nothing (progress told and confirmed) are not sent",
        "their receiver stands as before after taking them, in every state in which they may come",
        "topdown.prove.parts, and Fleet.not_silent after the exploration, over every state that was"
        " reached",
    ),
    Abstraction(
        "words under `may` are not said",
        "they are such silent words, or questions of whose answer nobody waits",
        "the design's author; checked are tables (a row for the answer in the state that follows)"
        " and running steps",
    ),
    Abstraction(
        "a durable stream is an ideal FIFO queue",
        "numbered, journalled, re-sent: nothing is lost, doubled or overtaken, whatever dies",
        "layer 1, under any number of faults; layer 2 with copies and receipts explicit",
    ),
    Abstraction(
        "a death and the coming back are one step, and faults are explored from rest",
        "while an agent is down its queues only wait; the start of all agents is explored by"
        " itself, without faults",
        "layers 1 and 2 let a side die between any two of its micro-steps",
    ),
    Abstraction(
        "a volatile channel is a set of words; what belongs to a question given up is dropped at"
        " once",
        "copies of one word do the same; a late answer is dropped by the conversation's id whenever"
        " it comes",
        "layer 2, volatile: copies explicit",
    ),
    Abstraction(
        "a question is asked again only when nothing of it is on its way",
        "asking earlier makes copies, and copies are explored as faults",
        "layer 2, volatile",
    ),
    Abstraction(
        "the receipt of an observation comes with its taking, or is lost",
        "a receipt that comes later is an observation taken later: until then it is owed in both",
        "layer 2, latest: receipts explicit",
    ),
    Abstraction(
        "one observation stands for all subjects",
        "what is owed is a yes or no to whoever waits for all of it; no order among subjects is"
        " relied on",
        "agent_runtime: observations of every subject are kept and re-sent alike"
        " (tests/agent_runtime)",
    ),
    Abstraction(
        "a group says anything that the tables of its uses and the acts of its messages allow, at"
        " any time",
        "it does more than any group that keeps to its tables; nobody may wait for what it opens or"
        " calls off",
        "topdown.prove.fleet; each row that a group's word needs is taken away"
        " (tests/topdown/test_proving_groups.py)",
    ),
    Abstraction(
        "a wait may be over at any time, and no time passes",
        "every order of ends of waits and messages is explored, so no duration is relied on",
        "by construction; nothing is said of durations",
    ),
)

NOT_PROVEN = (
    (
        "several conversations of one use at a time (rows marked `several`): several commands,"
        " parallel plans"
    ),
    "not-understood in the composed system; each protocol is explored with it alone",
    "durations, fairness of the scheduler, and loops of a plan (next act, new plan) that never end",
    "a journal that is lost or lies; a process that hangs and does not die",
    "waits of a publisher for a subscriber that is gone for good (`late` of a latest use)",
    (
        "that what is named happens: a worker that says nothing after a death, a message left in"
        " the inbox for ever"
    ),
    (
        "a volatile question that was given up, or is older than its reply-by, and reaches a server"
        " that is slow to answer"
    ),
    (
        "a peer that seems to come back though it never died (the router was away), but for what"
        " its death brings about"
    ),
    (
        "how long a queue gets by words that change nothing (progress), which are not sent in the"
        " model: the bound is proven for all other words; a full outbox holds the sender back"
    ),
    "that a group (an end that the design gives no rows) answers what it is asked, sooner or later",
    (
        "two agents whose outboxes are full towards each other, which only many reports that nobody"
        " asked for bring about"
    ),
)
"""Limits: properties that no layer covers."""
