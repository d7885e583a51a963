"""The last word of a subscription: said again until the subscriber has it or is gone; nobody is
subscribed for ever.
"""

from typing import Any

import msgspec
from driven import Driven, quiet
from hypothesis import example, given, settings
from hypothesis import strategies as st
from toy_agents import fleet, single
from toy_observers import Finish, Seen, Topic, wiring

from agent_runtime.core.agent import Agent
from agent_runtime.core.events import Broken, LinkChanged, Local, PeerChanged, Receipted, Received
from agent_runtime.core.streams import LAST_MESSAGES, RESEND_LAST
from agent_runtime.core.turn import Turn
from agent_runtime.testing.memory_bus import Faults
from fipa_codec.performatives import Performative as P


class Ended(msgspec.Struct, frozen=True):
    """The subscriber's memory: conversations it opened, and how each ended."""

    opened: int = 0
    ended: int = 0


def subscribe(memory: Ended, turn: Turn) -> Ended:
    """Subscribe once the watcher is there, note the end."""
    over = not turn.conversations("watcher")
    match turn.event:
        case PeerChanged(agent="watcher", incarnation=int()) if over:
            turn.open("watcher", "subscribe", P.SUBSCRIBE, Topic())
            return Ended(memory.opened + 1, memory.ended)
        case Received() | Broken() as event if over or isinstance(event, Broken):
            return Ended(memory.opened, memory.ended + 1)
    return memory


def agree_then_fail(turn: Turn) -> None:
    """Agree to subscriptions; at a person's word end all of them."""
    match turn.event:
        case Received(content=Topic()) as received:
            turn.say(received.conversation, P.AGREE)
        case Local(content=Finish()):
            for talk in turn.conversations("knower"):
                turn.say(talk.id, P.FAILURE)


def watcher() -> Agent[Any]:
    """The observed."""
    return quiet(agree_then_fail, name="watcher", local=Seen | Finish)


def knower() -> Agent[Ended]:
    """The subscriber."""
    return single("knower", Ended(), subscribe)


def subscribed() -> Driven:
    """The observed, with one subscription it agreed to."""
    one = Driven(watcher(), wiring("watcher"))
    one.step(PeerChanged("knower", 1))
    subscribing(one, "knower-1-1")
    assert [said.performative for said in one.sends()] == [P.AGREE]
    return one


def subscribing(one: Driven, talk: str) -> None:
    """The knower subscribes."""
    one.hears("knower", "subscribe", P.SUBSCRIBE, Topic(), talk=talk)


def test_a_failure_said_while_the_router_is_away_is_said_when_it_is_back() -> None:
    """At once, and then until it is receipted."""
    one = subscribed()
    one.step(LinkChanged(False))
    one.step(Local(Finish()))
    assert one.sends() == []
    one.step(LinkChanged(True))
    (last,) = one.sends()
    assert last.performative is P.FAILURE
    one.now = one.state_wake()
    assert one.state.soft.last
    one.step(Receipted("knower", subject=last.id))
    assert one.out[-1].wake_at is None


def test_it_ends_with_its_subscriber() -> None:
    """A subscriber that is gone, or has a new life, knows nothing of that conversation."""
    for life in ((None,), (2,), (1, "another")):
        one = subscribed()
        one.state = msgspec.structs.replace(one.state, journals={"knower": "old"})
        one.step(Local(Finish()))
        assert one.state.soft.last
        one.step(PeerChanged("knower", *life))
        assert not one.state.soft.last


def test_a_copy_of_the_opening_does_not_open_it_again() -> None:
    """While its last word is on the way."""
    one = subscribed()
    one.step(Local(Finish()))
    subscribing(one, "knower-1-1")
    assert one.sends() == []
    assert not one.state.soft.conversations


def test_it_is_receipted_at_once() -> None:
    """By a subscriber that asks no more."""
    one = Driven(knower(), wiring("knower"))
    one.step(PeerChanged("watcher", 1))
    (opening,) = one.sends()
    labels = {"talk": opening.conversation, "in_reply_to": opening.reply_with}
    assert one.hears("watcher", "subscribe", P.AGREE, **labels).receipts == ()
    effects = one.hears("watcher", "subscribe", P.FAILURE, id="last", **labels)
    assert [receipt.subject for receipt in effects.receipts] == ["last"]


def test_a_subscription_of_the_present_life_is_newer_than_all_others() -> None:
    """A subscriber whose journal was lost counts its lives from 1 again."""
    one = subscribed()
    one.step(PeerChanged("knower", 5))
    subscribing(one, "knower-5-9")
    one.step(PeerChanged("knower", 2))
    subscribing(one, "knower-2-1")
    assert [said.performative for said in one.sends()] == [P.AGREE]


def test_they_are_bounded() -> None:
    """A subscriber that never receipts fills no memory, and the re-sending gets slow."""
    one = subscribed()
    for number in range(2 * LAST_MESSAGES):
        subscribing(one, f"knower-1-{number + 2}")
        one.step(Local(Finish()))
    assert len(one.state.soft.last) == LAST_MESSAGES
    assert max(ask.gap for ask in one.state.soft.last.values()) <= RESEND_LAST


@given(
    seed=st.integers(0, 2**32),
    loss=st.sampled_from([0.0, 0.3, 0.6]),
    duplication=st.sampled_from([0.0, 0.3]),
    delay=st.sampled_from([0.0, 0.4]),
    at_s=st.floats(0.0, 3.0),
    away_s=st.sampled_from([0.0, 1.0, 30.0]),
)
# copies come after the receipt
@example(seed=200, loss=0.0, duplication=0.3, delay=0.4, at_s=0.0, away_s=0.0)
@settings(max_examples=150, deadline=None)
def test_nobody_is_subscribed_for_ever(
    seed: int, loss: float, duplication: float, delay: float, at_s: float, away_s: float
) -> None:
    """Whatever is lost: once the observed ended what it had agreed to, the subscriber knows, and
    nothing is left.
    """
    agents = ((watcher(), wiring("watcher")), (knower(), wiring("knower")))
    usual = Faults(loss=loss, duplication=duplication, delay=delay)
    wires = fleet(*agents, seed=seed, faults=usual)

    def agreed() -> bool:
        return wires.up("watcher") and bool(wires.nodes["watcher"].state.soft.conversations)

    wires.run(agreed, limit_s=3600.0)
    wires.run_for(at_s)
    wires.faults = Faults(loss=1.0 if away_s else loss)
    wires.post("watcher", Finish())
    wires.run_for(away_s)
    wires.faults = usual

    def over() -> bool:
        states = [node.state for node in wires.nodes.values()]
        return wires.memory("knower").ended == 1 and not any(
            one.soft.last or one.soft.conversations for one in states
        )

    wires.run(over, limit_s=3600.0)
    wires.run_for(5.0)
    assert over()
    assert wires.memory("knower").opened == 1
