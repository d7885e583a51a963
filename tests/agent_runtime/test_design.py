"""Wirings made from the system's own design: keys are the design's, and its interfaces are checked
both ways.
"""

import pytest
from msgspec import Struct
from msgspec.structs import replace

from agent_runtime.core import binding
from agent_runtime.core.agent import Agent, Behaviour
from agent_runtime.core.events import Arrived, Started
from agent_runtime.core.step import Core
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import communicate_key
from companion.design import DESIGN, LANGUAGES, wiring
from companion.languages import hfsm, wm
from companion.tasks.look_around.command import LookAround
from fipa_codec.communicate import Communicate
from fipa_codec.errors import LocalProtocolError
from fipa_codec.performatives import Performative as P
from topdown.model import elements
from topdown.model.design import Design


class Memory(Struct, frozen=True):
    """Nothing to remember."""


@pytest.mark.parametrize("name", sorted(DESIGN.agents))
def test_keys_are_those_of_the_design(name: str) -> None:
    """Each message of the design is put on the design's key, and its receiver listens there."""
    mine = wiring(name, "velma")
    for rule in DESIGN.rules.values():
        if rule.sender == name and (channel := mine.guests.get(rule.receiver)):
            of = (rule.receiver, rule.protocol, rule.performative)
            assert communicate_key("velma", channel, name, *of) == DESIGN.key_of("velma", rule)
        elif rule.sender == name:
            message = Communicate(
                performative=rule.performative,
                protocol=rule.protocol,
                sender=rule.sender,
                receiver=rule.receiver,
            )
            assert mine.key(message) == DESIGN.key("velma", message)
    for peer, channel in DESIGN.peers(name).items():
        assert f"roco/velma/{channel}/{peer}/{name}/*/*" in mine.inbox_keys(mine.peers)


def test_a_group_is_not_awaited() -> None:
    """Nobody runs it, so an agent is ready without its answer; its peers that are agents are
    awaited.
    """
    left = tuple(agent for agent in DESIGN.file.agent if agent.name != "km")
    made = Design(replace(DESIGN.file, agent=left, group=(elements.Group("km"),)))
    links = binding.wiring("pl", "velma", design=made, languages=LANGUAGES).links
    assert {(link.peer, link.awaited) for link in links} == {("co", True), ("km", False)}


def test_the_interface_is_checked_both_ways() -> None:
    """A class of a known language in the wrong act: our own raises, the peer's is not
    understood.
    """

    def speak(memory: Memory, turn: Turn) -> Memory:
        turn.open("km", "query", P.QUERY_REF, wm.Objects(()))
        return memory

    core = Core(Agent("pl", "s", Memory(), {"s": Behaviour(speak)}), wiring("pl", "velma"))
    state = core.boot(None)
    with pytest.raises(LocalProtocolError, match=r"does not carry WM\.Objects"):
        core.step(state, Started(), 1.0)
    wrong = Communicate(
        performative=P.REQUEST,
        content=LANGUAGES.named("CMD").encode(LookAround()),
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
