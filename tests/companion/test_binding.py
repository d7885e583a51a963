"""The binding of Python to the design, by name."""

import pytest

from agent_runtime.core.binding import BindingError
from agent_runtime.core.events import Late
from agent_runtime.core.wiring import Delivery
from companion.design import DESIGN, AgentName, bind, wiring
from fipa_codec.tables import Role


def stay(memory, turn):
    """A behaviour that does nothing."""
    return memory


def names(agent):
    """Bindings of every name the design has for an agent."""
    behaviours = {state.behaviour: stay for state in DESIGN.agent(agent).state}
    return behaviours, dict.fromkeys(DESIGN.conditions(agent), bool)


def test_every_agent_of_the_design_can_be_bound():
    """States, start and arcs are the design's.

    Its wiring joins exactly the peers of the design, by the design's keys, and each silent language
    is known.
    """
    for agent in AgentName:
        behaviours, conditions = names(agent)
        bound, entry = bind(agent, 0, behaviours, conditions), DESIGN.agent(agent)
        assert bound.start == entry.initial
        assert set(bound.behaviours) == {state.name for state in entry.state}
        ours, theirs = (
            [(a.source, a.target, a.when) for a in some] for some in (bound.arcs, entry.arc)
        )
        assert ours == theirs
        wired = wiring(agent, "roco")
        assert set(wired.peers) == set(DESIGN.peers(agent))
        for link in wired.links:
            assert link.silent in wired.languages.names
            assert DESIGN.use(agent, link.peer, link.protocol).channel == link.channel


def test_a_name_without_code_and_code_without_a_name_are_both_told():
    """The error keeps what is missing and what is too much."""
    behaviours, conditions = names("hi")
    behaviours["whistle"] = behaviours.pop("listen")
    with pytest.raises(BindingError) as told:
        bind("hi", 0, behaviours, conditions)
    assert (told.value.missing, told.value.extra) == (("listen",), ("whistle",))


def test_takes_of_an_unknown_behaviour_is_refused():
    """A misspelt `takes` would silently take everything."""
    behaviours, conditions = names("hi")
    with pytest.raises(BindingError) as told:
        bind("hi", 0, behaviours, conditions, takes={"lisen": lambda memory, event: False})
    assert told.value.extra == ("lisen",)
    bound = bind("hi", 0, behaviours, conditions, takes={"listen": lambda memory, event: False})
    assert not bound.behaviours["listening"].takes(0, Late("x"))


def test_roles_deliveries_and_silent_languages_are_those_of_the_paper():
    """Formula 4: confirm and cancel of coordinate are in SW."""
    coordinate = wiring("co", "roco").required("ta", "coordinate")
    assert (coordinate.role, coordinate.silent) == (Role.INITIATOR, "SW")
    assert coordinate.delivery is Delivery.DURABLE
    observed = wiring("km", "roco").required("ta", "subscribe")
    assert (observed.delivery, observed.ontology) == (Delivery.LATEST, "RoCo")
    assert wiring("pl", "roco").required("km", "query").delivery is Delivery.VOLATILE
