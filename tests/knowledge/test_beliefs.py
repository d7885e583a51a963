"""Beliefs of km, made from a recording, are those of the recording's communicates and of km's own
answers.
"""

import base64
import json
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import pyoxigraph as ox
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from msgspec.structs import replace

from agent_runtime.core.events import Arrived
from agent_runtime.io import steplog
from companion.asking import PREFIXES, Heard
from companion.tools.verbs import ask as asking
from fipa_codec.communicate import decode
from operate.recording import mcap_file
from operate.recording.records import Spoken, Token
from services.knowledge.asked import Beliefs, believed, dataset
from services.knowledge.store import Store

POUR = Path(__file__).parents[1] / "histories" / "pour_seed_7"


class Said(NamedTuple):
    """A communicate as it stands in the recording; `content`: plain maps and lists, None without
    one.
    """

    t: float
    sender: str
    receiver: str
    id: str
    conversation: str
    content: Any


def read():
    """The recording without any code of ours."""
    topics = {}
    with (POUR / "traffic.mcap").open("rb") as file:
        for record in StreamReader(file).records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message) and topics[record.channel_id].startswith(
                "communicates/"
            ):
                one = json.loads(record.data)
                content = msgspec.msgpack.decode(base64.b64decode(one["wire"])).get("Z")
                names = ("received", "sender", "receiver", "id", "conversation")
                yield Said(*(one[name] for name in names), content)


ALL = tuple(read())
BEGIN = min(one.t for one in ALL)
TO_KM = [one for one in ALL if one.receiver == "km" and one.content]
TOLD = [one for one in TO_KM if one.content["type"].startswith("Seen")]
ANSWERED = [
    (asked, answer)
    for answer in ALL
    if answer.sender == "km" and answer.content
    for asked in TO_KM
    if asked.conversation == answer.conversation
]


def ask(at, query):
    """The rows of a query as texts, IRIs shortened, sorted."""
    known = asking.known(POUR, at)
    found = dataset(believed(known.heard), known.begin).query(query, prefixes=PREFIXES)
    assert isinstance(found, ox.QuerySolutions)
    return sorted(tuple(short(term) for term in row) for row in found)


def short(term):
    """An IRI by the last part of its name, a literal by its text."""
    if isinstance(term, ox.NamedNode):
        return term.value.rpartition("#")[2].rpartition("/")[2]
    return "" if term is None else str(term.value)


def newest(at, kind, key):
    """The last observation of each subject that was told until then; its counter only grows in this
    run.
    """
    before = (one for one in TOLD if one.t <= BEGIN + at)
    return {one.content[key]: one for one in before if one.content["type"] == kind}


@settings(max_examples=12, deadline=None)
@given(st.floats(0.0, 90.0))
def test_at_any_time_the_newest_observation_of_each_thing_counts(at):
    """Its pose, its time, its version, who told it and when; hands hold what was told of them
    last.
    """
    rows = ask(
        at,
        "SELECT ?thing ?record ?version ?observed ?who ?when WHERE { "
        "GRAPH ?said { ?thing roco:version ?version ; roco:observedAt ?observed } "
        "?said a roco:Observation ; roco:about ?thing ; roco:toldBy ?who ; roco:toldAt ?when . "
        "?thing roco:isInstanceOf ?model ; roco:record ?record }",
    )
    wanted = newest(at, "SeenObject", "object")
    assert [row[0] for row in rows] == sorted(wanted)
    for thing, record, version, observed, who, when in rows:
        told = wanted[thing]
        assert json.loads(record)["thing"]["pose"] == told.content["pose"]
        assert (version, who) == (told.id.rpartition("@")[2], told.sender)
        assert float(observed) == told.content["at"]
        assert float(when) == pytest.approx(told.t - BEGIN, abs=0.001)
    hands = newest(at, "SeenHand", "side").items()
    contents = ((side, one.content) for side, one in hands)
    held = {(of["object"], f"{side}_hand") for side, of in contents if of.get("object")}
    assert set(ask(at, "SELECT ?thing ?hand WHERE { ?thing roco:isGraspedBy ?hand }")) == held


def test_jar_at_12_s_and_who_said_so():
    """By hand from the recording: seen at 5.03 s in and on the cabinet, held by nobody; told by
    ta.
    """
    rows = ask(
        12.0,
        "SELECT ?relation ?where ?who ?when WHERE { GRAPH ?said { thing:jar_1 ?relation ?where }"
        " VALUES ?relation { roco:isIn roco:isOn roco:isGraspedBy } ?said roco:toldBy ?who ;"
        " roco:toldAt ?when }",
    )
    assert rows == [("isIn", "cabinet_2", "ta", "5.031"), ("isOn", "cabinet_2", "ta", "5.031")]


def _scene(asked):
    """Return the place to look a question of the recording up: SPARQL before and behind the
    pattern.
    """
    state = asked.content["state"]
    return (f"GRAPH <{PREFIXES['state']}{state}> {{", "}") if state else ("", "")


def _asked(kind):
    return [pair for pair in ANSWERED if pair[0].content["type"] == kind]


@pytest.mark.parametrize(("asked", "answer"), _asked("ObjectPose"))
def test_where_km_said_a_thing_is(asked, answer):
    """Of the observed world and of hypothetical states: on what, how exact, in which hand, as km
    answered then.
    """
    before, behind = _scene(asked)
    name = asked.content["object"]
    rows = ask(
        answer.t - BEGIN,
        f"SELECT ?record ?exact ?on ?hand WHERE {{ {before} BIND(thing:{name} AS ?thing) ?thing"
        " roco:record ?record ; roco:hasExactPose ?exact OPTIONAL { ?thing roco:isOn ?on }"
        f" OPTIONAL {{ ?thing roco:isGraspedBy ?hand }} {behind} }}",
    )
    ((record, exact, on, hand),) = rows
    said = answer.content
    assert json.loads(record)["thing"]["pose"] == said["pose"]
    by = said.get("held_by")
    wanted = (str(said["exact"]).lower(), said.get("on", ""), f"{by}_hand" if by else "")
    assert (exact, on, hand) == wanted


@pytest.mark.parametrize(("asked", "answer"), [*_asked("CurrentGrasp"), *_asked("GraspAtSide")])
def test_who_km_said_holds_a_thing(asked, answer):
    """The grasp, too."""
    before, behind = _scene(asked)
    rows = ask(
        answer.t - BEGIN,
        "SELECT ?thing ?hand ?grasp WHERE { "
        f"{before} ?thing roco:isGraspedBy ?hand ; roco:isGraspedWith ?grasp {behind} }}",
    )
    said, side = answer.content, asked.content.get("side")
    thing, hand = asked.content.get("object"), f"{side}_hand"
    found = [row for row in rows if row[0] == thing or row[1] == hand]
    hand, grasp = f"{said.get('side')}_hand", said.get("grasp", "")
    held = bool(said.get("object") and said.get("side"))
    assert found == ([(said["object"], hand, grasp)] if held else [])


def test_states_are_there_from_making_to_dropping():
    """States the planner had made and not yet dropped are there, at times between all that was
    said.
    """
    made = {(asked.content["id"], answer.t) for asked, answer in _asked("HypotheticalState")}
    dropping = [(asked, answer) for asked, answer in _asked("DropStates") if "id" in answer.content]
    dropped = [(asked.content["prefix"], answer.t) for asked, answer in dropping]
    times = sorted({t for _, t in made} | {t for _, t in dropped})
    assert len(times) > 10
    for t in times:
        at = t - BEGIN + 1e-4
        now = BEGIN + at
        ends = [(prefix, end) for prefix, end in dropped if end <= now]
        begun = [(id, since) for id, since in made if since <= now]
        alive = {
            id
            for id, since in begun
            if not any(id.startswith(to) and since < end for to, end in ends)
        }
        rows = ask(
            at, "SELECT ?state WHERE { ?state a roco:HypotheticalState ; roco:toldBy agent:pl }"
        )
        assert {row[0] for row in rows} == {id.rpartition("/")[2] for id in alive}


def test_another_life_of_km_has_no_states():
    """Hypothetical states die with km, the observed scene does not."""
    heard = asking.known(POUR, 10.5).heard
    with_states, without = believed(heard), believed((*heard, Heard(heard[-1].at)))
    assert with_states.states
    assert not without.states
    assert without.scene == with_states.scene


def test_what_is_asked_of_another_life_again_is_there_again(tmp_path):
    """The same question with the same id, recorded once more after the life began, and km's answer
    to it.
    """
    records = list(mcap_file.Reading(POUR / "traffic.mcap"))
    until = _asked("HypotheticalState")[0][1].t
    first = [one for one in records if one.received <= until]
    contents = ((one, one.content) for one in ALL if one.content)
    talk = next(one.conversation for one, of in contents if of["type"] == "HypotheticalState")
    again = [one for one in first if isinstance(one, Spoken) and one.conversation == talk]
    recording = mcap_file.Recording(tmp_path / "traffic.mcap")
    restarted = (replace(one, received=until + 2.0) for one in again)
    later = [Token("km", 2, True, until + 1.0), *restarted]
    for one in (*first, *later):
        recording.add(one)
    recording.finish()
    times = (until - BEGIN, until - BEGIN + 1.5, None)
    states = [believed(asking.known(tmp_path, at).heard).states for at in times]
    assert states[0].keys() == states[2].keys() != states[1].keys() == set()


def test_facts_are_those_of_kms_own_store():
    """After each communicate: what km's store would hold of the scene, each fact with a source that
    was told before.
    """
    store, beliefs = Store.open(), Beliefs()
    ontology = set(store._triples)
    for one in asking.known(POUR).heard:
        beliefs.hear(one)
        store.write(beliefs.scene)
        assert beliefs.facts.keys() == set(store._triples) - ontology
        names = {source.name for source in beliefs.sources}
        assert {source.name for source in beliefs.facts.values()} <= names
    assert beliefs.sources


def told(beliefs):
    """Return the believed pairs (subject, predicate), without times: a step log has the time of
    sending.
    """
    return {(str(fact.subject), str(fact.predicate)) for fact in beliefs.facts}


def test_step_logs_tell_it_too(tmp_path):
    """A run whose recorder heard nothing: what reached km stands in its own step log."""
    log = steplog.StepLog(tmp_path / "steps/km.steps")
    messages = (one for one in asking.known(POUR).heard if one.wire)
    heard = [one for one in messages if decode(one.wire).receiver == "km"]
    for one in heard:
        event = msgspec.msgpack.encode(Arrived(decode(one.wire)))
        log.write([(steplog.Step(1, 1, one.at, "Arrived", event), steplog.NOTHING)])
    log.close()
    logged = believed(asking.known(tmp_path).heard)
    assert told(logged) == told(believed(asking.known(POUR).heard))
    assert "content/jar_1" in [source.name.partition("@")[0] for source in logged.sources]
