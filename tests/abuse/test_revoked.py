"""A key that is known to be stolen: router and agents deny it everything, without new keys for
all.
"""

from collections.abc import Iterator

import pytest
import zenoh
from key_floods import REQUEST, Peer, co, request
from secured_fleet import SYSTEM, session
from toy_fleet import Fleet, wait_for
from typer.testing import CliRunner

from agent_runtime.io import issuing
from agent_runtime.io.run_files import KEYS_FOLDER
from companion.design import DESIGN
from operate.cli.__main__ import app

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(120)]


def roco(*words: str) -> str:
    """Return the output of `roco`; it succeeds."""
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    return done.output


class Thief:
    """Holder of hi's key: puts, declares a life, listens."""

    def __init__(self, router: Fleet) -> None:
        self.heard = list[zenoh.Sample]()
        self._session = session(router, "hi", "co")
        self._declared = [
            self._session.declare_subscriber(f"roco/{SYSTEM}/_/pong/*/hi", self.heard.append),
            self._session.liveliness().declare_token(f"roco/{SYSTEM}/_/alive/hi/77"),
        ]

    def speaks(self) -> None:
        """Put what is counted at co where it gets through, and a ping."""
        self._session.put(REQUEST, request(0), congestion_control=zenoh.CongestionControl.BLOCK)
        self._session.put(
            f"roco/{SYSTEM}/_/ping/hi/co", b"C2", congestion_control=zenoh.CongestionControl.BLOCK
        )

    def close(self) -> None:
        """End the session."""
        self._declared.clear()
        self._session.close()  # type: ignore[no-untyped-call]


@pytest.fixture
def peer(router: Fleet) -> Iterator[Peer]:
    """A peer that co answers."""
    co(router)
    one = Peer(router)
    wait_for(one.asks, "co answers")
    yield one
    one.close()


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
        with session(router, "hi", "co") as fresh:
            for one in (thief._session, fresh):
                one.put(REQUEST, request(0), congestion_control=zenoh.CongestionControl.BLOCK)
        assert not answered(thief)
        assert peer.asks()
        assert peer.asks()
        assert router.beat("co").counts.get("no stream number", 0) == counted
        assert not thief.heard
        router.kill("co")
        co(router)

    assert "revoked are none" in roco("keys", "revoke", "hi", "--undo", "--keys", folder)
    wait_for(lambda: answered(thief), "its rights are back")
    thief.close()


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
    folder = router.run / KEYS_FOLDER
    done = CliRunner().invoke(app, ["keys", "revoke", "nobody", "--keys", str(folder)])
    assert done.exit_code == 2
    assert "no certificate is named 'nobody'; there are co, console" in done.output
    done = CliRunner().invoke(app, ["keys", "revoke", "hi", "--keys", str(router.run / "steps")])
    assert done.exit_code == 2
    assert "rights.json" in done.output
