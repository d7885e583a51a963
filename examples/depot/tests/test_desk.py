"""a_desk alone: it is what the design says, and whatever it may be asked is answered."""

from agent_runtime.core.binding import wiring
from agent_runtime.testing.alone import Alone
from fipa_codec.performatives import Performative

from depot.design import DESIGN, INTERFACES, LANGUAGES
from depot.desk import interface
from depot.desk.behaviours import agent


def alone() -> Alone:
    """The agent, started, with all its peers there."""
    return Alone(agent(), wiring("desk", "test", design=DESIGN, languages=LANGUAGES))


def test_it_is_bound_to_the_design():
    """Every behaviour and condition of the design has its function, and no other; it starts where
    the design says.
    """
    made = agent()
    entry = DESIGN.agent("desk")
    assert made.start == entry.initial
    assert set(made.behaviours) == {state.name for state in entry.state}


def test_its_interface_is_the_designs():
    """The typed interface says what the design says."""
    for use, info in (interface.OFFERS | interface.ASKS).items():
        assert list(info) == list(INTERFACES[use])


def test_it_subscribes_once_for_each_life_of_the_dispatcher():
    """One that is seen again after an outage of the router knows the subscription; a new life does
    not.
    """
    desk = alone()
    for life in (1, 2, 2):
        desk.seen("dispatcher", life)
    assert [one.performative for one in desk.said] == [Performative.SUBSCRIBE] * 2
