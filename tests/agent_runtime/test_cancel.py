"""request with cancel over faulty wires: whatever crosses what, both sides end, and each cancel has
its answer.
"""

from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import Struct
from msgspec.structs import replace
from toy_agents import Double, Doubled, Want, fleet, single, wirings

from agent_runtime.core.events import Arrived, Broken, Late, Local, Received, Tick, Woken
from agent_runtime.core.step import Core
from agent_runtime.core.turn import Turn
from agent_runtime.core.wiring import Delivery
from agent_runtime.testing.memory_bus import Faults
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P


class Client(Struct, frozen=True):
    """Conversations begun, cancels said, and all that was heard, as words."""

    begun: tuple[str, ...] = ()
    cancelled: tuple[str, ...] = ()
    heard: tuple[tuple[str, str], ...] = ()
    broken: int = 0


def ask_and_cancel(memory: Client, turn: Turn) -> Client:
    """A positive number: ask for it, and cancel after that many tenths of a second; 0: ask only."""
    match turn.event:
        case Local(content=Want(number=number)):
            name = turn.open("server", "request", P.REQUEST, Double(number), reply_by_s=1.0)
            if number:
                turn.wake(name, turn.now + number / 10)
            return replace(memory, begun=(*memory.begun, name))
        case Woken(name=name) | Late(conversation=name):
            return cancel(memory, turn, name)
        case Received(communicate=communicate) as received:
            answers_cancel = communicate.in_reply_to not in ("", _asked(turn, received))
            word = f"{communicate.performative}{'[cancel]' if answers_cancel else ''}"
            return replace(memory, heard=(*memory.heard, (received.conversation, word)))
        case Broken():
            return replace(memory, broken=memory.broken + 1)
        case _:
            return memory


def _asked(turn: Turn, received: Received) -> str:
    """m_w of the opening; an ended conversation is held no more, and then the lower number was the
    opening's.
    """
    if turn.holds(received.conversation):
        return turn.conversation(received.conversation).asked
    failed = received.communicate.performative is P.FAILURE
    return "" if failed else received.communicate.in_reply_to


def cancel(memory: Client, turn: Turn, name: str) -> Client:
    """Cancel it, unless it is over or cancelled already."""
    if not turn.holds(name) or name in memory.cancelled:
        return memory
    turn.say(name, P.CANCEL)
    return replace(memory, cancelled=(*memory.cancelled, name))


class Server(Struct, frozen=True):
    """The work in progress; every end."""

    working: tuple[str, ...] = ()
    ended: tuple[tuple[str, str], ...] = ()


def work(memory: Server, turn: Turn) -> Server:
    """Agree, work for 0.3 s; a cancel stops it."""
    match turn.event:
        case Received(content=Double(), conversation=name):
            turn.say(name, P.AGREE)
            turn.wake(name, turn.now + 0.3)
            return replace(memory, working=(*memory.working, name))
        case Received(communicate=said, conversation=name) if said.performative is P.CANCEL:
            turn.say(name, P.INFORM, Doubled(0), kind=Kind.CANCEL)
            turn.unwake(name)
            return over(memory, name, "cancelled")
        case Woken(name=name) if name in memory.working:
            turn.say(name, P.INFORM, Doubled(1))
            return over(memory, name, "done")
    return memory


CLIENT = single("asker", Client(), ask_and_cancel, local=Want)
SERVER = single("server", Server(), work)


def over(memory: Server, name: str, how: str) -> Server:
    """No longer worked on."""
    rest = tuple(one for one in memory.working if one != name)
    return Server(rest, (*memory.ended, (name, how)))


@given(
    numbers=st.lists(st.integers(0, 5), min_size=1, max_size=6),
    seed=st.integers(0, 2**32),
    loss=st.sampled_from([0.0, 0.3]),
    delay=st.sampled_from([0.0, 0.4]),
    crash=st.sampled_from([0.0, 0.05]),
)
@settings(max_examples=150, deadline=None)
def test_every_cancel_ends(
    numbers: list[int], seed: int, loss: float, delay: float, crash: float
) -> None:
    """All conversations end on both sides, nobody misunderstands, each is done or cancelled exactly
    once.
    """
    wires = fleet(
        *zip((CLIENT, SERVER), wirings(), strict=True),
        seed=seed,
        faults=Faults(loss=loss, duplication=0.1, delay=delay),
    )
    for place, number in enumerate(numbers):
        wires.post("asker", Want(number), delay_s=0.02 * place)
    wires.run(lambda: len(wires.memory("asker").begun) == len(numbers))
    wires.faults = Faults(loss=loss, duplication=0.1, delay=delay, crash=crash)
    wires.run_for(10.0)
    wires.faults = Faults()
    wires.run_for(10.0)
    client, server = wires.memory("asker"), wires.memory("server")
    for name in ("asker", "server"):
        state = wires.nodes[name].state
        assert state is not None
        assert not state.conversations
        assert not state.outbox
        assert "not understood" not in state.counts
    assert client.broken == 0
    assert sorted(name for name, _ in server.ended) == sorted(client.begun)
    ends = dict(server.ended)
    for name in client.begun:
        heard = [word for conversation, word in client.heard if conversation == name]
        if ends[name] == "cancelled":
            assert name in client.cancelled
            assert heard[-1].startswith("inform")
        elif name in client.cancelled:
            assert {"inform", "failure[cancel]"} <= set(heard)
        else:
            assert heard[-1] == "inform"


def test_a_volatile_cancel_is_asked_again_though_an_agree_crossed_it() -> None:
    """A word that crosses a cancel is not an answer to it: else one lost cancel would leave its
    sender waiting for ever.
    """
    client, worker = map(Core, (CLIENT, SERVER), wirings(Delivery.VOLATILE))
    asking, asked = client.step(client.boot(None), Local(Want(1)), 0.0)
    cancelling, cancelled = client.step(asking, Tick(), 0.15)
    assert [one.performative for one in cancelled.sends] == [P.CANCEL]
    _, agreed = worker.step(worker.boot(None), Arrived(asked.sends[0]), 0.0)
    crossed, _ = client.step(cancelling, Arrived(agreed.sends[0]), 0.16)
    assert crossed.memory.heard[-1][1] == "agree"
    _, again = client.step(crossed, Tick(), 1.0)
    assert P.CANCEL in [one.performative for one in again.sends]
