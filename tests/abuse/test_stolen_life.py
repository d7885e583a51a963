"""Claims to be another's next life, or that a next number is another's next word."""

from collections.abc import Iterator

import pytest
from key_floods import REQUEST, request
from secured_fleet import KeyHolder, serve_linked
from toy_fleet import Fleet, wait_for

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(120)]


@pytest.fixture
def hi(router: Fleet) -> Iterator[KeyHolder]:
    """hi, of which only the token of its first life is there, alive for co."""
    serve_linked(router, "co")
    one = KeyHolder(router, "hi")
    one.lives(1)
    wait_for(lambda: router.beat("co").peers.get("hi") == 1, "co sees hi")
    yield one
    one.close()


@pytest.mark.usefixtures("hi")
def test_a_higher_life_that_falls_silent_does_not_make_a_peer_gone_for_good(router: Fleet) -> None:
    """With hi's own key stolen: the thief's life is believed while it lasts, then hi's, which never
    ended.
    """
    thief = KeyHolder(router, "hi")
    thief.lives(999)
    wait_for(lambda: router.beat("co").peers.get("hi") == 999, "co believes the thief")
    thief.close()
    wait_for(lambda: router.beat("co").peers.get("hi") == 1, "co sees hi again")


def test_no_other_key_declares_a_life_or_takes_a_number(router: Fleet, hi: KeyHolder) -> None:
    """co's rules let only the name hi do so: ta's token and ta's word under hi's next number never
    reach co.
    """
    thief, receipts = KeyHolder(router, "ta"), hi.hears("_/receipt/co/hi")
    thief.lives(999)
    thief.put(REQUEST, request(1))
    thief.put("_/ping/ta/co", b"C1")
    hi.put(REQUEST, request(1))
    wait_for(lambda: receipts, "co has hi's word")
    wait_for(lambda: router.beat("co").counts, "co has counted")
    assert router.beat("co").peers["hi"] == 1
    assert not {"taken before", "forged"} & router.beat("co").counts.keys()
    thief.close()
