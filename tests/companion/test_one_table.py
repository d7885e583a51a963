"""The rows of the design are what is proven and what runs: taking one away changes both."""

from collections.abc import Callable
from dataclasses import replace as with_fields

import pytest
from msgspec.structs import replace

from agent_runtime.core.agent import Agent
from agent_runtime.core.events import Arrived, Started
from agent_runtime.core.step import Core
from companion.all_languages import SW
from companion.binding import wiring
from companion.design import COORDINATE, DESIGN
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


def without(agent: str, event: str) -> Design:
    """The design less an agent's rows for an event."""
    agents = tuple(
        replace(one, row=tuple(row for row in one.row if row.on != event)) if one.name == agent else one
        for one in DESIGN.file.agent
    )
    return Design(replace(DESIGN.file, agent=agents), DESIGN.path)


def refused(agent: Agent) -> bool:
    """Whether co, whose plan runs, takes ta's refuse: else it stays in the inbox, without a receipt."""
    core = Core(agent, wiring("co", "test"))
    state, _ = core.step(core.boot(None), Started(), 0.0)
    talk = Conversation.open(COORDINATE, Role.INITIATOR, id="co-1-1", me="co", peer="ta")
    talk, asked = talk.send(P.REQUEST, id="1", now=0.0, language="HFSM")
    state = _holding(state, talk)
    answer = Communicate(
        performative=P.REFUSE,
        content=SW.encode(sw.Report(sw.WorkerState.FAILED)),
        language="SW",
        protocol="coordinate",
        in_reply_to=asked.reply_with,
        conversation=talk.id,
        sender="ta",
        receiver="co",
        id="1",
        sent=1.0,
    )
    _, effects = core.step(state, Arrived(answer), 1.0)
    return bool(effects.receipts)


def _holding(state, talk: Conversation):
    from agent_runtime.core.state import Held
    from agent_runtime.core.wiring import Delivery

    after = state.fork()
    after.keep(Held(talk, Delivery.DURABLE))
    return after


@pytest.mark.parametrize(("change", "sound"), [(lambda: DESIGN, True), (lambda: without("co", REFUSED), False)])
def test_an_agents_rows(change: Callable[[], Design], sound: bool) -> None:
    """With the row co takes the refuse and the fleet is proven; without it co leaves it, and the proof fails."""
    design = change()
    agent = with_fields(coordinator(), rows=Steps(design, "co"))
    assert refused(agent) is sound
    assert (not explore(Fleet(design, Faults(0))).findings) is sound


@pytest.mark.parametrize("sound", [True, False])
def test_a_protocols_rows(sound: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The row by which ta takes a cancel that crossed its final report: conversation, walk and fleet change alike."""
    table = COORDINATE.tables[Role.PARTICIPANT]
    if not sound:
        less = table.without("finished", RECEIVE, P.CANCEL)
        monkeypatch.setattr(COORDINATE, "tables", {**COORDINATE.tables, Role.PARTICIPANT: less})
    talk = Conversation(id="c", protocol="coordinate", role=Role.PARTICIPANT, me="ta", peer="co", state="finished")
    names = {"protocol": "coordinate", "conversation": "c", "sender": "co", "receiver": "ta"}
    cancel = Communicate(performative=P.CANCEL, reply_with="2", id="2", **names)
    assert talk.takes(cancel) is sound
    assert explore_protocol(COORDINATE).sound is sound
    fresh = Design(DESIGN.file, DESIGN.path)
    fresh.__dict__["own_tables"] = {"coordinate": COORDINATE}
    assert (not explore(Fleet(fresh, Faults(0))).findings) is sound
