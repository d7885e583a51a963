"""The design of the Robot Companion is consistent, and says what the paper says."""

import pytest

from agent_runtime.core.binding import BindingError
from agent_runtime.core.events import Late
from agent_runtime.core.wiring import Delivery, service_key
from companion.design import DESIGN, LANGUAGES, AgentName, bind, findings, wiring
from companion.languages import hfsm, wm
from fipa_codec.communicate import Communicate
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import Role
from topdown.check import reachable
from topdown.model.errors import NoSuchEntry
from topdown.model.interfaces import class_named, interfaces

# Section 5.2: channel -> the agents it joins in the end.
CHANNELS = {
    "C1": {"co", "ta"},
    "C2": {"co", "hi"},
    "C3": {"co", "pl"},
    "C4": {"pl", "km"},
    "C5": {"ex", "ta"},
    "C6": {"ta", "km"},
}
# Section 5.5, Tables 3 to 6: the states of the paper (ours may be more).
STATES = {
    "co": {"trigger", "procReq", "compSP", "schedule", "switch"},
    "pl": {"idle", "initialize", "search", "finalize"},
    "km": {"idle", "questionAnswering", "knowledgeSaving"},
    "ta": {"idle", "running", "finished"},
}


def said(sender, receiver, protocol, performative):
    """A communicate as far as its address goes."""
    names = {"sender": sender, "receiver": receiver, "protocol": protocol}
    return Communicate(performative=performative, **names)


def test_the_design_is_consistent():
    """Neither in itself nor with the languages, the protocols' rows and the kinds of queries is
    there a finding.
    """
    assert [str(finding) for finding in findings()] == []


def test_six_channels_join_the_agents_as_in_the_paper():
    """The steps, walked, end in the paper's figure."""
    found = {channel.id: set(channel.ends) for channel in DESIGN.channels.values()}
    assert found.items() >= CHANNELS.items()
    assert {name.value for name in AgentName} <= set(DESIGN.agents)
    assert set(DESIGN.agents) == set(DESIGN.decomposition.last.groups)


def test_every_state_of_the_paper_is_there_and_reachable():
    """By its name; each state that is not the paper's has a ruling."""
    for agent, states in STATES.items():
        assert states <= reachable(DESIGN.agent(agent))
        assert all(state.ruling for state in DESIGN.agent(agent).state if state.name not in states)


def test_a_communicate_travels_on_the_key_of_the_design():
    """The key names system, channel, sender, receiver, protocol and act."""
    key = DESIGN.key("lab", said("co", "ta", "coordinate", P.REQUEST))
    assert key == "roco/lab/C1/co/ta/coordinate/request"
    assert DESIGN.keys_to("lab", "ta") == "roco/lab/*/*/ta/*/*"
    alive = DESIGN.signal_key("alive", system="lab", owner="ta", incarnation=3)
    assert alive == "roco/lab/_/alive/ta/3"


def test_what_is_no_communicate_travels_on_the_key_of_the_design():
    """The runtime makes these keys by the same rule, so a right given by the design is a right to
    what is sent.
    """
    for signal in DESIGN.signals.values():
        names = {"owner": "ta", "peer": "co", "incarnation": "3"}
        rest = [names[name] for name in ("peer", "incarnation") if f"{{{name}}}" in signal.key]
        key = service_key("lab", signal.kind, "ta", *rest)
        assert DESIGN.signal_key(signal.kind, system="lab", **names) == key
    runtime = {"alive", "receipt", "ping", "pong", "state", "control", "want", "steps"}
    runtime |= {"missed", "resaid"}
    assert set(DESIGN.signals) == runtime | {"telemetry", "truth", "watch", "frame"}


def test_every_rule_has_its_own_key():
    """No two rules share a key, so access rights can be as fine as the rules."""
    keys = [DESIGN.key_of("lab", rule) for rule in DESIGN.rules.values()]
    assert len(keys) == len(set(keys))


def test_a_message_outside_the_design_has_no_key():
    """hi never talks to ta; and the error says which acts there are."""
    with pytest.raises(NoSuchEntry):
        DESIGN.key("lab", said("hi", "ta", "coordinate", P.REQUEST))
    with pytest.raises(NoSuchEntry) as caught:
        DESIGN.key("lab", said("co", "ta", "coordinate", P.PROPOSE))
    assert P.REQUEST in caught.value.known


def test_formula_4_holds():
    """confirm and cancel are in SW without content, the request is a plan in HFSM."""
    for act in (P.CONFIRM, P.CANCEL):
        rule = DESIGN.rule(said("co", "ta", "coordinate", act))
        assert (rule.language, rule.contents) == ("SW", ())
    rule = DESIGN.rule(said("co", "ta", "coordinate", P.REQUEST))
    assert (rule.language, rule.contents) == ("HFSM", ("HFSM.HierarchicalPlan",))


def test_queries_are_small_and_answers_may_be_large():
    """Section 5.4: 250 bytes and 1 MB; hypothetical states have a budget of their own."""
    rule = DESIGN.rule(said("pl", "km", "query", P.QUERY_REF))
    assert rule.sizes["WM.ObjectPose"] == 250
    assert rule.sizes["WM.HypotheticalState"] > 250
    assert DESIGN.rule(said("km", "pl", "query", P.INFORM_REF)).bytes == 1_000_000
    queries = DESIGN.rule(said("ta", "km", "query", P.QUERY_REF))
    assert "WM.HypotheticalState" not in queries.contents


def test_durable_are_the_channels_of_the_main_line():
    """C1, C2, C3 and acts on C5 are journalled; queries and subscriptions are not."""
    durable = {"execute_plan", "execute_command", "generate_plan", "act"}
    assert {use.name for use in DESIGN.file.protocol if use.durable} == durable
    assert DESIGN.rule(said("ta", "km", "subscribe", P.INFORM)).latest
    assert not DESIGN.rule(said("ta", "km", "subscribe", P.AGREE)).latest


def test_a_reason_may_go_with_every_no():
    """refuse, failure and not-understood may carry a Reason in the language everybody reads."""
    for rule in DESIGN.rules.values():
        no = rule.performative in (P.REFUSE, P.FAILURE, P.NOT_UNDERSTOOD)
        assert ("reason.Reason" in rule.contents) == no


def test_the_interface_of_the_paper_is_the_papers():
    """ClassInterfaceInfo([('request', 'generatePlan', [GroundTaskNetwork], HierarchicalPlan)])"""
    (entry,) = interfaces(DESIGN, LANGUAGES)["generate_plan"]
    assert (entry.performative, entry.name) == (P.REQUEST, "generatePlan")
    assert (entry.arguments, entry.answers) == ((hfsm.GroundTaskNetwork,), (hfsm.HierarchicalPlan,))


def test_every_content_class_has_one_language():
    """The language of a sentence follows from its class."""
    assert class_named(LANGUAGES, "WM.PoseOf") is wm.PoseOf
    classes = [kind for name in LANGUAGES.names for kind in LANGUAGES.named(name).classes]
    assert len(classes) == len(set(classes))


def test_an_agents_interface_is_what_its_rules_say():
    """km sends answers and a subscription, in WM with O_RoCo (and reasons)."""
    side = DESIGN.side("km")
    assert side.sends >= {P.INFORM_REF, P.SUBSCRIBE}
    assert side.languages_sent == {"WM", "reason"}
    assert side.ontologies_received == {"RoCo"}
    assert DESIGN.peers("co") == {"ta": "C1", "hi": "C2", "pl": "C3"}


def test_conditions_to_bind_are_listed():
    """An agent's code learns which names it must bind."""
    assert {"switch", "command_arrived", "switched"} <= DESIGN.conditions("co")


# --- The binding of Python to the design, by name


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
