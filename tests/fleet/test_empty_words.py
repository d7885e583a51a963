"""A message without its content, as who has a stolen key may say it: every agent answers it, and
none dies of it.
"""

import pytest

from agent_runtime.testing.alone import Alone
from companion.design import wiring
from companion.languages.facts import Kind, fact
from companion.tasks.pour.command import PourInto
from fipa_codec.performatives import Performative
from fipa_codec.protocols import named
from fipa_codec.tables import Role
from services.coordinator import behaviours as coordinator
from services.executor import behaviours as executor
from services.knowledge import behaviours as knowledge
from services.planner import behaviours as planner
from services.task import behaviours as task

AGENTS = {"co": coordinator, "ex": executor, "km": knowledge, "pl": planner, "ta": task}
"""hi is asked by nobody."""


def openings(name):
    """The opening messages that an agent takes, as links and performatives."""
    links = [link for link in wiring(name, "test").links if link.role is Role.PARTICIPANT]
    opened = ((link, act) for link in links for act in named(link.protocol).openings)
    return [(link, act) for link, act in opened if link.hears.get(act)]


@pytest.mark.parametrize("name", AGENTS)
def test_an_opening_without_content_is_not_understood(name):
    """At once, once, and the agent is asked again as if nothing had been."""
    assert openings(name), "else this test would show nothing"
    for link, act in openings(name):
        one = Alone(AGENTS[name].agent(), wiring(name, "test"))
        state, told = one.state, len(one.told)
        conversation = one.ask(link.peer, link.protocol, act)
        assert one.answers(conversation) == (Performative.NOT_UNDERSTOOD,), link.channel
        assert (one.state, len(one.told)) == (state, told), link.channel
        outside = [line for line in one.logs if line.event == "step outside the design"]
        assert not outside, link.channel


def test_a_plan_without_content_fails_the_task_in_words():
    """The coordinator tells the person why, and takes the next task."""
    one = Alone(coordinator.agent(), wiring("co", "test"))
    asked = one.ask("hi", "request", Performative.REQUEST, PourInto("jar", "bowl"))
    (planning,) = [say.conversation for say in one.said if say.receiver == "pl"]
    one.answer(planning, Performative.INFORM)
    assert one.answers(asked)[-1] is Performative.FAILURE
    whys = [getattr(one.content(word), "why", ()) for word in one.said]
    assert (fact(Kind.NO_REASON, "pl"),) in whys
    one.ask("hi", "request", Performative.REQUEST, PourInto("jar", "bowl"))
    assert [word.receiver for word in one.said].count("pl") == 2
    assert not [line for line in one.logs if line.event == "step outside the design"]
