"""The door of km: a guest may ask what would be, apart from other guests and the planner."""

import itertools

import msgspec
import pytest

from agent_runtime.io.devices import NoDevice
from companion.design import DESIGN, LANGUAGES
from companion.languages import wm
from companion.languages.values import Side
from companion.world.observe import observed
from companion.world.scene import Scene
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative as P
from services.knowledge.guests import KmDevice
from services.knowledge.memory import Mirror

from .conftest import KITCHEN


class Store(NoDevice):
    """Takes what the agent tells it."""

    def tell(self, content):
        """Keep nothing."""


class House:
    """The device of km, and what it says to guests."""

    def __init__(self):
        self.said, self.numbers = [], itertools.count(1)
        self.device = KmDevice(self, Store())

    def hear_guests(self, on_data):
        self.take = on_data

    def hear(self, kind, on_data):
        """Nobody was away here."""

    def say_to_guest(self, communicate):
        self.said.append(communicate)

    def sees(self):
        """The agent tells its device what was observed."""
        scene = Scene()
        for number, observation in enumerate(KITCHEN, start=1):
            scene = observed(scene, observation, (1, number), 2.0)
        self.device.tell(Mirror(scene))

    def ask(self, query, guest="bidder"):
        """What km answers."""
        language = LANGUAGES.named("WM")
        use = DESIGN.guest_use(guest, "km", "query")
        name = f"c{next(self.numbers)}"
        one = Communicate(
            performative=P.QUERY_REF,
            content=language.encode(query, P.QUERY_REF),
            language="WM",
            protocol="query",
            ontology=use.ontology,
            reply_with=f"{name}-1",
            conversation=name,
            sender=guest,
            receiver="km",
            id=f"{name}-1",
            sent=0.0,
        )
        self.take(f"roco/x/{use.channel}/{guest}/km/query/query-ref", encode(one))
        return self.said[-1].performative, LANGUAGES.read(self.said[-1])[0]


@pytest.fixture
def house():
    """With the whole scene."""
    made = House()
    made.sees()
    return made


GRASP = wm.Grasped("jar_1", Side.LEFT, "5", KITCHEN[2].pose)
TAKEN = wm.HypotheticalState(id="plan/1", changes=(GRASP,))


def test_a_bidder_may_ask_what_would_be(house):
    """In a state that it made, until it drops it; the world as observed stays."""
    assert house.ask(TAKEN) == (P.INFORM_REF, wm.Made("plan/1"))
    held = wm.CurrentGrasp(object="jar_1", state="plan/1")
    assert house.ask(held)[1].side is Side.LEFT
    assert house.ask(msgspec.structs.replace(held, state=""))[1].side is None
    house.ask(wm.DropStates(prefix=""))
    assert house.ask(held) == (P.FAILURE, wm.UnknownState("plan/1"))


def test_an_assistant_may_not(house):
    """No row of it has hypotheses, nor may it name a state."""
    house.ask(TAKEN)
    assert house.ask(TAKEN, "assistant")[0] is P.NOT_UNDERSTOOD
    assert house.ask(wm.CurrentGrasp(object="jar_1", state="plan/1"), "assistant")[0] is P.REFUSE


def test_before_the_first_look_nothing_is_answered():
    """A plan would be of a world that nobody knows."""
    made = House()
    act, answer = made.ask(wm.DropStates(prefix=""))
    assert act is P.FAILURE
    assert answer.later
