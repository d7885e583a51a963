"""Certificates and their places; valid ones are kept, and an incomplete set never passes for a
whole one.
"""

import datetime as dt
import shutil
import ssl
from collections.abc import Callable
from pathlib import Path

import pytest
from cryptography import x509

from agent_runtime.io.issuing import Seat, issue, revoke, seats
from agent_runtime.io.secured import (
    AUTHORITY,
    ROUTER,
    certificate_file,
    key_file,
    revoked,
    rights_of,
)
from companion.design import DESIGN
from topdown.model.rights import identities

NOW = dt.datetime(2026, 11, 21, tzinfo=dt.UTC)
DAY = dt.timedelta(days=1)


def common_name(file: Path) -> str:
    """The CN in a certificate."""
    return x509.load_pem_x509_certificate(file.read_bytes()).subject.rfc4514_string()


def test_apart_each_folder_has_its_own_and_no_more(tmp_path: Path) -> None:
    """A process that sees its folder alone has the authority's certificate and its own key; the
    router the rights.
    """
    issue(tmp_path, DESIGN, ("roco",), apart=True)
    assert {one.name for one in tmp_path.iterdir()} == set(identities(DESIGN))
    for name in identities(DESIGN):
        there = {one.name for one in (tmp_path / name).iterdir()}
        more = (
            {"rights.json"}
            if name == "router"
            else {f"{name}.links.json"}
            if name in DESIGN.agents
            else set()
        )
        assert there == {"authority.pem", f"{name}.pem", f"{name}.key"} | more
        assert (tmp_path / name).stat().st_mode & 0o777 == 0o700
        assert {one.stat().st_mode & 0o777 for one in (tmp_path / name).iterdir()} == {0o600}


def test_several_systems_have_names_of_their_own_and_readers_in_common(tmp_path: Path) -> None:
    """Two co behind one router are told apart by their CN; their files have the same names."""
    issue(tmp_path, DESIGN, ("velma1", "velma2"))
    assert common_name(tmp_path / "velma1/co.pem") == "CN=velma1.co"
    assert common_name(tmp_path / "velma2/co.pem") == "CN=velma2.co"
    assert common_name(tmp_path / "monitor.pem") == "CN=monitor"
    rules = rights_of(tmp_path, "velma1", "velma2").access_control["rules"]
    keys = {rule["id"]: rule["key_exprs"] for rule in rules}
    assert all(key.startswith("roco/velma1/") for key in keys["velma1.co puts"])
    assert {key.split("/")[1] for key in keys["monitor hears"]} == {"velma1", "velma2"}


def test_what_holds_is_kept(tmp_path: Path) -> None:
    """As long as it holds for the days asked; then all of it is new."""
    first = issue(tmp_path, DESIGN, ("roco",), now=NOW, apart=True)
    kept = issue(tmp_path, DESIGN, ("roco",), now=NOW + 3 * DAY, apart=True, keep_days=3.5)
    assert (kept.made_now, kept.until) == (False, first.until)
    before = (tmp_path / "co/co.key").read_bytes()
    anew = issue(tmp_path, DESIGN, ("roco",), now=NOW + 4 * DAY, apart=True, keep_days=3.5)
    assert (anew.made_now, anew.until) == (True, NOW + 11 * DAY)
    assert (tmp_path / "co/co.key").read_bytes() != before


@pytest.mark.parametrize("how", ["wider", "gone"])
def test_agents_whose_rules_are_not_the_designs_get_new_keys(tmp_path: Path, how: str) -> None:
    """As with the router's."""
    issue(tmp_path, DESIGN, ("roco",))
    file = tmp_path / "co.links.json"
    if how == "gone":
        file.unlink()
    else:
        file.write_bytes(file.read_bytes().replace(b'"deny"', b'"allow"'))
    assert issue(tmp_path, DESIGN, ("roco",), keep_days=1.0).made_now


def test_a_key_is_revoked_at_each_agent_that_has_a_folder_of_its_own(tmp_path: Path) -> None:
    """New keys end it everywhere."""
    issue(tmp_path, DESIGN, ("roco",), apart=True)
    revoke(tmp_path, "pl")
    assert {name for name in identities(DESIGN) if revoked(tmp_path / name)} == {
        "router",
        *DESIGN.agents,
    }
    issue(tmp_path, DESIGN, ("roco",), apart=True)
    assert not [name for name in identities(DESIGN) if revoked(tmp_path / name)]


SPOILED: dict[str, Callable[[Path, Path], object]] = {
    "a key is gone": lambda made, other: (made / "ta.key").unlink(),
    "a certificate is of another authority": lambda made, other: shutil.copy(
        other / "ta.pem", made / "ta.pem"
    ),
    "a certificate is another's": lambda made, other: shutil.copy(made / "pl.pem", made / "ta.pem"),
    "the authority is another": lambda made, other: shutil.copy(
        other / "authority.pem", made / "authority.pem"
    ),
    "the rights are gone": lambda made, other: (made / "rights.json").unlink(),
    "the rights are wider": lambda made, other: (made / "rights.json").write_bytes(
        (made / "rights.json").read_bytes().replace(b'"deny"', b'"allow"')
    ),
    "a certificate is none": lambda made, other: (made / "hi.pem").write_text("x"),
}


@pytest.mark.parametrize("how", SPOILED)
def test_what_lacks_anything_is_made_anew(tmp_path: Path, how: str) -> None:
    """All of it, since the authority's private key is nowhere."""
    issue(tmp_path / "made", DESIGN, ("roco",))
    issue(tmp_path / "other", DESIGN, ("roco",))
    SPOILED[how](tmp_path / "made", tmp_path / "other")
    assert issue(tmp_path / "made", DESIGN, ("roco",), keep_days=1.0).made_now
    assert not issue(tmp_path / "made", DESIGN, ("roco",), keep_days=1.0).made_now


@pytest.mark.parametrize(
    "change", [{"systems": ("velma1",)}, {"hosts": ("localhost", "robot.lan")}]
)
def test_what_is_for_another_use_is_made_anew(
    tmp_path: Path, change: dict[str, tuple[str, ...]]
) -> None:
    """Another system, or a host that the router's certificate does not name."""
    issue(tmp_path, DESIGN, ("roco",))
    asked = {"systems": ("roco",), "hosts": ("localhost",)} | change
    assert issue(tmp_path, DESIGN, asked["systems"], hosts=asked["hosts"], keep_days=1.0).made_now


def context(seat: Seat, way: int) -> ssl.SSLContext:
    """Of one side, with its certificate; it verifies the other's strictly, which is the default
    since Python 3.13.
    """
    found = ssl.SSLContext(way)
    found.verify_mode = ssl.CERT_REQUIRED
    found.verify_flags |= ssl.VERIFY_X509_STRICT
    found.load_verify_locations(seat.folder / AUTHORITY)
    found.load_cert_chain(
        certificate_file(seat.folder, seat.identity), key_file(seat.folder, seat.identity)
    )
    return found


def shake_hands(listens: Seat, connects: Seat) -> None:
    """A handshake in memory. Raises ssl.SSLError where either does not take the other's
    certificate.
    """
    there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
    client = context(connects, ssl.PROTOCOL_TLS_CLIENT).wrap_bio(
        back, there, server_hostname="localhost"
    )
    server = context(listens, ssl.PROTOCOL_TLS_SERVER).wrap_bio(there, back, server_side=True)
    open_sides = [client, server]
    while open_sides:
        side = open_sides.pop(0)
        try:
            side.do_handshake()
        except ssl.SSLWantReadError:
            open_sides.append(side)


@pytest.mark.parametrize("systems", [("roco",), ("velma1", "velma2")], ids=len)
def test_both_sides_take_each_certificate_strictly(
    tmp_path: Path, systems: tuple[str, ...]
) -> None:
    """The router with each client of it, and an agent with each other one, on any Python
    version.
    """
    issue(tmp_path, DESIGN, systems)
    every = seats(tmp_path, DESIGN, systems)
    (router,) = [seat for seat in every if seat.identity == ROUTER]
    agents = [seat for seat in every if seat.identity in DESIGN.agents]
    for listener in (router, *agents):
        for other in agents if listener in agents else every:
            if other not in (listener, router):
                shake_hands(listener, other)


@pytest.mark.parametrize("lacks", [x509.AuthorityKeyIdentifier, x509.SubjectKeyIdentifier])
def test_those_of_older_versions_are_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lacks: type[x509.ExtensionType]
) -> None:
    """They lacked the identifiers of keys, without which they are not taken strictly."""
    add = x509.CertificateBuilder.add_extension
    with monkeypatch.context() as older:
        older.setattr(
            x509.CertificateBuilder,
            "add_extension",
            lambda self, one, critical: (
                self if isinstance(one, lacks) else add(self, one, critical)
            ),
        )
        issue(tmp_path, DESIGN, ("roco",))
    co, router = (
        seat for seat in seats(tmp_path, DESIGN, ("roco",)) if seat.identity in ("co", "router")
    )
    with pytest.raises(ssl.SSLError, match=r"(?i)missing .* key identifier"):
        shake_hands(router, co)
    assert issue(tmp_path, DESIGN, ("roco",), keep_days=1.0).made_now
    shake_hands(router, co)
