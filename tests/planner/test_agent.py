"""pl's agent: problems wait for their turn, a cancel is answered at once, the search is a killable
process.
"""

import queue
import time

import pytest
from scripted_partner import Open, Say, partner
from scripted_search import Script, look, plan_of

from agent_runtime.testing.memory_bus import MemoryBus
from companion.design import LANGUAGES, wiring
from companion.languages import hfsm, wm
from companion.languages.facts import Kind, fact
from fipa_codec.performatives import Performative as P
from services.knowledge import behaviours as knowledge
from services.knowledge.store import device_at
from services.planner import behaviours
from services.planner.search import Answer, Ask, Begin, Found, SearchDevice, Stop


def network(name):
    """A task that needs no object."""
    return hfsm.GroundTaskNetwork(name, (hfsm.Task("look_around", ()),))


class Slow(Script):
    """Asks without end."""

    def _go_on(self, answer):
        self._post(Ask(self._attempt, wm.ListObjects()), 0.01)


class Scene:
    """pl with the true km, a scripted co and a scripted ta."""

    def __init__(self, search, settle_s=knowledge.ALONE_S + 1.0):
        self.wires = MemoryBus()
        self.heard = []
        self.asked = []
        self.wires.add(partner("co", self.heard), wiring("co", "test"))
        self.wires.add(
            behaviours.agent(), wiring("pl", "test"), lambda post: search(post, self.asked)
        )
        self.wires.add(knowledge.agent(), wiring("km", "test"), device_at(None))
        self.wires.run_for(settle_s)

    def ask(self, name):
        self.wires.post("co", Open("pl", "request", P.REQUEST, network(name)))

    def until(self, count):
        self.wires.run(lambda: len(self.heard) >= count)
        return [(number, word) for number, word, _ in self.heard]


def questions(scene):
    """Return pl's questions to km, once each."""
    said = [one for one in scene.wires.traffic if one.sender == "pl" and one.receiver == "km"]
    opened = {one.conversation: one for one in said if one.performative is P.QUERY_REF}
    return [LANGUAGES.read(one)[0] for one in opened.values()]


def test_a_plan():
    """agree, then the plan; km has no hypothetical state left of it."""
    scene = Scene(Script)
    scene.ask("p1")
    assert scene.until(2) == [(0, "agree"), (0, "inform")]
    assert isinstance(scene.heard[-1][2], hfsm.HierarchicalPlan)
    scene.wires.run_for(1.0)
    assert not scene.wires.memory("km").soft.overlays.states


def test_problems_wait_for_their_turn():
    """Both are agreed to at once, and planned one after the other."""
    scene = Scene(Script)
    scene.ask("p1")
    scene.ask("p2")
    assert sorted(scene.until(4)) == [(0, "agree"), (0, "inform"), (1, "agree"), (1, "inform")]
    assert scene.heard[-1][2].id == "p2"


def test_a_cancel_is_answered_at_once():
    """While it searches: within milliseconds, and the next problem is taken; while it waits:
    likewise.
    """
    scene = Scene(Slow)
    for name in ("p1", "p2", "p3"):
        scene.ask(name)
    scene.until(3)
    began = scene.wires.now
    scene.wires.post("co", Say(1, P.CANCEL))
    scene.until(4)
    scene.wires.post("co", Say(0, P.CANCEL))
    scene.until(5)
    assert scene.wires.now - began < 0.1
    told = [(number, type(content)) for number, _, content in scene.heard[3:]]
    assert told == [(1, hfsm.NoPlan), (0, hfsm.NoPlan)]
    scene.wires.run_for(0.5)
    assert scene.wires.memory("pl").problem.network.id == "p3"


def test_words_of_an_earlier_attempt_are_ignored():
    """Words of a killed search do not reach km or co."""
    scene = Scene(Slow)
    scene.ask("p1")
    scene.until(1)
    scene.wires.run_for(0.2)
    asked = len(questions(scene))
    old = plan_of(network("old"), [(hfsm.Step("look-around"), [look("jar_1")])])
    for word in (
        Found(0, hfsm.NoPlan("from before", ())),
        Found(0, old),
        Ask(0, wm.DropStates("x")),
    ):
        scene.wires.post("pl", word)
    scene.wires.run_for(0.2)
    assert len(scene.heard) == 1
    assert len(questions(scene)) > asked, "the search of now goes on"
    assert wm.DropStates("x") not in questions(scene)


class Forgotten(Script):
    """Each search asks about a hypothetical state that km has not, as if km had died meanwhile."""

    begun = 0

    def tell(self, content):
        """Ask at once."""
        if isinstance(content, Begin):
            Forgotten.begun += 1
            self._post(Ask(content.attempt, wm.ObjectPose(state="gone", object="jar_1")), 0.01)


def test_a_search_whose_facts_are_lost_begins_again_but_not_for_ever():
    """Five times, then the person is told why."""
    scene = Scene(Forgotten)
    Forgotten.begun = 0
    scene.ask("p1")
    assert scene.until(2) == [(0, "agree"), (0, "failure")]
    assert scene.heard[-1][2].why == (fact(Kind.STATES_LOST),)
    assert Forgotten.begun == 5


@pytest.mark.process
@pytest.mark.timeout(120)
def test_the_true_search_is_killed_and_replaced():
    """Stop ends the child at once, in the middle of anything; the next request is searched by
    another one.
    """
    words = queue.Queue()  # type: ignore[valid-type]
    searcher = SearchDevice(lambda content, delay_s=0.0: words.put(content))  # type: ignore[arg-type]
    try:
        pour = hfsm.GroundTaskNetwork("p1", (hfsm.Task("pour", ("jar", "bowl")),))
        searcher.tell(Begin(1, pour, 1))
        first = words.get(timeout=60.0)
        assert isinstance(first, Ask)
        began = time.monotonic()
        searcher.tell(Stop(1))
        assert time.monotonic() - began < 5.0
        searcher.tell(Begin(2, pour, 1))
        again = words.get(timeout=60.0)
        assert (type(again), again.attempt) == (Ask, 2)
        searcher.tell(Answer(2, wm.Unknown((fact(Kind.NOT_OBSERVED_YET),))))
        ended = words.get(timeout=60.0)
        assert isinstance(ended, Found)
        assert isinstance(ended.plan, hfsm.NoPlan)
        assert ended.plan.why == (fact(Kind.NOT_OBSERVED_YET),)
    finally:
        searcher.close()


def test_a_problem_is_put_off_while_the_world_is_looked_at():
    """km says that it may know later; pl says the same at once, and begins no search."""
    scene = Scene(Script, settle_s=0.1)
    scene.ask("p1")
    assert scene.until(2) == [(0, "agree"), (0, "failure")]
    put_off = scene.heard[-1][2]
    assert isinstance(put_off, hfsm.NoPlan)
    assert put_off.later
    assert not scene.asked
    scene.wires.run_for(1.0)
    assert len(questions(scene)) == 1, "nothing was made, so nothing is dropped"
    scene.wires.run_for(knowledge.ALONE_S)
    scene.ask("p2")
    assert scene.until(4)[2:] == [(1, "agree"), (1, "inform")]
