"""Agents made from the system's own design: wiring, keys, interfaces and tables come from there."""

import pytest
from msgspec import Struct

from agent_runtime.binding import Doing, bind, wiring
from agent_runtime.core import Core
from agent_runtime.errors import AgentTableError
from agent_runtime.events import Arrived, Started
from agent_runtime.turn import Turn
from agent_runtime.wiring import Delivery
from companion.design import DESIGN
from companion.languages import LANGUAGES, cmd, hfsm, wm
from fipa_codec.communicate import Communicate
from fipa_codec.errors import LocalProtocolError
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import Role

AGENTS = sorted(DESIGN.agents)


class Memory(Struct, frozen=True):
    """Nothing to remember."""


def idle(memory: Memory, turn: Turn) -> Memory:
    """Does nothing."""
    return memory


@pytest.mark.parametrize("name", AGENTS)
def test_every_agent_can_be_bound(name: str) -> None:
    """The tables of the design hold together as runtime tables."""
    doings = {state.behaviour: Doing(idle) for state in DESIGN.agent(name).state}
    conditions = {condition: (lambda memory: False) for condition in DESIGN.conditions(name)}
    agent = bind(DESIGN, name, Memory(), doings, conditions)
    assert set(agent.behaviours) == {state.name for state in DESIGN.agent(name).state}
    with pytest.raises(AgentTableError, match="not bound"):
        bind(DESIGN, name, Memory(), {}, conditions)
    with pytest.raises(AgentTableError, match="unknown \\['surplus'\\]"):
        bind(DESIGN, name, Memory(), doings, conditions | {"surplus": lambda memory: True})


@pytest.mark.parametrize("name", AGENTS)
def test_keys_are_those_of_the_design(name: str) -> None:
    """Each message of the design is put on the design's key, and its receiver listens there."""
    mine = wiring(DESIGN, LANGUAGES, "velma", name)
    for rule in DESIGN.rules.values():
        if rule.sender == name:
            message = Communicate(
                performative=rule.performative, protocol=rule.protocol, sender=rule.sender, receiver=rule.receiver
            )
            assert mine.key(message) == DESIGN.key("velma", message)
    for peer, channel in DESIGN.peers(name).items():
        assert f"roco/velma/{channel}/{peer}/{name}/*/*" in mine.inbox_keys()


def test_deliveries_and_roles() -> None:
    """Requests and coordinate are durable, queries volatile, observations latest; who begins is the design's."""
    ta = wiring(DESIGN, LANGUAGES, "velma", "ta")
    found = {(link.peer, link.protocol): (link.delivery, link.role, link.silent) for link in ta.links}
    assert found == {
        ("co", "coordinate"): (Delivery.DURABLE, Role.PARTICIPANT, "SW"),
        ("ex", "request"): (Delivery.DURABLE, Role.INITIATOR, "RC"),
        ("ex", "subscribe"): (Delivery.VOLATILE, Role.INITIATOR, "RS"),
        ("km", "query"): (Delivery.VOLATILE, Role.INITIATOR, ""),
        ("km", "subscribe"): (Delivery.LATEST, Role.PARTICIPANT, "WM"),
    }


def test_the_interface_is_checked_both_ways() -> None:
    """A class of the right language in the wrong act: our own raises, the peer's is not understood."""

    def speak(memory: Memory, turn: Turn) -> Memory:
        if isinstance(turn.event, Started):
            turn.open("km", "query", P.QUERY_REF, wm.Objects(()))
        return memory

    doings = {state.behaviour: Doing(speak) for state in DESIGN.agent("pl").state}
    conditions = {condition: (lambda memory: False) for condition in DESIGN.conditions("pl")}
    core = Core(bind(DESIGN, "pl", Memory(), doings, conditions), wiring(DESIGN, LANGUAGES, "velma", "pl"))
    state = core.boot(None)
    with pytest.raises(LocalProtocolError, match=r"does not carry WM\.Objects"):
        core.step(state, Started(), 1.0)
    wrong = Communicate(
        performative=P.REQUEST,
        content=LANGUAGES.named("CMD").encode(cmd.LookAround()),
        language="CMD",
        protocol="request",
        reply_with="1",
        conversation="co-1-1",
        sender="co",
        receiver="pl",
        id="1",
    )
    _, effects = core.step(state, Arrived(wrong), 1.0)
    assert effects.sends[0].performative is P.NOT_UNDERSTOOD
    assert hfsm.GroundTaskNetwork.__name__ in str(effects.logs[0].fields["why"])
