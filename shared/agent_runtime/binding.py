"""From a design to a runnable agent: its wiring from the rules of its messages, its table from its states and arcs.

The design is seen by its shape only (`topdown.design.Design` has it), so this package imports neither the method nor a
system. An agent binds Python functions to the names of the design: behaviours by their name, conditions by theirs; a
name too few or too many is an error at the start, not in the middle of a run.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from agent_runtime.agent import Agent, Arc, Behaviour, Taken, everything, never
from agent_runtime.errors import AgentTableError
from agent_runtime.wiring import Delivery, Link, Wiring
from fipa_codec.languages import Languages
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role

if TYPE_CHECKING:
    from agent_runtime.turn import Turn

M = TypeVar("M")


class RuleShape(Protocol):
    """What may travel on one key."""

    @property
    def channel(self) -> str: ...
    @property
    def sender(self) -> str: ...
    @property
    def receiver(self) -> str: ...
    @property
    def protocol(self) -> str: ...
    @property
    def performative(self) -> Performative: ...
    @property
    def use(self) -> str: ...
    @property
    def language(self) -> str: ...
    @property
    def ontology(self) -> str: ...
    @property
    def contents(self) -> tuple[str, ...]: ...
    @property
    def durable(self) -> bool: ...
    @property
    def latest(self) -> bool: ...


class UseShape(Protocol):
    """A use of a protocol on a channel."""

    @property
    def initiator(self) -> str: ...


class StateShape(Protocol):
    """A state of an agent's machine."""

    @property
    def name(self) -> str: ...
    @property
    def behaviour(self) -> str: ...
    @property
    def terminal(self) -> str: ...
    @property
    def error(self) -> str: ...


class ArcShape(Protocol):
    """An arc with the name of its initial condition."""

    @property
    def source(self) -> str: ...
    @property
    def target(self) -> str: ...
    @property
    def when(self) -> str: ...


class AgentShape(Protocol):
    """An agent's machine."""

    @property
    def initial(self) -> str: ...
    @property
    def state(self) -> Sequence[StateShape]: ...
    @property
    def arc(self) -> Sequence[ArcShape]: ...


class DesignShape(Protocol):
    """The part of a design that an agent is made from."""

    @property
    def rules(self) -> Mapping[Any, RuleShape]: ...
    def protocol(self, name: str) -> UseShape: ...
    def agent(self, name: str) -> AgentShape: ...


@dataclass(frozen=True)
class Doing(Generic[M]):
    """What an agent binds to the name of a behaviour; terminal and error conditions come by their names."""

    transition: "Callable[[M, Turn], M]"
    takes: Callable[[M, Taken], bool] = everything


def wiring(design: DesignShape, languages: Languages, system: str, agent: str) -> Wiring:
    """The wiring of one agent of a design."""
    out = [rule for rule in design.rules.values() if rule.sender == agent]
    into = [rule for rule in design.rules.values() if rule.receiver == agent]
    pairs = sorted({(rule.receiver, rule.protocol) for rule in out} | {(rule.sender, rule.protocol) for rule in into})
    links = tuple(
        _link(
            design,
            agent,
            peer,
            [rule for rule in out if (rule.receiver, rule.protocol) == (peer, protocol)],
            [rule for rule in into if (rule.sender, rule.protocol) == (peer, protocol)],
        )
        for peer, protocol in pairs
    )
    return Wiring(system, agent, links, languages)


def _link(design: DesignShape, agent: str, peer: str, out: Sequence[RuleShape], into: Sequence[RuleShape]) -> Link:
    rules = [*out, *into]
    one = rules[0]
    delivery = Delivery.DURABLE if one.durable else Delivery.VOLATILE
    if any(rule.latest for rule in rules):
        delivery = Delivery.LATEST
    initiator = design.protocol(one.use).initiator == agent
    return Link(
        peer=peer,
        channel=one.channel,
        protocol=one.protocol,
        role=Role.INITIATOR if initiator else Role.PARTICIPANT,
        delivery=delivery,
        ontology=next((rule.ontology for rule in rules if rule.ontology), ""),
        silent=next((rule.language for rule in rules if rule.language and not rule.contents), ""),
        says={rule.performative: rule.contents for rule in out},
        hears={rule.performative: rule.contents for rule in into},
    )


def bind(
    design: DesignShape,
    name: str,
    memory: M,
    doings: Mapping[str, Doing[M]],
    conditions: Mapping[str, Callable[[M], bool]],
    *,
    local: Any = None,
) -> Agent[M]:
    """The agent `name` of a design. AgentTableError where a name of it is not bound, or a bound one is not in it."""
    table = design.agent(name)
    named = {state.behaviour for state in table.state}
    wanted = {condition for state in table.state for condition in (state.terminal, state.error) if condition}
    wanted |= {arc.when for arc in table.arc if arc.when}
    _require_same(name, "behaviours", named, set(doings))
    _require_same(name, "conditions", wanted, set(conditions))
    behaviours = {
        state.name: Behaviour(
            doings[state.behaviour].transition,
            terminal=conditions[state.terminal] if state.terminal else never,
            error=conditions[state.error] if state.error else never,
            takes=doings[state.behaviour].takes,
        )
        for state in table.state
    }
    arcs = tuple(Arc(arc.source, arc.target, arc.when) for arc in table.arc)
    return Agent(name, table.initial, memory, behaviours, arcs, conditions, local)


def _require_same(agent: str, what: str, wanted: set[str], bound: set[str]) -> None:
    if wanted != bound:
        missing, extra = sorted(wanted - bound), sorted(bound - wanted)
        raise AgentTableError(
            agent, f"{what}: not bound {missing}, unknown {extra}", "bind the design's names, no others"
        )
