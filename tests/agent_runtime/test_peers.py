"""Death of a peer and links that were closed here are told apart, whatever order the news comes
in.
"""

import pytest
from driven import message
from hypothesis import given
from hypothesis import strategies as st
from toy_agents import asker, wirings

from agent_runtime.core.events import LinkChanged, PeerChanged
from agent_runtime.core.peers import (
    HASTE_S,
    PATIENCE_S,
    RETURN_S,
    Peers,
    Unheard,
    Watch,
    unheard_text,
)
from agent_runtime.core.state import Ask, CoreState, Outgoing, fresh
from fipa_codec.performatives import Performative as P


def living(*agents: str) -> Peers:
    """All of them alive, incarnation 1, and the links open."""
    peers = Peers(agents)
    peers.links(True, 0.0)
    for agent in agents:
        assert peers.token(agent, 1, True, 0.0) == [PeerChanged(agent, 1)]
    return peers


def test_a_death_is_believed_at_once() -> None:
    """A vanished token: dead, and told once."""
    peers = living("a", "b")
    assert peers.token("a", 1, False, 10.0) == []
    assert peers.look_at == 10.0
    assert peers.gone(10.0) == [PeerChanged("a", None)]
    assert peers.gone(99.0) == []
    assert peers.alive == {"b": 1}


def test_a_new_life_that_was_told_before_is_no_death() -> None:
    """Its token came before the old one vanished."""
    peers = living("a", "b")
    peers.token("b", 2, True, 10.0)
    peers.token("b", 1, False, 10.0)
    assert peers.gone(10.0) == []


def test_links_that_are_closed_here_are_nobodys_death() -> None:
    """Tokens vanish with them, and nobody is dead."""
    peers = living("a", "b")
    assert peers.links(False, 10.0) == [LinkChanged(False)]
    assert peers.token("a", 1, False, 10.0) == peers.token("b", 1, False, 10.0) == []
    assert peers.gone(100.0) == []
    assert peers.alive == {"a": 1, "b": 1}


def test_after_the_return_who_does_not_come_back_is_dead() -> None:
    """Opened again: tokens come again; the one that does not belongs to a dead agent."""
    peers = living("a", "b")
    peers.links(False, 10.0)
    assert peers.links(True, 20.0) == [LinkChanged(True)]
    assert peers.token("a", 1, True, 20.1) == [PeerChanged("a", 1)]
    assert peers.gone(20.0 + RETURN_S) == [PeerChanged("b", None)]


def test_a_new_incarnation_outlives_the_old_token() -> None:
    """The old token's end, before or after the new token's beginning, does not kill the new
    incarnation.
    """
    peers = living("a")
    peers.token("a", 1, False, 10.0)
    assert peers.token("a", 2, True, 10.01) == [PeerChanged("a", 2)]
    assert peers.token("a", 1, False, 10.02) == []
    assert peers.gone(100.0) == []
    assert peers.token("a", 1, True, 100.0) == [], "an older incarnation is never believed again"


def test_strangers_are_nobody() -> None:
    """Agents we do not talk to make no news."""
    assert living("a").token("stranger", 1, True, 1.0) == []


def test_a_life_that_is_not_the_peers_own_does_not_make_it_gone_for_good() -> None:
    """A thief's higher incarnation is believed while its token is there; then the peer's own counts
    again.
    """
    peers = living("a")
    assert peers.token("a", 999, True, 10.0) == [PeerChanged("a", 999)]
    assert peers.token("a", 999, False, 20.0) == []
    assert peers.gone(20.0) == [PeerChanged("a", 1)]


def test_a_peer_whose_last_tokens_vanish_while_its_news_waits_is_dead() -> None:
    """The higher life is believed, and vanishes with the other one within the pause between two
    news.
    """
    peers = living("a")
    peers.token("a", 2, True, 10.0)
    peers.token("a", 2, False, 10.01)
    assert peers.gone(10.01) == [], "the other life waits until news is due again"
    peers.token("a", 1, False, 10.02)
    assert peers.look_at is not None
    assert peers.gone(peers.look_at) == [PeerChanged("a", None)]


def test_a_journal_that_is_lost_while_the_old_life_ends() -> None:
    """Its lives count from 1 again, within the grace: the new one is believed."""
    peers = living("a")
    peers.token("a", 5, True, 10.0)
    peers.token("a", 1, False, 10.0)
    peers.token("a", 5, False, 20.0)
    assert peers.token("a", 1, True, 20.01) == [PeerChanged("a", 1)]
    assert peers.gone(20.0) == []


def test_another_journal_counts_when_the_believed_one_is_gone() -> None:
    """Its lives count from 1 again, whatever the other one's number; and not before."""
    peers = living_of("mine")
    assert peers.token("a", 1, True, 11.0, "new") == []
    assert peers.token("a", 8, True, 11.5, "mine") == [PeerChanged("a", 8, "mine")]
    for incarnation in (7, 8):
        assert peers.token("a", incarnation, False, 12.0, "mine") == []
    assert peers.token("a", 2, True, 12.0, "new") == []
    assert peers.gone(12.0) == [PeerChanged("a", 2, "new")]
    assert peers.token("a", 9, True, 100.0, "mine") == [], "now the new one is believed"


def test_after_the_links_were_closed_the_believed_journal_is_awaited() -> None:
    """Tokens may come before the links are told to be open: another name counts only when this one
    stays away.
    """
    for early in (True, False):
        for back in (True, False):
            peers = living_of("mine")
            peers.links(False, 10.0)
            if not early:
                peers.links(True, 20.0)
            assert peers.token("a", 1, True, 20.0, "another") == []
            if early:
                peers.links(True, 20.0)
            told = peers.token("a", 7, True, 20.1, "mine") if back else []
            told += peers.gone(20.0 + RETURN_S)
            assert told == [PeerChanged("a", *((7, "mine") if back else (1, "another")))]


def living_of(journal: str) -> Peers:
    """A peer of this journal's name, incarnation 7, and the links open."""
    peers = Peers(("a",))
    peers.links(True, 0.0)
    assert peers.token("a", 7, True, 0.0, journal) == [PeerChanged("a", 7, journal)]
    return peers


@given(
    st.lists(st.tuples(st.sampled_from(["thief", "links", "wait"]), st.integers(0, 5)), max_size=30)
)
def test_no_other_journal_is_believed_while_the_believed_ones_token_comes_back(
    done: list[tuple[str, int]],
) -> None:
    """This holds for any tokens with other names that come and go, also where the links are opened
    again.
    """
    peers, now, there, news = living_of("mine"), 10.0, set[tuple[str, int]](), []
    for what, number in done:
        now += 0.1 * number
        if what == "wait":
            news += peers.gone(now)
        elif what == "thief":
            token = ("another", "third")[number % 2], number
            news += peers.token("a", token[1], token not in there, now, token[0])
            there ^= {token}
        else:
            peers.links(False, now)
            for token in there if number % 2 else ():
                news += peers.token("a", token[1], True, now, token[0])
            peers.links(True, now)
            for token in there:
                news += peers.token("a", token[1], True, now, token[0])
            news += peers.token("a", 7, True, now + 0.1, "mine")
    while (at := peers.look_at) is not None:
        news += peers.gone(at)
    assert {(one.incarnation, one.journal) for one in news} <= {(7, "mine")}
    assert peers.alive == {"a": 7}


TOKENS_SEEN = st.lists(st.tuples(st.booleans(), st.integers(1, 5)), max_size=30)


@given(TOKENS_SEEN, st.lists(st.booleans(), max_size=3))
def test_whatever_was_declared_a_token_that_is_there_is_a_peer_that_lives(
    declared: list[tuple[bool, int]], links: list[bool]
) -> None:
    """After any tokens of others, and links opened again, whoever is there in the end lives, as the
    highest.
    """
    peers, now, there = living("a"), 10.0, {1}
    for alive, incarnation in declared:
        now += 0.01
        peers.token("a", incarnation, alive, now)
        (there.add if alive else there.discard)(incarnation)
        peers.gone(now)
    for _ in links:
        now += 1.0
        peers.links(False, now)
        peers.links(True, now + 1.0)
        for incarnation in there:
            peers.token("a", incarnation, True, now + 1.5)
    while (at := peers.look_at) is not None:
        peers.gone(at)
    assert peers.alive == ({"a": max(there)} if there else {})


def test_a_flood_of_tokens_is_little_news() -> None:
    """A thousand lives in a second are some news, and the last of them is believed in the end."""
    peers = living("a")
    news = [one for n in range(1000) for one in peers.token("a", 2 + n, True, 10.0 + n / 1000)]
    assert len(news) <= 2 + 1.0 / HASTE_S
    assert peers.look_at is not None
    assert peers.gone(peers.look_at) == [PeerChanged("a", 1001)]


# --- Peers that live and do not hear --------------------------------------------------------------


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
