"""A key that is known to be stolen: router and agents deny it everything, without new keys for
all.
"""

import pytest
from key_floods import PING, REQUEST, Peer, request
from secured_fleet import SYSTEM, KeyHolder, serve_linked
from toy_fleet import Fleet, wait_for
from typer.testing import CliRunner

from agent_runtime.io import issuing
from agent_runtime.io.run_files import KEYS_FOLDER
from companion.design import DESIGN
from console.__main__ import app

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(120)]


def roco(*words: str, code: int = 0) -> str:
    """Return the output of `roco`; its exit code must be `code`."""
    done = CliRunner().invoke(app, words)
    assert done.exit_code == code, done.output
    return done.output


class Thief(KeyHolder):
    """Holder of hi's key: puts, declares a life, listens."""

    def __init__(self, router: Fleet) -> None:
        super().__init__(router, "hi")
        self.heard = self.hears("_/pong/*/hi")
        self.lives(77)

    def speaks(self) -> None:
        """Put what is counted at co where it gets through, and a ping."""
        self.put(REQUEST, request(0))
        self.put(PING, b"C2")


def answered(thief: Thief) -> bool:
    """Whether co answers the thief."""
    thief.speaks()
    return bool(thief.heard)


def test_a_revoked_key_is_of_no_use_and_all_others_go_on(router: Fleet, peer: Peer) -> None:
    """On a running fleet, over a restart of the agent, until it is undone or there are new keys."""
    folder = str(router.run / KEYS_FOLDER)
    thief = Thief(router)
    wait_for(lambda: answered(thief), "the stolen key is of use")
    wait_for(lambda: router.beat("co").peers.get("hi") == 77, "co sees the thief")

    assert "revoked are hi" in roco("keys", "revoke", "hi", "--keys", folder)
    wait_for(lambda: "hi" not in router.beat("co").peers, "co sees the thief no more")
    for _ in range(2):  # the same co, which listened again, and its next life
        wait_for(peer.asks, "co answers others")
        counted = router.beat("co").counts.get("no stream number", 0)
        thief.heard.clear()
        fresh = KeyHolder(router, "hi")
        for one in (thief, fresh):
            one.put(REQUEST, request(0))
        fresh.close()
        assert not answered(thief)
        assert peer.asks()
        assert peer.asks()
        assert router.beat("co").counts.get("no stream number", 0) == counted
        assert not thief.heard
        router.kill("co")
        serve_linked(router, "co")

    assert "revoked are none" in roco("keys", "revoke", "hi", "--undo", "--keys", folder)
    wait_for(lambda: answered(thief), "its rights are back")


def test_new_keys_for_all_end_a_revocation(router: Fleet) -> None:
    """The stolen key is of another authority then; who is so named rightfully has a key of its own
    again.
    """
    folder = router.run / KEYS_FOLDER
    roco("keys", "revoke", "hi", "--keys", str(folder))
    issuing.issue(folder, DESIGN, (SYSTEM,))
    assert issuing.revoke(folder, "ta") == ("ta",)


def test_names_that_no_certificate_has_are_refused(router: Fleet) -> None:
    """With those that there are; and a folder without a router's keys."""
    for name, folder, why in (
        ("nobody", KEYS_FOLDER, "no certificate is named 'nobody'; there are assistant, bidder"),
        ("hi", "steps", "rights.json"),
    ):
        assert why in roco("keys", "revoke", name, "--keys", str(router.run / folder), code=2)
