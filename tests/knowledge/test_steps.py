"""km's agent step by step: whom it asks to observe, how long questions wait for a look around, what
it answers.
"""

import sys
from pathlib import Path

import pytest
from msgspec import Raw

sys.path.insert(0, str(Path(__file__).parents[1] / "agent_runtime"))
from driven import Driven

from agent_runtime.core.events import PeerChanged, Started, Tick
from companion import sentences
from companion.design import wiring
from companion.languages import wm
from companion.languages.facts import Kind, fact
from companion.languages.values import BodyPosture, Pose
from companion.world.scene import Scene
from fipa_codec.performatives import Performative as P
from services.knowledge import behaviours
from services.knowledge.behaviours import AGAIN_S, ALONE_S, HELD_S, Mirror
from services.knowledge.outgoing_messages import NOT_YET

BODY = wm.SeenBody(BodyPosture(0.0, (0.0,) * 7, (0.0,) * 7, (0.0, 0.0), (0.0,) * 4, (0.0,) * 4))
DARK = (fact(Kind.NOTHING_IS_SEEN),)
JAR = wm.SeenObject("jar_1", "jar", Pose((1.0, 0.0, 1.0)), 1.0)


class Km(Driven):
    """km with ta and pl by hand."""

    def __init__(self):
        super().__init__(behaviours.agent(), wiring("km", "test"))
        self.asked = self.seen = 0
        self.step(Started())

    @property
    def memory(self):
        return self.state.memory  # type: ignore[no-any-return]

    def subscribes(self):
        """Conversations of the subscriptions said in the last step."""
        return [sent.conversation for sent in self.sends() if sent.performative is P.SUBSCRIBE]

    def met(self, incarnation=1):
        """ta is there; the subscription."""
        self.step(PeerChanged("ta", incarnation))
        (name,) = self.subscribes()
        return name

    def ta(self, act, content=None, **more):
        """ta's word in the subscription."""
        name = self.memory.soft.subscription
        asked = self.state.soft.conversations[name].conversation.asked
        self.hears("ta", "subscribe", act, content, talk=name, in_reply_to=asked, **more)

    def observed(self, subject, content):
        """ta has seen it."""
        self.seen += 1
        self.ta(P.INFORM, content, id=f"{subject}@1.{self.seen}")

    def ask(self, query):
        """pl's question; what is said to pl."""
        self.asked += 1
        self.hears("pl", "query", P.QUERY_REF, query, talk=f"pl-1-{self.asked}")
        return self.answers()

    def answers(self):
        """Return the answers to pl in the last step."""
        read = self.core.wiring.languages.read
        to_pl = (sent for sent in self.sends() if sent.receiver == "pl")
        return [(sent.performative, read(sent)[0]) for sent in to_pl]

    def logged(self, event):
        """Return the fields of the line with this event in the last step."""
        (fields,) = [
            line.fields for effects in self.out for line in effects.logs if line.event == event
        ]
        return fields

    def later(self, seconds):
        """Time passes."""
        self.now += seconds
        self.step(Tick())


@pytest.fixture
def km():
    """One that just came up."""
    return Km()


def names(answer):
    """Ids of the objects."""
    return [one.id for one in answer.objects]


# --- patience -------------------------------------------------------------------------------------


def test_a_question_waits_for_the_look_around_and_is_put_off_after_a_while(km):
    """Each as long as the first, though what was put off is asked again."""
    for _ in range(2):
        assert km.ask(wm.ListObjects()) == []
        km.later(HELD_S - 0.1)
        assert km.answers() == []
        km.later(0.2)
        assert km.answers() == [(P.FAILURE, NOT_YET)]


def test_a_question_is_answered_when_the_look_around_is_over(km):
    """At once, and so is each one after it; nobody is to be woken any more."""
    km.met()
    km.ta(P.AGREE)
    assert km.ask(wm.ListObjects()) == []
    km.observed("jar_1", JAR)
    assert km.answers() == []
    km.observed("body", BODY)
    ((act, answer),) = km.answers()
    assert (act, names(answer)) == (P.INFORM_REF, ["jar_1"])
    assert [act for act, _ in km.ask(wm.ListObjects())] == [P.INFORM_REF]
    assert km.state.wakes == {}


def test_without_an_observer_nobody_waits_for_ever(km):
    """The asker is told why nothing is known; there are no objects either way."""
    km.later(ALONE_S - 0.1)
    assert km.memory.patient
    km.later(0.2)
    assert not km.memory.patient
    ((act, answer),) = km.ask(wm.ListObjects())
    assert act is P.FAILURE
    assert answer.why == (fact(Kind.NOT_LOOKED_AROUND, fact(Kind.OBSERVER_AWAY)),)
    assert not answer.later
    ((_, other),) = km.ask(wm.ObjectPose(object="jar_1"))
    assert Kind.NOT_LOOKED_AROUND not in {one.kind for one in other.why}


def test_an_observer_that_agreed_may_take_its_time(km):
    """Till it is gone: then it is waited for as at first."""
    km.met()
    km.later(1.0)
    km.ta(P.AGREE)
    km.later(10.0 * ALONE_S)
    assert km.memory.patient
    km.step(PeerChanged("ta", None))
    km.later(ALONE_S - 0.1)
    assert km.memory.patient
    km.later(0.2)
    assert km.memory.blind


def test_one_that_seemed_gone_for_a_moment_is_not_waited_for_less(km):
    """The same life is there again: the look around goes on."""
    km.met()
    km.ta(P.AGREE)
    km.step(PeerChanged("ta", None))
    km.step(PeerChanged("ta", 1))
    assert km.subscribes() == []
    km.later(2.0 * ALONE_S)
    assert km.memory.patient


def test_one_that_has_not_agreed_and_goes_is_waited_for_no_longer(km):
    """The wait since km came up goes on."""
    km.met()
    km.later(ALONE_S / 2)
    km.step(PeerChanged("ta", None))
    km.step(PeerChanged("ta", 1))
    km.later(ALONE_S / 2 + 0.1)
    assert km.memory.blind


def test_a_look_around_that_failed_is_told_and_the_next_observer_gives_hope(km):
    """Its reason is km's, until another life of ta looks."""
    km.met()
    km.ta(P.AGREE)
    km.observed("look", wm.NothingSeen(DARK))
    ((_, answer),) = km.ask(wm.ListObjects())
    assert answer.why == (fact(Kind.NOT_LOOKED_AROUND, DARK),)
    assert km.state.wakes == {}
    km.met(2)
    assert (km.memory.patient, km.memory.blind) == (True, ())
    assert km.ask(wm.ListObjects()) == []


def test_what_was_seen_stays_seen(km):
    """A later look that fails, or another life of ta, makes nobody wait; a look that succeeds ends
    blindness.
    """
    km.met()
    km.ta(P.AGREE)
    km.observed("body", BODY)
    km.observed("look", wm.NothingSeen(DARK))
    assert (km.memory.patient, km.memory.blind) == (False, ())
    km.met(2)
    assert not km.memory.patient


def test_a_lost_world_is_forgotten_and_looked_for(km):
    """Nothing of before counts, neither what arrives late nor a hypothetical state; questions wait
    for the look around that follows. The store is told.
    """
    lost = wm.WorldLost((fact(Kind.NEW_WORLD),))
    km.met()
    km.ta(P.AGREE)
    km.observed("jar_1", JAR)
    km.observed("body", BODY)
    assert km.memory.scene.things
    km.ask(wm.HypotheticalState(id="p1/0"))
    km.observed("world", lost)
    assert km.tells == [Mirror(km.memory.scene)]
    assert (km.memory.scene.things, km.memory.scene.hands, km.memory.scene.joints) == ({}, {}, {})
    assert (km.memory.patient, km.ask(wm.ListObjects())) == (True, [])
    km.observed("jar_1", JAR)
    km.observed("body", BODY)
    assert not km.memory.patient
    assert list(km.memory.scene.things) == ["jar_1"]
    assert km.answers()
    asked = km.ask(wm.ObjectPose(state="p1/0", object="jar_1"))
    assert asked == [(P.FAILURE, wm.UnknownState("p1/0"))]


def test_a_loss_that_is_told_after_what_was_seen_later_forgets_nothing(km):
    """What was seen is of the new world."""
    km.met()
    km.ta(P.AGREE)
    km.seen += 1
    km.observed("jar_1", JAR)
    km.observed("body", BODY)
    before = km.memory
    km.ta(P.INFORM, wm.WorldLost((fact(Kind.NEW_WORLD),)), id="world@1.1")
    assert (km.memory, km.tells) == (before, [])


def test_a_restart_goes_on_waiting_only_where_it_waited(km):
    """The scene is shown to the store either way."""
    km.state = km.core.boot(km.core.record(km.state))
    km.step(Started(first=False))
    assert set(km.state.wakes.values()) == {km.now + HELD_S, km.now + ALONE_S}
    km.met()
    km.ta(P.AGREE)
    km.observed("jar_1", JAR)
    km.observed("body", BODY)
    scene = km.memory.scene
    km.state = km.core.boot(km.core.record(km.state))
    km.step(Started(first=False))
    assert km.tells == [Mirror(scene)]
    assert km.state.wakes == {}


# --- the subscription -----------------------------------------------------------------------------


def test_each_life_of_the_observer_is_subscribed_to_once(km):
    """The older subscription is dropped; other agents are not subscribed to."""
    first = km.met()
    km.ta(P.AGREE)
    km.step(PeerChanged("ta", 1))
    km.step(PeerChanged("pl", 1))
    assert km.subscribes() == []
    second = km.met(2)
    assert first not in km.state.soft.conversations
    soft = km.memory.soft
    assert (soft.subscription, soft.incarnation, soft.agreed) == (second, 2, False)


def test_a_subscription_that_is_refused_is_tried_again(km):
    """After a while, and only while the observer is there."""
    km.met()
    km.ta(P.REFUSE)
    assert km.subscribes() == []
    km.later(AGAIN_S - 0.1)
    assert km.subscribes() == []
    km.later(0.2)
    assert len(km.subscribes()) == 1
    km.ta(P.REFUSE)
    km.step(PeerChanged("ta", None))
    km.later(AGAIN_S + 0.1)
    assert km.subscribes() == []


def test_a_subscription_that_is_over_is_renewed_when_the_observer_appears_again(km):
    """The same life of it, and nobody has agreed to anything."""
    km.met()
    km.ta(P.AGREE)
    km.ta(P.FAILURE)
    soft = km.memory.soft
    assert (soft.subscription, soft.incarnation, soft.agreed) == ("", 0, False)
    km.met(1)
    assert not km.memory.soft.agreed


def test_an_observer_that_cannot_be_understood_is_asked_again(km):
    """After a while."""
    km.met()
    km.ta(P.AGREE, Raw(b"\xc1"), language="WM")
    km.later(AGAIN_S + 0.1)
    assert len(km.subscribes()) == 1


# --- what is known --------------------------------------------------------------------------------


def test_the_store_is_told_of_each_new_scene(km):
    """And of none that is as it was."""
    assert km.tells == [Mirror(Scene())]
    km.met()
    km.ta(P.AGREE)
    km.observed("jar_1", JAR)
    assert km.tells == [Mirror(km.memory.scene)]
    assert list(km.memory.scene.things) == ["jar_1"]
    km.observed("look", wm.NothingSeen(DARK))
    assert km.tells == []


def test_an_observation_without_a_version_is_logged_and_changes_nothing(km):
    """Nobody could tell whether it is newer."""
    km.met()
    km.ta(P.AGREE)
    before = km.memory
    km.ta(P.INFORM, JAR, id="jar_1")
    assert km.memory == before
    assert km.logged("observation without a version")["id"] == "jar_1"


def test_a_hypothetical_state_is_kept_until_it_is_dropped(km):
    """A death takes it, and who asks is told that it is gone."""
    km.met()
    km.ta(P.AGREE)
    km.observed("jar_1", JAR)
    km.observed("body", BODY)
    assert km.ask(wm.HypotheticalState(id="p1/0")) == [(P.INFORM_REF, wm.Made("p1/0"))]
    ((act, pose),) = km.ask(wm.ObjectPose(state="p1/0", object="jar_1"))
    assert (act, pose.pose.xyz) == (P.INFORM_REF, (1.0, 0.0, 1.0))
    km.ask(wm.DropStates(prefix="p1/"))
    ((act, gone),) = km.ask(wm.ObjectPose(state="p1/0", object="jar_1"))
    assert (act, gone) == (P.FAILURE, wm.UnknownState("p1/0"))


def test_what_is_not_known_is_in_the_log_with_all_that_was_asked(km):
    """A fact says it shortly."""
    km.met()
    km.ta(P.AGREE)
    km.observed("body", BODY)
    km.ask(wm.ObjectPose(state="gone", object="jar_1"))
    assert km.logged("no such hypothetical state")["state"] == "gone"
    km.ask(wm.Holds(relation="likes", subject="jar_1"))
    unknown = km.logged("not known")
    assert "jar_1" in unknown["asked"]
    assert unknown["why"] == sentences.operator((fact(Kind.UNKNOWN_TO_KM, "likes"),))
