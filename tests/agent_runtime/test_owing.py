"""Words an agent owes its peers: said at once, again after growing waits, and no more once
receipted.
"""

from typing import Any

import pytest
from driven import Driven, message, recording
from hypothesis import given
from hypothesis import strategies as st
from toy_agents import asker as doubler
from toy_agents import wirings
from toy_observers import Seen, Topic, WhatOf, asker, watcher, wiring

from agent_runtime.core.events import (
    Arrived,
    LinkChanged,
    Local,
    PeerChanged,
    Receipted,
    Started,
)
from agent_runtime.core.streams import RESEND_FIRST, observation_id, parse_observation
from fipa_codec.communicate import MOST_DIGITS
from fipa_codec.performatives import Performative as P

TO_SERVER = wirings()[0]
LAST = "all-told"


def subscribe(name: str = "knower-1-1") -> Arrived:
    """The knower's subscription."""
    labels = {"conversation": name, "reply_with": name, "id": name}
    return Arrived(message(P.SUBSCRIBE, "knower>watcher", "subscribe", Topic(), **labels))


def ids(one: Driven) -> list[str]:
    """Return the ids of words said in the last step; for words other than observations the
    performative.
    """
    said = one.sends()
    return [one.id if one.performative is P.INFORM else str(one.performative) for one in said]


def receipted(one: Driven, subject: str) -> Any:
    """The knower's receipt of the newest observation of this subject."""
    return one.step(Receipted("knower", subject=subject, version=version(one, subject)))


def version(one: Driven, subject: str) -> tuple[int, int]:
    """Of the newest observation due."""
    return one.state.due["knower"][subject].version


@pytest.fixture
def observer() -> Driven:
    """A watcher to whom the knower is subscribed."""
    one = Driven(watcher(), wiring("watcher"))
    one.step(subscribe())
    assert ids(one) == ["agree"]
    return one


def test_what_is_due_follows_the_agree_at_once() -> None:
    """Observed before anybody subscribed: it is owed to the subscriber, and sent within the
    subscription.
    """
    one = Driven(watcher(), wiring("watcher"))
    one.step(Local(Seen("jar", 1)))
    assert ids(one) == []
    one.step(subscribe())
    assert ids(one) == ["agree", "jar@1.1"]
    one.step(subscribe())  # asked again: the agree was lost
    assert ids(one) == ["agree", "jar@1.1"]


def test_an_agree_is_not_said_again_unasked(observer: Driven) -> None:
    """Only who asks asks again."""
    assert observer.out[0].wake_at is None
    observer.later(observer.now + 10.0)
    assert ids(observer) == []


def test_an_observation_is_sent_until_its_receipt(observer: Driven) -> None:
    """A receipt of an older version, or of another subject, changes nothing."""
    assert observer.step(Local(Seen("jar", 1))).wake_at == observer.now + RESEND_FIRST
    old = version(observer, "jar")
    observer.step(Local(Seen("jar", 2)))
    new = version(observer, "jar")
    assert ids(observer) == [observation_id("jar", new)]
    for subject, known in (("jar", old), ("bowl", new)):
        before = observer.state.soft.resend
        observer.step(Receipted("knower", subject=subject, version=known))
        assert (ids(observer), observer.state.soft.resend) == ([], before)
    observer.later(observer.now + RESEND_FIRST)
    assert ids(observer) == [observation_id("jar", new)]
    assert observer.state.counts["resent"] == 1
    assert receipted(observer, "jar").wake_at is None
    assert observer.state.due == {}


def test_the_last_one_leaves_with_the_receipt_of_the_others(observer: Driven) -> None:
    """Not before, and at once; a receipt that leaves others due sends nothing."""
    for subject in ("jar", "bowl", LAST):
        observer.step(Local(Seen(subject, 1)))
    assert ids(observer) == []
    for subject, said in (("jar", []), ("bowl", [LAST]), (LAST, [])):
        told = [observation_id(one, version(observer, one)) for one in said]
        receipted(observer, subject)
        assert ids(observer) == told
    assert observer.state.due == {}


def test_a_receipt_sends_nothing_that_was_not_waiting(observer: Driven) -> None:
    """Neither the last one, under way already where nothing else is due, nor what else is; a peer
    that receipts is there, so the wait for the rest, which is on its way, starts anew.
    """
    observer.step(Local(Seen(LAST, 1)))
    assert ids(observer) == [observation_id(LAST, version(observer, LAST))]
    observer.step(Receipted("knower", taken=7))
    assert ids(observer) == []
    observer.step(Local(Seen("jar", 1)))
    observer.step(Local(Seen("bowl", 1)))
    observer.now += 0.1
    assert receipted(observer, "jar").wake_at == observer.now + RESEND_FIRST
    assert ids(observer) == []


def test_only_the_last_receipt_of_observations_settles() -> None:
    """It reaches the behaviour whatever it takes; a stream without anything out any more, or a
    copy, does not.
    """

    def said(turn):
        return isinstance(turn.event, Local) and turn.observe("knower", "jar", Seen("jar", 1))

    def takes(memory, event):
        return isinstance(event, Local)

    one = Driven(recording(said=said, takes=takes, name="watcher", local=Seen), wiring("watcher"))
    one.step(Local(Seen("jar", 1)))
    one.step(Receipted("knower", taken=7))
    settled = Receipted("knower", subject="jar", version=version(one, "jar"))
    one.step(settled)
    one.step(settled)
    assert one.state.memory.seen == ("Local", "Settled")
    stream = Driven(doubler(1), TO_SERVER)
    stream.step(Started())
    assert stream.step(Receipted("server", taken=1)).handled is None
    assert stream.state.outbox == {}


# --- a peer that comes back -----------------------------------------------------------------------


@pytest.fixture(params=["stream", "question"])
def waiting(request: pytest.FixtureRequest) -> tuple[Driven, str]:
    """One that has said something at 100 s and has no word back, and its peer."""
    if request.param == "stream":
        one = Driven(doubler(1), TO_SERVER)
        one.step(Started())
        return one, "server"
    one = Driven(asker(), wiring("asker"))
    one.step(Local(WhatOf("jar")))
    return one, "knower"


def test_what_was_just_said_is_not_said_again_for_a_peer_that_appears(
    waiting: tuple[Driven, str],
) -> None:
    """It is on its way; the wait for it ends when it would have."""
    one, peer = waiting
    assert len(one.sends()) == 1
    one.now += 0.1
    effects = one.step(PeerChanged(peer, 1))
    assert one.sends() == []
    assert effects.wake_at == pytest.approx(100.0 + RESEND_FIRST)
    one.later(100.0 + RESEND_FIRST)
    assert len(one.sends()) == 1
    one.now += 0.05
    assert one.step(PeerChanged(peer, 2)).wake_at == pytest.approx(one.now - 0.05 + RESEND_FIRST)
    assert one.sends() == []


def test_what_was_said_long_ago_is_said_at_once_and_the_wait_starts_anew(
    waiting: tuple[Driven, str],
) -> None:
    """Only to the peer that appeared."""
    one, peer = waiting
    for _ in range(4):
        one.later(one.state_wake())
    one.now += 1.0
    one.step(PeerChanged("somebody", 1))
    assert one.sends() == []
    effects = one.step(PeerChanged(peer, 1))
    assert len(one.sends()) == 1
    assert effects.wake_at == pytest.approx(one.now + RESEND_FIRST)


def test_when_the_router_is_back_all_is_said_at_once(waiting: tuple[Driven, str]) -> None:
    """However fresh; while it is away nothing is planned."""
    one, _ = waiting
    one.now += 0.05
    effects = one.step(LinkChanged(False))
    later = [] if effects.wake_at is None else [effects.wake_at]
    assert all(at > one.now + 1.0 for at in later), "only reply-by goes on"
    effects = one.step(LinkChanged(True))
    assert len(one.sends()) == 1
    assert effects.wake_at == pytest.approx(one.now + RESEND_FIRST)


def test_waits_double_up_to_two_seconds(waiting: tuple[Driven, str]) -> None:
    """A question as a stream."""
    one, _ = waiting
    for gap in (0.2, 0.4, 0.8, 1.6, 2.0):
        assert one.state_wake() - one.now == pytest.approx(gap)
        one.later(one.state_wake())
        assert len(one.sends()) == 1
    assert sum(one.state.counts.values()) == 5


# --- ids ------------------------------------------------------------------------------------------

SUBJECTS = st.text(st.characters(codec="ascii", exclude_categories=["Cc", "Zs"]), min_size=1)
VERSIONS = st.integers(0, 10**MOST_DIGITS - 1)


@given(SUBJECTS, st.tuples(VERSIONS, VERSIONS))
def test_an_id_tells_subject_and_version(subject: str, version: tuple[int, int]) -> None:
    """This holds for any characters in the subject."""
    assert parse_observation(observation_id(subject, version)) == (subject, version)


@pytest.mark.parametrize(
    "id", ["", "7", "jar", "@1.1", "jar@", "jar@1", "jar@1.", "jar@.1", "jar@1.x", "jar@x.1"]
)
def test_other_ids_are_none(id: str) -> None:
    """A part is missing, or no number; foreign digits are none either."""
    assert parse_observation(id) is None
    assert parse_observation(id.replace("1", "²")) is None
