"""Reasons why a router is not reached: each by a real handshake with a real router, and in the
waiter's log.
"""

import datetime as dt
import os
import re
import signal
import socket
import ssl
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest
from cryptography import x509
from guarded import SYSTEM
from toy_fleet import wait_for

from agent_runtime.io import issuing, reaching
from agent_runtime.io.reaching import why_not
from agent_runtime.io.secured import AUTHORITY, Rights, certificate_file, client_tls, key_file
from agent_runtime.io.sessions import free_endpoint
from companion.design import DESIGN
from operate import fleet_file
from operate.cli.fleet import checkup
from operate.cli.fleet.checkup import Level
from operate.cli.fleet.local import Local
from operate.cli.fleet.process_status import Beat, Look, Seen
from operate.fleet_file import ProcessState, ProcessStatus
from topdown.model.rights import ROUTER, access_control

pytestmark = pytest.mark.zenoh
RIGHTS = Rights((SYSTEM,), access_control(DESIGN, SYSTEM))
FLEET = fleet_file.Fleet(SYSTEM, "", 1, 0.0, ())
WEEK = dt.timedelta(days=7)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keys of the router and of co; what co had, will have, or got from another authority; another
    fleet's.
    """
    where, now = tmp_path_factory.mktemp("keys"), dt.datetime.now(dt.UTC)
    issuer = issuing.authority("authority", now - 3 * WEEK, now + 3 * WEEK)
    foreign = issuing.authority("authority", now - 3 * WEEK, now + 3 * WEEK)
    issuing.publish(where, issuer, RIGHTS)
    issuing.certify(where, issuer, ROUTER, now, now + WEEK, issuing.HOSTS)
    for identity in ("co", "console"):
        issuing.certify(where, issuer, identity, now, now + WEEK)
    (where / "older").mkdir()
    # versions that gave certificates no key identifiers
    with pytest.MonkeyPatch.context() as older:
        add, lacks = (
            x509.CertificateBuilder.add_extension,
            (x509.AuthorityKeyIdentifier, x509.SubjectKeyIdentifier),
        )
        older.setattr(
            x509.CertificateBuilder,
            "add_extension",
            lambda self, one, critical: (
                self if isinstance(one, lacks) else add(self, one, critical)
            ),
        )
        one = issuing.authority("authority", now, now + WEEK)
        issuing.publish(where / "older", one, RIGHTS)
        issuing.certify(where / "older", one, ROUTER, now, now + WEEK, issuing.HOSTS)
        issuing.certify(where / "older", one, "co", now, now + WEEK)
    for name, begin, by, trusted in (
        ("expired", now - 2 * WEEK, issuer, issuer),
        ("early", now + WEEK, issuer, issuer),
        ("foreign", now, foreign, issuer),
        ("elsewhere", now, foreign, foreign),
    ):
        (where / name).mkdir()
        issuing.publish(where / name, trusted, RIGHTS)
        for identity in ("co", "console"):
            issuing.certify(where / name, by, identity, begin, begin + WEEK)
    return where


@pytest.fixture(scope="module")
def routers(folder: Path) -> Iterator[tuple[str, str]]:
    """A router with those keys: its address, and one that its certificate does not name."""
    with router(folder) as addresses:
        yield addresses


@contextmanager
def router(folder: Path) -> Iterator[tuple[str, str]]:
    """A process, with the keys of a folder, at two addresses."""
    first = free_endpoint().replace("tcp/", "tls/")
    second = free_endpoint().replace("tcp/127.0.0.1", "tls/127.0.0.2")
    told = {
        "ROCO_LISTEN": f"{first},{second}",
        "ROCO_RUN_DIR": str(folder),
        "ROCO_TLS_DIR": str(folder),
    }
    with (folder / "router.log").open("ab") as log:
        command = [sys.executable, "-m", "services.router"]
        process = subprocess.Popen(
            command, env=os.environ | told | {"ROCO_SYSTEM": SYSTEM}, stdout=log, stderr=log
        )
    wait_for((folder / "router.ready").exists, "the router listens")
    yield first, second
    process.send_signal(signal.SIGTERM)
    assert process.wait(30.0) == 0


def test_with_good_keys_nothing_is_in_the_way(folder: Path, routers: tuple[str, str]) -> None:
    """The handshake is made; under the other name of the host, too."""
    assert why_not(routers[0], client_tls(folder, "co")) == ""
    assert why_not(routers[0].replace("127.0.0.1", "localhost"), client_tls(folder, "co")) == ""


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("expired", "the own certificate co.pem ended "),
        ("early", "the own certificate co.pem holds from .* is it behind"),
        ("foreign", "the router refuses: the own certificate co.pem is of another authority"),
        ("elsewhere", "the router's certificate is of another authority"),
    ],
)
def test_a_certificate_that_is_not_taken_is_named(
    folder: Path, routers: tuple[str, str], place: str, words: str
) -> None:
    """One's own or the router's, and what is wrong with it."""
    assert_matches(words, why_not(routers[0], client_tls(folder / place, "co")))


def test_a_router_with_keys_of_an_older_version_is_named(folder: Path) -> None:
    """What its certificate lacks, and what to do."""
    with router(folder / "older") as (address, _):
        said = why_not(address, client_tls(folder / "older", "co"))
    assert_matches(
        "names no key of its authority, as older versions made it; `roco keys make`", said
    )


@pytest.mark.parametrize("place", ["expired", "early"])
def test_a_router_with_another_clock_refuses(
    folder: Path, routers: tuple[str, str], place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here the certificate seems to hold; the router says that it does not."""
    monkeypatch.setattr(reaching, "_outside", lambda own: "")
    assert_matches(
        "does not hold by the router's clock", why_not(routers[0], client_tls(folder / place, "co"))
    )


def test_other_certificates_are_refused_in_words(folder: Path, routers: tuple[str, str]) -> None:
    """That of the router, and none; the router's own where it does not name the host."""
    assert_matches(
        "router.pem is not for a client", why_not(routers[0], client_tls(folder, ROUTER))
    )
    bare: dict[str, Any] = {"root_ca_certificate": str(folder / AUTHORITY)}
    assert_matches("is missing: the router wants one", why_not(routers[0], bare))
    assert_matches("is not for this address", why_not(routers[1], client_tls(folder, "co")))


def test_a_place_where_no_router_is_is_told(folder: Path) -> None:
    """Nobody listens, the name is unknown, somebody else listens, keys and address do not fit."""
    own = client_tls(folder, "co")
    nobody = free_endpoint().replace("tcp/", "tls/")
    assert_matches("connection refused", why_not(nobody, own))
    assert_matches("connection refused", why_not(nobody.replace("tls/", "tcp/"), None))
    assert_matches(
        "the name nobody.invalid is not resolved", why_not("tls/nobody.invalid:7447", own)
    )
    assert_matches("no keys are given", why_not(nobody, None))
    assert_matches("keys are given", why_not(nobody.replace("tls/", "tcp/"), own))
    assert_matches("is not an address", why_not("7447", own))
    with socket.create_server(("127.0.0.1", 0)) as mute:
        assert_matches(
            "does not answer the handshake", why_not(f"tls/127.0.0.1:{mute.getsockname()[1]}", own)
        )


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("", []),
        (
            "expired",
            [
                "router: the own certificate console.pem ended",
                "co: no router: the own certificate co.pem ended",
            ],
        ),
        (
            "elsewhere",
            [
                "router: the router's certificate is of another",
                "co: no router: the router's certificate is of",
            ],
        ),
        ("nothing", ["router: .*console.pem is missing"]),
    ],
)
def test_doctor_says_the_same(
    folder: Path, routers: tuple[str, str], tmp_path: Path, place: str, words: list[str]
) -> None:
    """Of the command line itself, and of an agent that lives without a router."""
    (tmp_path / "keys").symlink_to(folder / place)
    running = tuple(ProcessStatus(name, ProcessState.READY, pid=1) for name in ("router", "co"))
    fleet = msgspec.structs.replace(FLEET, connect=routers[0], processes=running)
    seen = (Seen(running[0], Beat()), Seen(running[1], Beat(up=False)))
    found = checkup.router(Local(tmp_path), Look(fleet, seen, False, 0.0))
    wrong = [f"{check.name}: {check.what}" for check in found if check.level is Level.WRONG]
    assert len(wrong) == len(words)
    for said, expected in zip(wrong, words, strict=True):
        assert_matches(expected, said)


def older(folder: Path, address: str) -> None:
    """Shake hands by TLS 1.2, with co's certificate."""
    context = ssl.create_default_context(cafile=folder / AUTHORITY)
    context.load_cert_chain(certificate_file(folder, "co"), key_file(folder, "co"))
    context.maximum_version = ssl.TLSVersion.TLSv1_2
    with socket.create_connection(
        ("127.0.0.1", int(address.rpartition(":")[2])), 10.0
    ) as connection:
        context.wrap_socket(connection, server_hostname="127.0.0.1").close()


def test_doctor_lists_who_was_refused(folder: Path, routers: tuple[str, str]) -> None:
    """Each reason of the router's log in plain words, with its count; none that it has no words
    for.
    """
    why_not(routers[0], client_tls(folder / "foreign", "co"))
    why_not(routers[0], client_tls(folder, ROUTER))
    why_not(routers[0], client_tls(folder / "elsewhere", "co"))
    why_not(routers[0], {"root_ca_certificate": str(folder / AUTHORITY)})
    with pytest.raises(ssl.SSLError, match="PROTOCOL_VERSION"):
        older(folder, routers[0])
    look = Look(FLEET, (), False, 0.0)
    expected = {
        "its certificate is of another authority",
        "its certificate is not for a client",
        "it does not take the router's certificate",
        "it has no certificate",
        "its TLS is older than 1.3",
    }

    def told() -> str:
        return "".join(check.what for check in checkup.refusals(Local(folder), look))

    wait_for(lambda: all(words in told() for words in expected), f"all are listed: {told()}")
    assert {part.partition(" × ")[2] for part in told().partition("UTC: ")[2].split("; ")} <= {
        *checkup.REASONS.values()
    }


def assert_matches(words: str, said: str) -> None:
    """Whether a sentence has words; it is shown if not."""
    assert re.search(words, said), said
