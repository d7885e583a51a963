"""The rows of the design are what is proven and what runs: taking one away changes both."""

from dataclasses import replace as with_fields

from msgspec.structs import replace

from agent_runtime.core.events import Arrived, Started
from agent_runtime.core.state import Held
from agent_runtime.core.step import Core
from agent_runtime.core.wiring import Delivery
from companion.design import COORDINATE, DESIGN, SW, wiring
from companion.languages import sw
from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.exploration import explore as explore_protocol
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import RECEIVE, Role
from services.coordinator.behaviours import agent as coordinator
from topdown.judge.steps import Steps
from topdown.model.design import Design
from topdown.prove.engine import explore
from topdown.prove.fleet import Faults, Fleet

REFUSED = "execute_plan refuse"


def without(agent, event):
    """The design less an agent's rows for an event."""
    (old,) = [one for one in DESIGN.file.agent if one.name == agent]
    new = replace(old, row=tuple(row for row in old.row if row.on != event))
    agents = tuple(new if one is old else one for one in DESIGN.file.agent)
    return Design(replace(DESIGN.file, agent=agents), DESIGN.path)


def takes_a_refuse(agent):
    """Whether co, whose plan runs, takes ta's refuse: else it stays in the inbox, without a
    receipt.
    """
    core = Core(agent, wiring("co", "test"))
    state, _ = core.step(core.boot(None), Started(), 0.0)
    talk = Conversation.open(COORDINATE, Role.INITIATOR, id="co-1-1", me="co", peer="ta")
    talk, asked = talk.send(P.REQUEST, id="1", now=0.0, language="HFSM")
    state = state.fork()
    state.keep(Held(talk, Delivery.DURABLE))
    names = {"protocol": "coordinate", "conversation": talk.id, "sender": "ta", "receiver": "co"}
    content = SW.encode(sw.Report(sw.WorkerState.FAILED))
    names |= {"in_reply_to": asked.reply_with, "id": "1", "sent": 1.0}
    answer = Communicate(performative=P.REFUSE, content=content, language="SW", **names)
    _, effects = core.step(state, Arrived(answer), 1.0)
    return bool(effects.receipts)


def test_an_agents_rows():
    """With the row co takes the refuse; without it co leaves it, and the proof fails."""
    less = without("co", REFUSED)
    assert takes_a_refuse(with_fields(coordinator(), rows=Steps(DESIGN, "co")))
    assert not takes_a_refuse(with_fields(coordinator(), rows=Steps(less, "co")))
    assert explore(Fleet(less, Faults(0))).findings


def test_a_protocols_rows(monkeypatch):
    """Without the row by which ta takes a cancel that crossed its final report conversation, walk
    and fleet change.
    """
    names = {"role": Role.PARTICIPANT, "me": "ta", "peer": "co"}
    talk = Conversation(id="c", protocol="coordinate", state="finished", **names)
    names = {"protocol": "coordinate", "conversation": "c", "sender": "co", "receiver": "ta"}
    cancel = Communicate(performative=P.CANCEL, reply_with="2", id="2", **names)
    assert talk.takes(cancel)
    less = COORDINATE.tables[Role.PARTICIPANT].without("finished", RECEIVE, P.CANCEL)
    monkeypatch.setattr(COORDINATE, "tables", {**COORDINATE.tables, Role.PARTICIPANT: less})
    assert not talk.takes(cancel)
    assert not explore_protocol(COORDINATE).sound
    fresh = Design(DESIGN.file, DESIGN.path)
    fresh.__dict__["own_tables"] = {"coordinate": COORDINATE}
    assert explore(Fleet(fresh, Faults(0))).findings
