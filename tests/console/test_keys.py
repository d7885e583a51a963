"""`roco keys make`: what it writes, for which design, and what it says when it cannot."""

from pathlib import Path

import msgspec
import pytest
from calling import printed, roco
from cryptography import x509

from agent_runtime.io.secured import Rights, client_tls, rights_of, router_tls
from companion.design import DESIGN
from topdown.model.rights import access_control, identities

ROOT = Path(__file__).resolve().parents[2]


def test_each_identity_gets_its_own_for_as_long_as_asked(tmp_path: Path) -> None:
    """CN is the identity; it holds for the days given; those of router and agents name hosts."""
    told = printed("keys", "make", tmp_path, "--days", 2, "--host", "robot.lan")
    assert told["identities"] == list(identities(DESIGN))
    for name in told["identities"]:
        one = x509.load_pem_x509_certificate((tmp_path / f"{name}.pem").read_bytes())
        assert one.subject.rfc4514_string() == f"CN={name}"
        holds = one.not_valid_after_utc - one.not_valid_before_utc
        assert 2.0 <= holds.total_seconds() / 86400 < 2.01
        names = x509.SubjectAlternativeName
        hosts = [ext for ext in one.extensions if isinstance(ext.value, names)]
        assert bool(hosts) == (name in {"router", *DESIGN.agents})
        if hosts:
            assert "robot.lan" in hosts[0].value.get_values_for_type(x509.DNSName)
    assert client_tls(tmp_path, "co")["enable_mtls"]
    assert router_tls(tmp_path)["enable_mtls"]


def test_the_rights_beside_them_are_the_designs(tmp_path: Path) -> None:
    """For the system that is named."""
    roco("keys", "make", tmp_path, "--system", "velma1", code=0)
    made = Rights(("velma1",), access_control(DESIGN, "velma1"))
    wanted = msgspec.json.decode(msgspec.json.encode(made), type=Rights)
    assert rights_of(tmp_path, "velma1") == wanted


def test_another_design_has_other_identities(tmp_path: Path) -> None:
    """Any design file will do."""
    file = str(ROOT / "shared/topdown/scaffold/smallest.toml")
    roco("keys", "make", tmp_path, "--design", file, code=0)
    names = {"asker", "doer", "monitor", "console", "operator", "router"}
    assert {one.stem for one in tmp_path.glob("*.key")} == names


@pytest.mark.parametrize("design", ["nowhere.toml", "README.md"])
def test_what_is_no_design_is_told(tmp_path: Path, design: str) -> None:
    """One line, exit code 2, nothing written."""
    done = roco("keys", "make", tmp_path / "keys", "--design", ROOT / design, code=2)
    assert "Traceback" not in done.output
    assert not (tmp_path / "keys").exists()
