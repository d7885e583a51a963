"""a_ox alone: it is what the design says, and whatever it may be asked is answered."""

import pytest
from agent_runtime.core.binding import wiring
from agent_runtime.testing.alone import Alone
from agent_runtime.testing.samples import sample_named
from fipa_codec.performatives import Performative as P

from depot.design import DESIGN, INTERFACES, LANGUAGES
from depot.ox import interface
from depot.ox.behaviours import agent

ASKED = [
    ("dispatcher", "cfp", P("cfp"), "JOB.Call"),
]


def alone() -> Alone:
    """The agent, started, with all its peers there."""
    return Alone(agent(), wiring("ox", "test", design=DESIGN, languages=LANGUAGES))


def test_it_is_bound_to_the_design():
    """Every behaviour and condition of the design has its function, and no other; it starts where
    the design says.
    """
    made = agent()
    entry = DESIGN.agent("ox")
    assert made.start == entry.initial
    assert set(made.behaviours) == {state.name for state in entry.state}


def test_its_interface_is_the_designs():
    """The typed interface says what the design says."""
    for use, info in (interface.OFFERS | interface.ASKS).items():
        assert list(info) == list(INTERFACES[use])


@pytest.mark.parametrize(("peer", "protocol", "act", "content"), ASKED)
def test_whatever_it_is_asked_is_answered(peer, protocol, act, content):
    """A sample of each question gets a word within a minute, or waits where the design's rows do
    not take it yet.
    """
    one = alone()
    name = one.ask(peer, protocol, act, sample_named(LANGUAGES, content), reply_by=one.now + 60.0)
    one.wait(60.0)
    assert one.answers(name) or one.waiting
