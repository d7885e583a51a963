"""Claims to be another's next life, or that a next number is another's next word."""

from collections.abc import Iterator

import pytest
import zenoh
from key_floods import REQUEST, co, request
from secured_fleet import SYSTEM, session
from toy_fleet import Fleet, wait_for

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(120)]


class Life:
    """hi, of which only the token of its first life is there, and its stream to co."""

    def __init__(self, fleet: Fleet, identity: str = "hi") -> None:
        self.session = session(fleet, identity, "co")
        self.receipts = list[zenoh.Sample]()
        self._heard = self.session.declare_subscriber(
            f"roco/{SYSTEM}/_/receipt/co/hi", self.receipts.append
        )
        self._tokens = dict[int, zenoh.LivelinessToken]()

    def lives(self, incarnation: int) -> None:
        """Declare the token of an incarnation."""
        key = f"roco/{SYSTEM}/_/alive/hi/{incarnation}"
        self._tokens[incarnation] = self.session.liveliness().declare_token(key)

    def dies(self, incarnation: int) -> None:
        """Withdraw it."""
        self._tokens.pop(incarnation).undeclare()

    def says(self, number: int) -> None:
        """Put a request under a number."""
        self.session.put(REQUEST, request(number), congestion_control=zenoh.CongestionControl.BLOCK)

    def close(self) -> None:
        """End the session."""
        self._heard.undeclare()
        self.session.close()  # type: ignore[no-untyped-call]


@pytest.fixture
def hi(router: Fleet) -> Iterator[Life]:
    """hi, alive for co."""
    co(router)
    one = Life(router)
    one.lives(1)
    wait_for(lambda: router.beat("co").peers.get("hi") == 1, "co sees hi")
    yield one
    one.close()


def test_a_higher_life_that_falls_silent_does_not_make_a_peer_gone_for_good(
    router: Fleet, hi: Life
) -> None:
    """With hi's own key stolen: the thief's life is believed while it lasts, then hi's, which never
    ended.
    """
    thief = Life(router)
    thief.lives(999)
    wait_for(lambda: router.beat("co").peers.get("hi") == 999, "co believes the thief")
    thief.close()
    wait_for(lambda: router.beat("co").peers.get("hi") == 1, "co sees hi again")


def test_no_other_key_declares_a_life_or_takes_a_number(router: Fleet, hi: Life) -> None:
    """co's rules let only the name hi do so: ta's token and ta's word under hi's next number never
    reach co.
    """
    thief = Life(router, "ta")
    thief.lives(999)
    thief.says(1)
    thief.session.put(f"roco/{SYSTEM}/_/ping/ta/co", b"C1")
    hi.says(1)
    wait_for(lambda: hi.receipts, "co has hi's word")
    wait_for(lambda: router.beat("co").counts, "co has counted")
    counts = router.beat("co").counts
    assert router.beat("co").peers["hi"] == 1
    assert "taken before" not in counts
    assert "forged" not in counts
    thief.close()
