"""Certificates and their places; valid ones are kept, and an incomplete set never passes for a whole one."""

import datetime as dt
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from cryptography import x509

from agent_runtime.io.issuing import issue
from agent_runtime.io.secured import rights_of
from companion.design import DESIGN
from topdown.model.rights import identities

NOW = dt.datetime(2026, 11, 21, tzinfo=dt.UTC)
DAY = dt.timedelta(days=1)


def common_name(file: Path) -> str:
    """The CN in a certificate."""
    return x509.load_pem_x509_certificate(file.read_bytes()).subject.rfc4514_string()


def test_apart_each_folder_has_its_own_and_no_more(tmp_path: Path) -> None:
    """A process that sees its folder alone has the authority's certificate and its own key; the router the rights."""
    issue(tmp_path, DESIGN, ("roco",), apart=True)
    assert {one.name for one in tmp_path.iterdir()} == set(identities(DESIGN))
    for name in identities(DESIGN):
        there = {one.name for one in (tmp_path / name).iterdir()}
        assert there == {"authority.pem", f"{name}.pem", f"{name}.key"} | (
            {"rights.json"} if name == "router" else set()
        )
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


SPOILED: dict[str, Callable[[Path, Path], object]] = {
    "a key is gone": lambda made, other: (made / "ta.key").unlink(),
    "a certificate is of another authority": lambda made, other: shutil.copy(other / "ta.pem", made / "ta.pem"),
    "a certificate is another's": lambda made, other: shutil.copy(made / "pl.pem", made / "ta.pem"),
    "the authority is another": lambda made, other: shutil.copy(other / "authority.pem", made / "authority.pem"),
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


@pytest.mark.parametrize("change", [{"systems": ("velma1",)}, {"hosts": ("localhost", "robot.lan")}])
def test_what_is_for_another_use_is_made_anew(tmp_path: Path, change: dict[str, tuple[str, ...]]) -> None:
    """Another system, or a host that the router's certificate does not name."""
    issue(tmp_path, DESIGN, ("roco",))
    asked = {"systems": ("roco",), "hosts": ("localhost",)} | change
    assert issue(tmp_path, DESIGN, asked["systems"], hosts=asked["hosts"], keep_days=1.0).made_now
