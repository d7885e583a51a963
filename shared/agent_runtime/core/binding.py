"""Makes a running agent of a design: its table of states with Python bound by name, and its wiring
to the others.

A design file says which behaviour a state has, which conditions end it and label its arcs, which
protocols join whom; code says what the behaviours and conditions do. Every name must be bound, and
no other. Must not know: any system, what any agent does, Zenoh. The only module of this room that
sees topdown.
"""

from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import Any, TypeVar

from agent_runtime.core.agent import Agent, Arc, Behaviour, Rows, Taken, everything, never
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery, Link, Wiring
from fipa_codec.languages import Languages
from fipa_codec.tables import Role
from topdown.judge.steps import Steps
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.parameters import Parameters

M = TypeVar("M")
Transition = Callable[[M, Turn], M]
Condition = Callable[[M], bool]
Takes = Callable[[M, Taken], bool]


class BindingError(Exception):
    """`agent`'s Python does not fit the design: `missing` names of `kind` that nothing is bound to,
    `extra` ones.
    """

    def __init__(self, agent: str, kind: str, missing: Iterable[str], extra: Iterable[str]) -> None:
        self.agent, self.kind = agent, kind
        self.missing, self.extra = tuple(sorted(missing)), tuple(sorted(extra))
        lacks = f"nothing is bound to {', '.join(self.missing)}; " if self.missing else ""
        knows_not = f"the design has no {', '.join(self.extra)}; " if self.extra else ""
        super().__init__(
            f"{kind} of agent {agent!r}: {lacks}{knows_not}bind exactly the names of the design"
            " file"
        )


def bind(
    name: str,
    memory: M,
    behaviours: Mapping[str, Transition[M]],
    conditions: Mapping[str, Condition[M]],
    *,
    design: Design,
    takes: Mapping[str, Takes[M]] | None = None,
    local: Any = None,
) -> Agent[M]:
    """The agent `name` of `design`.

    `behaviours`: behaviour name -> transition, for all of its states. `conditions`: name ->
    predicate of the memory, for all terminal, error and initial conditions. `takes`: behaviour name
    -> which events it takes; a behaviour without one takes everything. `local`: union of the
    Structs that Local carries. Raises BindingError, and topdown's NoSuchEntry for an agent that is
    not in the design.
    """
    entry, kept = design.agent(name), takes or {}
    wanted = {state.behaviour for state in entry.state}
    _require(name, "behaviours", wanted, behaviours)
    _require(name, "conditions", design.conditions(name), conditions)
    _require(name, "takes", wanted & kept.keys(), kept)
    return Agent(
        name=name,
        start=entry.initial,
        memory=memory,
        behaviours={
            state.name: Behaviour(
                transition=behaviours[state.behaviour],
                terminal=conditions[state.terminal],
                error=conditions[state.error] if state.error else never,
                takes=kept.get(state.behaviour, everything),
            )
            for state in entry.state
        },
        arcs=tuple(Arc(arc.source, arc.target, arc.when) for arc in entry.arc),
        conditions=dict(conditions),
        local=local,
        rows=_rows(design, name),
        parameters=Parameters(entry),
    )


def wiring(name: str, system: str, *, design: Design, languages: Languages) -> Wiring:
    """The wiring of agent `name` of `design` in the system called `system` (the prefix of its
    keys).

    `languages`: those of the design, by name. Raises topdown's NoSuchEntry for an agent that is not
    in the design.
    """
    design.agent(name)
    uses = [use for use in design.file.protocol if name in (use.initiator, use.participant)]
    links = tuple(_link(name, use, design) for use in uses)
    heard = (use for use in design.guest_uses.values() if use.participant == name)
    guests = {use.initiator: use.channel for use in heard}
    return Wiring(system, name, links, languages, guests)


@cache
def _rows(design: Design, name: str) -> Rows | None:
    """The agent's rows in the design; None where it has none, then its steps are not compared."""
    machine = Steps(design, name)
    return machine if machine.rows else None


def _require(agent: str, kind: str, wanted: Iterable[str], bound: Iterable[str]) -> None:
    missing, extra = set(wanted) - set(bound), set(bound) - set(wanted)
    if missing or extra:
        raise BindingError(agent, kind, missing, extra)


def _link(name: str, use: elements.Protocol, design: Design) -> Link:
    initiates = name == use.initiator
    peer = use.participant if initiates else use.initiator
    rules = [rule for rule in design.rules.values() if rule.use == use.name]
    kept = Delivery.LATEST if use.latest else Delivery.VOLATILE
    return Link(
        peer=peer,
        channel=use.channel,
        protocol=use.follows,
        role=Role.INITIATOR if initiates else Role.PARTICIPANT,
        delivery=Delivery.DURABLE if use.durable else kept,
        ontology=use.ontology,
        silent=_silent(name, use),
        use=use.name,
        awaited=peer in design.agents,
        says={rule.performative: rule.contents for rule in rules if rule.sender == name},
        hears={rule.performative: rule.contents for rule in rules if rule.sender == peer},
    )


def _silent(name: str, use: elements.Protocol) -> str:
    """The language of the agent's acts without content: its first language where every act has
    content.
    """
    mine = [message for message in use.message if message.sender == name]
    bare = (message.language for message in (*mine, *use.message) if not message.content)
    return next(bare, mine[0].language)
