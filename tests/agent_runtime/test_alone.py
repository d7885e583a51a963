"""The bench for one agent: its peers hold real conversations, so only what is in sequence gets
through.
"""

import pytest
import toy_agents as toy

from agent_runtime.core.streams import OUTBOX_BOUND
from agent_runtime.testing.alone import Alone
from fipa_codec.errors import LocalProtocolError, RemoteProtocolError
from fipa_codec.performatives import Performative as P


def test_an_agent_that_asks_is_answered_by_hand() -> None:
    """Its words are there with their conversation; the answer goes back into it, and it goes on."""
    one = Alone(toy.asker(), toy.wirings()[0])
    one.post(toy.Want(4))
    (asked,) = one.said
    assert (one.state, one.content(asked)) == ("asking", toy.Double(4))
    one.answer(asked.conversation, P.INFORM, toy.Doubled(8))
    assert one.memory.answers == ((4, 8),)
    assert one.state == "idle"


def test_an_agent_that_is_asked_answers_in_pretended_time() -> None:
    """Agree at once, the result when its wake-up has come."""
    one = Alone(toy.server(), toy.wirings()[1])
    name = one.ask("asker", "request", P.REQUEST, toy.Double(3))
    assert one.answers(name) == (P.AGREE,)
    one.wait(0.05)
    assert one.answers(name) == (P.AGREE,)
    one.wait(0.1)
    assert one.answers(name) == (P.AGREE, P.INFORM)
    assert one.memory.done == (3,)


def test_a_message_that_waits_is_counted() -> None:
    """The asker is busy: a person's second word waits in the inbox."""
    one = Alone(toy.asker(), toy.wirings()[0])
    one.post(toy.Want(1))
    one.post(toy.Want(2))
    assert one.waiting == 1


def test_what_it_says_is_receipted_and_what_waits_is_taken() -> None:
    """More messages than an outbox holds, one behind the other: none stops the agent."""
    one = Alone(toy.server(), toy.wirings()[1])
    for number in range(2 * OUTBOX_BOUND):
        one.ask("asker", "request", P.REQUEST, toy.Double(number))
    one.wait(1.0)
    assert sorted(one.memory.done) == list(range(2 * OUTBOX_BOUND))


def test_nothing_out_of_sequence_gets_through() -> None:
    """Neither what the test says, nor what the agent says."""
    one = Alone(toy.server(), toy.wirings()[1])
    name = one.ask("asker", "request", P.REQUEST, toy.Double(3))
    with pytest.raises(LocalProtocolError):
        one.answer(name, P.INFORM, toy.Doubled(3))
    agreed = one.said[0]
    with pytest.raises(RemoteProtocolError):
        one.talks[name].receive(agreed)
