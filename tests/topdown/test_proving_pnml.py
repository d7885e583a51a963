"""PNML read back by another reader: its token game has as many markings as there are states here."""

from collections import Counter
from xml.etree import ElementTree

import pytest
from test_proving_spin import SMALL, WATCH, with_queues

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import PROTOCOLS, QUERY, REQUEST, State
from fipa_codec.tables import RECEIVE, Role, Row
from topdown.prove.durable import durable_pair
from topdown.prove.engine import UNREACHED, WRONG, explore
from topdown.prove.net import NetError
from topdown.prove.net_model import NetModel
from topdown.prove.pairs import ideal_pair
from topdown.prove.pnml import GRAMMAR, pnml
from topdown.prove.roles import restricted
from topdown.prove.volatile import Rules, volatile_pair

NAMESPACE = f"{{{GRAMMAR}/pnml}}"
ASKER, SERVER = Role.INITIATOR, Role.PARTICIPANT
TINY = restricted(QUERY, {ASKER: {"query-ref"}, SERVER: {"inform"}})


def markings(text):
    """Return the number of markings that the token game of a place/transition net reaches."""
    net = ElementTree.fromstring(text).find(f"{NAMESPACE}net")
    assert net.get("type") == f"{GRAMMAR}/ptnet"
    takes, gives = {}, {}
    places = {place.get("id") for place in net.iter(f"{NAMESPACE}place")}
    for arc in net.iter(f"{NAMESPACE}arc"):
        source, target = arc.get("source"), arc.get("target")
        if source in places:
            takes.setdefault(target, Counter())[source] += 1
        else:
            gives.setdefault(source, Counter())[target] += 1
    first = [p.get("id") for p in net.iter(f"{NAMESPACE}place") if p.find(f"{NAMESPACE}initialMarking") is not None]
    return len(reached(frozenset(first), takes, gives))


def reached(first, takes, gives):
    """All markings (sets of marked places: every net here is safe), found by playing."""
    by_place = {}
    for transition, needed in takes.items():
        by_place.setdefault(min(needed), []).append((set(needed), set(gives[transition])))
    found, waiting = {first}, [first]
    while waiting:
        here = waiting.pop()
        for place in here:
            for needed, given in by_place.get(place, ()):
                if needed <= here:
                    there = frozenset(here - needed | given)
                    assert len(there) == len(here)
                    if there not in found:
                        found.add(there)
                        waiting.append(there)
    return found


def spoilt():
    """A cancel that crosses the end has no row."""
    return ideal_pair(SMALL.with_tables(participant=SMALL.tables[SERVER].without(State.DONE, RECEIVE, P.CANCEL)))


MODELS = {
    "request": lambda: ideal_pair(SMALL, capacity=2),
    "query": lambda: ideal_pair(TINY),
    "subscribe": lambda: ideal_pair(WATCH),
    "spoilt": spoilt,
    "observations": lambda: volatile_pair(WATCH, faults=1, latest=True),
    "due in RAM": lambda: volatile_pair(WATCH, faults=1, latest=True, rules=Rules(keeps_due=False)),
    "explicit copies": lambda: durable_pair(TINY, faults=1, bound=2),
    "queues": lambda: with_queues(2),
}


@pytest.mark.parametrize("name", MODELS)
def test_the_token_game_has_as_many_markings_as_there_are_states(name):
    """Wrong states are ends there as here."""
    net = MODELS[name]()
    assert markings(pnml(net)) == explore(NetModel(net), first=False).states


def test_a_net_that_would_be_too_large_is_refused_with_what_to_do():
    """Before it is made."""
    with pytest.raises(NetError, match=r"100000 is the most; export the pair over ideal queues"):
        pnml(durable_pair(REQUEST))


# --- ideal queues -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("protocol", PROTOCOLS, ids=lambda p: p.name)
def test_pairs_hold_over_ideal_queues(protocol):
    """Pairs hold as layer 1 licenses; the state space is smaller."""
    found = explore(NetModel(ideal_pair(protocol)), first=False)
    assert found.holds, str(found.findings[0])
    assert found.states < explore(NetModel(durable_pair(protocol, faults=0))).states


def test_ideal_queues_and_explicit_streams_agree_about_spoilt_tables():
    """The same text for a missing row, the same kind for a silent one."""
    missing = SMALL.with_tables(participant=SMALL.tables[SERVER].without(State.DONE, RECEIVE, P.CANCEL))
    silent = SMALL.tables[SERVER]
    for state in (State.START, State.DONE, State.REFUSED):
        silent = silent.with_rows(Row(state, RECEIVE, P.CANCEL, Kind.PLAIN, State.DONE))
    for protocol, kind in ((missing, WRONG), (SMALL.with_tables(participant=silent), UNREACHED)):
        ideal, explicit = (
            explore(NetModel(net), first=False).findings[0]
            for net in (ideal_pair(protocol), durable_pair(protocol, faults=0))
        )
        assert (ideal.kind, ideal.text) == (explicit.kind, explicit.text)
        assert ideal.kind == kind
