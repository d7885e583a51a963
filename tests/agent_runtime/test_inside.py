"""Memory of an agent as its heartbeat's file tells it: waiting messages, open conversations, last
steps.
"""

from collections import deque

from driven import Driven, agree, recording, request
from toy_agents import Want, wirings

from agent_runtime.core.control import Command, Pause
from agent_runtime.core.events import Deed, Local, Ordered
from agent_runtime.io.heartbeat import SHOWN, looked_into
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P

_, TO_ASKER = wirings()


def test_what_waits_is_told_in_its_order() -> None:
    """A communicate by act, sender and protocol; a word of the own side by its class. More than is
    shown is counted.
    """
    one = Driven(recording(said=agree), TO_ASKER)
    for event in (Ordered(Command("1", Pause())), request(1), Local(Want(1))):
        one.step(event)
    found = looked_into(one.state, deque())
    told = [(each.what, each.peer, each.protocol) for each in found.inbox]
    assert told == [("request", "asker", "request"), ("Local", "", "")]
    assert (found.waiting, found.open) == (2, 0)
    for number in range(SHOWN):
        one.step(Local(Want(number)))
    found = looked_into(one.state, deque())
    assert (found.waiting, len(found.inbox)) == (SHOWN + 2, SHOWN)


def test_open_conversations_are_told_until_they_end() -> None:
    """With the state they are in, as this side sees it."""
    one = Driven(recording(said=agree), TO_ASKER)
    one.step(request(1, conversation="b"))
    (talk,) = looked_into(one.state, deque()).talks
    assert (talk.id, talk.peer, talk.protocol) == ("b", "asker", "request")
    assert (talk.role, talk.state) == ("participant", "agreed")


def test_a_step_is_told_in_the_words_of_the_design() -> None:
    """The step tells the word taken, the word said with its guard, and the state it led to."""
    taken, said = ("order", P.REQUEST, Kind.PLAIN), ("order", P.INFORM, Kind.CANCEL)
    deeds = [Deed("idle", "Received", taken, (said,), "busy")]
    deeds += [Deed("busy", "Woken", None, (), "idle")]
    one = Driven(recording(), TO_ASKER)
    first, second = looked_into(one.state, deque(enumerate(deeds))).steps
    assert (first.event, first.said) == ("order request", ("order inform[cancel]",))
    assert (second.before, second.event, second.after) == ("busy", "Woken", "idle")
