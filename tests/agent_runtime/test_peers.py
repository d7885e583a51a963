"""Death of a peer and loss of the own router are told apart, whatever order the news comes in."""

import itertools

import pytest

from agent_runtime.core.events import LinkChanged, PeerChanged
from agent_runtime.core.peers import GRACE_S, RETURN_S, Peers


def living(*agents: str) -> Peers:
    """All of them alive, incarnation 1, and the router there."""
    peers = Peers(agents)
    peers.router(True, 0.0)
    for agent in agents:
        assert peers.token(agent, 1, True, 0.0) == [PeerChanged(agent, 1)]
    return peers


def test_a_death_is_believed_after_the_grace() -> None:
    """A vanished token alone: dead, a moment later and once."""
    peers = living("a", "b")
    assert peers.token("a", 1, False, 10.0) == []
    assert peers.gone(10.0) == []
    assert peers.look_at == 10.0 + GRACE_S
    assert peers.gone(10.0 + GRACE_S) == [PeerChanged("a", None)]
    assert peers.gone(99.0) == []
    assert peers.alive == {"b": 1}


@pytest.mark.parametrize("order", list(itertools.permutations(["a", "b", "router"])))
def test_a_lost_router_is_nobodys_death(order: tuple[str, ...]) -> None:
    """Tokens and transport vanish in any order within the grace: the link is lost, and nobody is dead."""
    peers = living("a", "b")
    news: list[object] = []
    for number, what in enumerate(order):
        now = 10.0 + 0.01 * number
        news += peers.router(False, now) if what == "router" else peers.token(what, 1, False, now)
    assert news == [LinkChanged(False)]
    assert peers.gone(100.0) == []
    assert peers.alive == {"a": 1, "b": 1}


def test_after_the_return_who_does_not_come_back_is_dead() -> None:
    """Back with the router: tokens come again; the one that does not belongs to a dead agent."""
    peers = living("a", "b")
    peers.router(False, 10.0)
    assert peers.router(True, 20.0) == [LinkChanged(True)]
    assert peers.token("a", 1, True, 20.1) == [PeerChanged("a", 1)]
    assert peers.gone(20.0 + RETURN_S) == [PeerChanged("b", None)]


def test_a_new_incarnation_outlives_the_old_token() -> None:
    """The old token's end, before or after the new token's beginning, does not kill the new incarnation."""
    peers = living("a")
    peers.token("a", 1, False, 10.0)
    assert peers.token("a", 2, True, 10.01) == [PeerChanged("a", 2)]
    assert peers.token("a", 1, False, 10.02) == []
    assert peers.gone(100.0) == []
    assert peers.token("a", 1, True, 100.0) == [], "an older incarnation is never believed again"


def test_strangers_are_nobody() -> None:
    """Agents we do not talk to make no news."""
    assert living("a").token("stranger", 1, True, 1.0) == []
