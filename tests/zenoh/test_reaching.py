"""Reasons why a router is not reached: each by a real handshake with a real router, in the waiter's
log, in the router's log, and by `roco doctor`; keys that are missing.
"""

import datetime as dt
import re
import socket
import ssl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh
from cryptography import x509
from guarded import SYSTEM
from toy_fleet import DEADLINE_S, service, serving, wait_for

from agent_runtime.io import issuing, reaching
from agent_runtime.io.reaching import why_not
from agent_runtime.io.secured import (
    AUTHORITY,
    KeysError,
    Rights,
    certificate_file,
    client_tls,
    key_file,
    rights_of,
)
from agent_runtime.io.sessions import client_config, free_endpoint
from companion.design import DESIGN
from console.fleet import checkup
from console.fleet.checkup import Level
from console.fleet.local import Local
from console.fleet.process_status import Beat, Look, Seen
from operate.fleet_file import Fleet, ProcessState, ProcessStatus
from topdown.model.rights import ROUTER, access_control, identities

pytestmark = pytest.mark.zenoh
RIGHTS = Rights((SYSTEM,), access_control(DESIGN, SYSTEM))
FLEET = Fleet(SYSTEM, "", 1, 0.0, ())
WEEK = dt.timedelta(days=7)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keys of the router and of co; what co had, will have, or got from another authority; another
    fleet's; those of older versions.
    """
    where, now = tmp_path_factory.mktemp("keys"), dt.datetime.now(dt.UTC)
    issuer = issuing.authority("authority", now - 3 * WEEK, now + 3 * WEEK)
    foreign = issuing.authority("authority", now - 3 * WEEK, now + 3 * WEEK)
    for name, begin, by, trusted in (
        ("", now, issuer, issuer),
        ("expired", now - 2 * WEEK, issuer, issuer),
        ("early", now + WEEK, issuer, issuer),
        ("foreign", now, foreign, issuer),
        ("elsewhere", now, foreign, foreign),
    ):
        (where / name).mkdir(exist_ok=True)
        issuing.publish(where / name, trusted, RIGHTS)
        for identity in ("co", "console"):
            issuing.certify(where / name, by, identity, begin, begin + WEEK)
    issuing.certify(where, issuer, ROUTER, now, now + WEEK, issuing.HOSTS)
    # versions that gave certificates no key identifiers
    lacks, add = (
        (x509.AuthorityKeyIdentifier, x509.SubjectKeyIdentifier),
        x509.CertificateBuilder.add_extension,
    )
    with pytest.MonkeyPatch.context() as older:
        older.setattr(
            x509.CertificateBuilder,
            "add_extension",
            lambda self, one, critical: (
                self if isinstance(one, lacks) else add(self, one, critical)
            ),
        )
        one = issuing.authority("authority", now, now + WEEK)
        (where / "older").mkdir()
        issuing.publish(where / "older", one, RIGHTS)
        issuing.certify(where / "older", one, ROUTER, now, now + WEEK, issuing.HOSTS)
        issuing.certify(where / "older", one, "co", now, now + WEEK)
    return where


@contextmanager
def router_at(folder: Path) -> Iterator[tuple[str, str]]:
    """A process, with the keys of a folder, at two addresses; its certificate names the first."""
    first = free_endpoint().replace("tcp/", "tls/")
    second = free_endpoint().replace("tcp/127.0.0.1", "tls/127.0.0.2")
    told = {"LISTEN": f"{first},{second}", "TLS_DIR": folder, "SYSTEM": SYSTEM}
    with serving("router", folder, **told):
        yield first, second


@pytest.fixture(scope="module")
def routers(folder: Path) -> Iterator[tuple[str, str]]:
    """A router with the good keys; its addresses."""
    with router_at(folder) as addresses:
        yield addresses


def test_with_good_keys_nothing_is_in_the_way(folder: Path, routers: tuple[str, str]) -> None:
    """The handshake is made; under the other name of the host, too."""
    own = client_tls(folder, "co")
    for address in (routers[0], routers[0].replace("127.0.0.1", "localhost")):
        assert why_not(address, own) == ""


REASONS = {
    "foreign": ("co.pem is of another authority", "BadSignature"),
    "expired": ("the own certificate co.pem ended ", "certificate expired"),
    "early": ("the own certificate co.pem holds from .* is it behind", "not valid yet"),
    "elsewhere": ("the router's certificate is of another authority", "UnknownCA"),
    "router": (
        "router.pem is not for a client",
        "does not allow extended key usage for client authentication",
    ),
    "none": ("is missing: the router wants one", "peer sent no certificates"),
    "plain": ("no keys are given", "corrupt message"),
}
"""Whose keys somebody comes with: what it is told, and what the router's log says."""


@pytest.mark.parametrize("why", REASONS)
def test_a_session_without_a_good_certificate_is_refused(
    folder: Path, routers: tuple[str, str], why: str
) -> None:
    """The router does not let it in, and its log has one more line that says why; co with its own
    gets in after it.
    """
    (told, logged), log, address = REASONS[why], folder / "router.log", routers[0]
    own: dict[str, Any] | None = None
    if why == "none":
        own = {"root_ca_certificate": str(folder / AUTHORITY)}
    elif why != "plain":
        own = client_tls(folder, ROUTER) if why == ROUTER else client_tls(folder / why, "co")
    before = log.read_text().count(logged)
    assert_matches(told, why_not(address, own))
    if why != "elsewhere":  # here the client refuses; Zenoh's may close before its alert is sent
        before = log.read_text().count(logged)
    with pytest.raises(zenoh.ZError):
        zenoh.open(client_config(address if own else address.replace("tls/", "tcp/"), own))
    wait_for(lambda: log.read_text().count(logged) > before, f"the log says {logged}")
    zenoh.open(client_config(address, client_tls(folder, "co"))).close()


def test_a_router_with_keys_of_an_older_version_is_named(folder: Path) -> None:
    """What its certificate lacks, and what to do."""
    with router_at(folder / "older") as (address, _):
        said = why_not(address, client_tls(folder / "older", "co"))
    assert_matches(
        "names no key of its authority, as older versions made it; `roco keys make`", said
    )


def test_a_router_with_another_clock_or_address_refuses(
    folder: Path, routers: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here the certificate seems to hold; the router says that it does not."""
    assert_matches("is not for this address", why_not(routers[1], client_tls(folder, "co")))
    monkeypatch.setattr(reaching, "_outside", lambda own: "")
    for place in ("expired", "early"):
        said = why_not(routers[0], client_tls(folder / place, "co"))
        assert_matches("does not hold by the router's clock", said)


def test_a_place_where_no_router_is_is_told(folder: Path) -> None:
    """Nobody listens, the name is unknown, somebody else listens, keys and address do not fit."""
    own, nobody = client_tls(folder, "co"), free_endpoint()
    with socket.create_server(("127.0.0.1", 0)) as mute:
        for address, keys, words in (
            (nobody.replace("tcp/", "tls/"), own, "connection refused"),
            (nobody, None, "connection refused"),
            ("tls/nobody.invalid:7447", own, "the name nobody.invalid is not resolved"),
            (nobody.replace("tcp/", "tls/"), None, "no keys are given"),
            (nobody, own, "keys are given"),
            ("7447", own, "is not an address"),
            (f"tls/127.0.0.1:{mute.getsockname()[1]}", own, "does not answer the handshake"),
        ):
            assert_matches(words, why_not(address, keys))


def test_doctor_says_the_same(folder: Path, routers: tuple[str, str], tmp_path: Path) -> None:
    """Of the command line itself, and of an agent that lives without a router."""
    running = tuple(ProcessStatus(name, ProcessState.READY, pid=1) for name in ("router", "co"))
    fleet = msgspec.structs.replace(FLEET, connect=routers[0], processes=running)
    seen = (Seen(running[0], Beat()), Seen(running[1], Beat(up=False)))
    ended, another = "the own certificate {}.pem ended", "the router's certificate is of another"
    for place, words in {
        "": [],
        "expired": [f"router: {ended.format('console')}", f"co: no router: {ended.format('co')}"],
        "elsewhere": [f"router: {another}", f"co: no router: {another}"],
        "nothing": ["router: .*console.pem is missing"],
    }.items():
        (tmp_path / "keys").unlink(missing_ok=True)
        (tmp_path / "keys").symlink_to(folder / place)
        found = checkup.router(Local(tmp_path), Look(fleet, seen, False, 0.0))
        wrong = [f"{check.name}: {check.what}" for check in found if check.level is Level.WRONG]
        for said, expected in zip(wrong, words, strict=True):
            assert_matches(expected, said)


def older(folder: Path, address: str) -> None:
    """Shake hands by TLS 1.2, with co's certificate."""
    context = ssl.create_default_context(cafile=folder / AUTHORITY)
    context.load_cert_chain(certificate_file(folder, "co"), key_file(folder, "co"))
    context.maximum_version = ssl.TLSVersion.TLSv1_2
    port = int(address.rpartition(":")[2])
    with socket.create_connection(("127.0.0.1", port), 10.0) as connection:
        context.wrap_socket(connection, server_hostname="127.0.0.1").close()


def test_doctor_lists_who_was_refused(folder: Path, routers: tuple[str, str]) -> None:
    """Each reason of the router's log in plain words, with its count; none that it has no words
    for.
    """
    for own in (
        client_tls(folder / "foreign", "co"),
        client_tls(folder, ROUTER),
        client_tls(folder / "elsewhere", "co"),
        {"root_ca_certificate": str(folder / AUTHORITY)},
    ):
        why_not(routers[0], own)
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
    listed = told().partition("UTC: ")[2].split("; ")
    assert {part.partition(" × ")[2] for part in listed} <= {*checkup.REASONS.values()}


def test_a_client_does_not_speak_to_a_foreign_router(
    tmp_path: Path, routers: tuple[str, str]
) -> None:
    """A process at the router's address without its certificate hears nothing: the client refuses
    it. Keys are for their owner alone, and the authority's private key is nowhere.
    """
    keys = tmp_path / "keys"
    issuing.issue(keys, DESIGN, (SYSTEM,))
    with pytest.raises(zenoh.ZError):
        zenoh.open(client_config(routers[0], client_tls(keys, "co")))
    assert keys.stat().st_mode & 0o777 == 0o700
    assert {file.stat().st_mode & 0o777 for file in keys.iterdir()} == {0o600}
    assert {file.stem for file in keys.glob("*.key")} == set(identities(DESIGN))


def test_missing_keys_and_rights_of_another_system_are_told(folder: Path, tmp_path: Path) -> None:
    """Before anything is opened, with what is there and what to do. An agent ends then, with one
    line.
    """
    there = "identities with a key there: co, console, router; `roco keys make`"
    with pytest.raises(KeysError, match=there):
        client_tls(folder, "ta")
    with pytest.raises(KeysError, match="'guarded', this router serves 'other'"):
        rights_of(folder, "other")
    at, log = ",".join(f"{name}=tls/127.0.0.1:1" for name in DESIGN.agents), tmp_path / "ta.log"
    told = {"RUN_DIR": tmp_path, "TLS_DIR": folder, "SYSTEM": SYSTEM, "AGENTS": at}
    assert service("task", log, **told).wait(DEADLINE_S) == 1
    assert f"{folder / 'ta.pem'} is missing" in log.read_text()
    assert "Traceback" not in log.read_text()
    assert not (tmp_path / "journal").exists()


def assert_matches(words: str, said: str) -> None:
    """Whether a sentence has words; it is shown if not."""
    assert re.search(words, said), said
