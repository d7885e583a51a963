"""Floods by the holder of one key, on keys that it has a right to, beyond what anybody can take."""

from collections import Counter
from collections.abc import Callable, Iterator

import pytest
from key_floods import PING, REQUEST, Peer, memory_mb, repeated, request
from secured_fleet import KeyHolder, logged
from toy_fleet import Fleet, wait_for

from fipa_codec.communicate import MAX_BYTES

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(180)]
MANY = 20_000
ASKED = 20
ROOM_MB = 80
"""Memory of a sender's waiting messages, per lane and decoded [MB]: estimate. Unbounded, they took
all there was.
"""
FLOODS: dict[str, tuple[str, Callable[[int], bytes], int]] = {
    "of no communicate": (REQUEST, lambda n: b"\xc1" * 200, MANY),
    "in another's name": (REQUEST, lambda n: request(n, "ta"), MANY),
    "taken before": (REQUEST, lambda n: request(1), MANY),
    "of other words under a number that was taken": (
        REQUEST,
        lambda n: request(1, "hi", f"hi-1-{n}"),
        MANY,
    ),
    "of gaps": (REQUEST, lambda n: request(1_000_000 + n), MANY),
    "of long messages": (REQUEST, lambda n: b"\xc1" * (MAX_BYTES // 2), 100),
    "of receipts": ("_/receipt/hi/co", lambda n: b"no receipt", MANY),
    "of pings": (PING, lambda n: b"C2", MANY),
}
SLOW = ("taken before", "of other words under a number that was taken")
"""Half of the processor's time of all floods."""


@pytest.fixture
def thief(router: Fleet, peer: Peer) -> Iterator[KeyHolder]:
    """A session with hi's key."""
    one = KeyHolder(router, "hi")
    yield one
    one.close()


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=pytest.mark.long if kind in SLOW else ()) for kind in FLOODS]
)
def test_a_flood_takes_little_memory_and_disk_and_holds_no_peer_up(
    router: Fleet, peer: Peer, thief: KeyHolder, kind: str
) -> None:
    """The agent answers others; the log has the first of each kind, then sums."""
    key, said, many = FLOODS[kind]
    pid = router.processes["co"].pid
    before, lines = memory_mb(pid), len(logged(router, "co"))
    with repeated(lambda number: thief.put(key, said(number)), many, many // 10):
        assert all(peer.asks() for _ in range(ASKED))
        assert memory_mb(pid) < before + ROOM_MB
    assert peer.asks()
    told = logged(router, "co")[lines:]
    assert "peer" not in {line["event"] for line in told}, "no neighbour was lost"
    kinds = Counter((line["event"], line.get("key"), line.get("sender")) for line in told)
    assert max(kinds.values(), default=0) < MANY / 50
    assert len(told) < MANY / 20


def test_what_is_no_channel_of_theirs_is_not_said_back(thief: KeyHolder) -> None:
    """A ping of 4 MB would be a pong of 4 MB: who floods with one byte's right would flood its
    peers, too.
    """
    heard = thief.hears("_/pong/co/hi")
    thief.put(PING, bytes(MAX_BYTES))
    wait_for(lambda: thief.put(PING, b"C2") or heard, "co answers on a channel that is there")
    assert set(heard) == {b"C2"}
