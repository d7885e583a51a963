"""Messages that nobody receives are reported after a while, and no more once they are received."""

import pytest
from driven import message
from toy_agents import asker, wirings

from agent_runtime.core.peers import PATIENCE_S, Peers, Unheard, Watch, unheard_text
from agent_runtime.core.state import Ask, CoreState, Outgoing, fresh
from fipa_codec.performatives import Performative as P

ONE = message(P.REQUEST, "asker>server", "request", conversation="c")
SAID, PINGED, ASKED = (PATIENCE_S[what] for what in ("said", "pinged", "asked"))
NOBODY: frozenset[tuple[str, bytes]] = frozenset()


@pytest.fixture
def watch() -> Watch:
    """The asker's."""
    return Watch(wirings()[0])


@pytest.fixture
def peers() -> Peers:
    """The server lives."""
    one = Peers(("server",))
    one.links(True, 0.0)
    one.token("server", 1, True, 0.0)
    return one


def saying(*numbers: int) -> CoreState:
    """An asker to whom these are not receipted."""
    state = fresh(asker())
    if numbers:
        state.outbox["server"] = tuple(Outgoing(number, ONE) for number in numbers)
    return state


def test_what_is_not_receipted_is_told_once(watch: Watch, peers: Peers) -> None:
    """Not before its time, then once; and once that it is over."""
    assert watch.look(saying(1), NOBODY, peers, 10.0) == []
    assert watch.look(saying(1), NOBODY, peers, 10.0 + SAID - 0.1) == []
    one = Unheard("server", "T1", "said", 10.0)
    assert watch.look(saying(1, 2), NOBODY, peers, 10.0 + SAID) == [(one, True)]
    assert watch.look(saying(1, 2), NOBODY, peers, 99.0) == []
    assert watch.now == (one,)
    assert watch.look(saying(), NOBODY, peers, 100.0) == [(one, False)]
    assert watch.now == ()


def test_a_stream_that_goes_on_is_heard(watch: Watch, peers: Peers) -> None:
    """There is always something under way, but never the same."""
    for number in range(1, 50):
        assert watch.look(saying(number), NOBODY, peers, 1.0 * number) == []


@pytest.mark.parametrize("change", ["dead", "no router", "another life"])
def test_nobody_is_suspected_who_is_not_there(watch: Watch, peers: Peers, change: str) -> None:
    """A peer that died, or came back just now, has its reasons; without a router all have."""
    watch.look(saying(1), NOBODY, peers, 10.0)
    if change == "dead":
        peers.token("server", 1, False, 11.0)
        peers.gone(12.0)
    elif change == "no router":
        peers.links(False, 11.0)
    else:
        peers.token("server", 2, True, 11.0)
    assert watch.look(saying(1), NOBODY, peers, 10.0 + SAID) == []
    assert watch.now == ()


def test_a_channel_without_an_answered_ping_is_told(watch: Watch, peers: Peers) -> None:
    """That is why the agent is not ready."""
    pings, one = {("server", b"T1")}, Unheard("server", "T1", "pinged", 10.0)
    assert watch.look(saying(), pings, peers, 10.0) == []
    assert watch.look(saying(), pings, peers, 10.0 + PINGED) == [(one, True)]
    assert watch.look(saying(), NOBODY, peers, 30.0) == [(one, False)]


def test_a_question_without_an_answer_is_told_late(watch: Watch, peers: Peers) -> None:
    """An answer may take its time; the oldest question counts, and each has its own time."""
    state = saying()
    state.soft.asks["q1"] = Ask(ONE, 0.0, 2.0)
    assert watch.look(state, NOBODY, peers, 0.0) == []
    assert watch.look(state, NOBODY, peers, ASKED - 0.1) == []
    (found,) = watch.look(state, NOBODY, peers, ASKED)
    assert found == (Unheard("server", "T1", "asked", 0.0), True)
    state.soft.asks = {"q2": Ask(ONE, 0.0, 2.0)}
    assert watch.look(state, NOBODY, peers, ASKED + 1.0) == [(found[0], False)]


def test_the_words_name_both_and_the_channel() -> None:
    """And what it may be."""
    text = unheard_text("asker", Unheard("server", "T1", "said", 10.0), 22.0)
    assert text == (
        "what asker says to server on T1 is not received since 12 s:"
        " perhaps the rules of server deny it, or server hangs"
    )


def test_who_receipts_but_does_not_take_it_yet_hears(watch: Watch, peers: Peers) -> None:
    """A peer may wait with a message that is not its turn; it says how far it is, and that is a
    sign of life enough.
    """
    for second in range(61):
        assert watch.look(saying(1), NOBODY, peers, float(second)) == []
        if second % 2:
            watch.receipted("server")
    one = Unheard("server", "T1", "said", 60.0)
    assert watch.look(saying(1), NOBODY, peers, 60.0 + SAID) == [(one, True)]
