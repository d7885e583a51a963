"""The process that starts the router makes the keys and renews them in time; nothing is plain by
accident.
"""

import shutil
import socket
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from cryptography import x509

from agent_runtime.io import issuing, reaching
from agent_runtime.io.secured import rights_of
from companion.tools.system import SYSTEM
from operate.supervisor import securing
from operate.supervisor.securing import AGAIN_S, DAYS, LAST, Keys

ROOT = Path(__file__).resolve().parents[3]


def keys(
    run: Path, connect: str = "", given: str = "", *, insecure: bool = False, router: bool = True
) -> Keys:
    """As the command line asks for them, once they are there."""
    found = Keys(
        run, SYSTEM.design, "velma7", connect, given, insecure=insecure, here=router, agents={}
    )
    found.made()
    return found


@pytest.fixture
def at(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Sets the clock so many days from now."""
    now = securing.time.time()
    return lambda days: monkeypatch.setattr(securing.time, "time", lambda: now + days * 86400.0)


def test_the_default_is_tls_with_keys_of_a_week_in_the_run_folder(tmp_path: Path) -> None:
    """For the system and the host asked for, with modes that let nobody else read them. Without an
    address a free port is used.
    """
    made = keys(tmp_path, "tls/192.0.2.7:7447")
    assert (made.address, made.folder) == ("tls/192.0.2.7:7447", tmp_path / "keys")
    assert rights_of(tmp_path / "keys", "velma7")
    router = x509.load_pem_x509_certificate((tmp_path / "keys/router.pem").read_bytes())
    lasts = router.not_valid_after_utc - router.not_valid_before_utc
    assert 7.0 <= lasts.total_seconds() / 86400.0 < 7.01
    # the supervisor names it before the module is loaded that makes keys
    assert issuing.DAYS == DAYS
    hosts = router.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert "192.0.2.7" in [str(one) for one in hosts.get_values_for_type(x509.IPAddress)]
    assert (tmp_path / "keys").stat().st_mode & 0o777 == 0o700
    assert {file.stat().st_mode & 0o777 for file in (tmp_path / "keys").iterdir()} == {0o600}
    assert keys(tmp_path).address.startswith("tls/127.0.0.1:")


def test_a_router_that_others_reach_has_a_listener_of_its_own_for_this_host(tmp_path: Path) -> None:
    """On loopback, at a port of its own; the processes of this host meet there. Elsewhere all meet
    at the address that was asked for: it is on loopback already, or the router is not started here.
    """
    for way, insecure in (("tls/", False), ("tcp/", True)):
        made = keys(tmp_path, f"{way}192.0.2.7:7447", insecure=insecure)
        assert made.own.startswith(f"{way}127.0.0.1:")
        assert made.listen == f"{way}192.0.2.7:7447,{made.own}"
    for connect, router in (("tls/127.0.0.1:7447", True), ("tls/router:7447", False)):
        made = keys(tmp_path, connect, "some", router=router)
        assert (made.own, made.listen) == (connect, connect)


def test_a_socket_that_cannot_be_is_told() -> None:
    """The kernel takes 107 bytes for its name, Zenoh a lock file beside it and none of the marks of
    an endpoint.
    """
    assert securing.socket_in(Path("/run/one"), "co") == "unixsock-stream//run/one/links/co.sock"
    for name in ("x" * 90, "a?b", "a#b", "a;b"):
        with pytest.raises(ValueError, match="name another folder with --out"):
            securing.socket_in(Path("/run") / name, "co")


def test_insecure_is_said_and_makes_no_keys(tmp_path: Path) -> None:
    """Also where keys stand in the environment."""
    made = keys(tmp_path, given=str(tmp_path), insecure=True)
    assert made.folder is None
    assert made.address.startswith("tcp/127.0.0.1:")
    assert not (tmp_path / "keys").exists()


def test_a_part_of_a_fleet_takes_what_it_is_given(
    tmp_path: Path, at: Callable[[float], None]
) -> None:
    """It makes none: they would be of another authority than the router's. Given keys are renewed
    by whoever made them.
    """
    made = keys(tmp_path, "tls/router:7447", "some", router=False)
    assert made.folder == Path("some").resolve()
    assert keys(tmp_path, "tcp/router:7447", router=False).folder is None
    at(1e5)
    made.tend()
    assert list(tmp_path.iterdir()) == []


def test_address_and_keys_that_do_not_fit_are_told(tmp_path: Path) -> None:
    """Before anything is written."""
    for connect, insecure, router, why in (
        ("tls/a:1,tls/b:1", False, True, "names several routers: a fleet has one"),
        ("tcp/127.0.0.1:7447", False, True, "begins with tls/"),
        ("tls/127.0.0.1:7447", True, True, "--keys names their folder"),
        ("tls/router:7447", False, False, "--keys names their folder"),
    ):
        with pytest.raises(ValueError, match=why):
            keys(tmp_path, connect, insecure=insecure, router=router)
        assert list(tmp_path.iterdir()) == []


def test_each_start_makes_them_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keys of the last start are of no use any more. They are away while the new ones are made: the
    router waits for those.
    """
    keys(tmp_path)
    before = (tmp_path / "keys/authority.pem").read_bytes()
    keys(tmp_path)
    assert (tmp_path / "keys/authority.pem").read_bytes() != before
    monkeypatch.setattr(Keys, "_begin", lambda self: None)
    keys(tmp_path)
    assert not (tmp_path / "keys/router.key").exists()


def test_they_are_made_anew_before_they_end(tmp_path: Path, at: Callable[[float], None]) -> None:
    """In the last part of their time, once."""
    made, minute = keys(tmp_path), 60.0 / 86400.0
    file = tmp_path / "keys/router.key"
    first = file.read_bytes()
    for days, same in (((1.0 - LAST) * 7 - minute, True), ((1.0 - LAST) * 7 + minute, False)):
        at(days)
        made.tend()
        assert (file.read_bytes() == first) is same


@pytest.mark.process
def test_git_takes_no_key(tmp_path: Path) -> None:
    """Git ignores keys anywhere in the project; a copy without git has nothing to take."""
    if not (ROOT / ".git").exists():
        pytest.skip("needs a clone (git clone; this is a copy without .git)")
    files = (keys(tmp_path).folder or tmp_path).iterdir()
    made = [f"some/where/{one.name}" for one in files if one.suffix != ".json"]
    command = ["git", "check-ignore", "--no-index", *made]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=30.0)
    assert done.stdout.split() == made


def test_what_cannot_be_written_is_told(tmp_path: Path) -> None:
    """Not lost in the thread that makes them."""
    (tmp_path / "keys").write_text("in the way")
    with pytest.raises(OSError, match="keys"):
        keys(tmp_path)


@pytest.mark.parametrize("hours", [-1, -30, 24 * 6.5, 24 * 400])
def test_keys_are_renewed_for_a_clock_that_was_set(
    tmp_path: Path, at: Callable[[float], None], hours: float
) -> None:
    """Back or forward: the new ones hold at the time that the clock shows now; a second look renews
    nothing.
    """
    made, file = keys(tmp_path), tmp_path / "keys/router.pem"
    before = file.read_bytes()
    at(hours / 24.0)
    made.tend()
    after = file.read_bytes()
    assert after != before
    begin, end = issuing.lifetime(file)
    assert begin.timestamp() < securing.time.time() < end.timestamp()
    made.tend()
    assert file.read_bytes() == after


def test_deleted_keys_are_made_again(tmp_path: Path) -> None:
    """A run folder that somebody deleted is filled again while the fleet runs."""
    made = keys(tmp_path)
    shutil.rmtree(tmp_path / "keys")
    made.tend()
    assert (tmp_path / "keys/router.pem").exists()


def test_a_renewal_that_fails_is_tried_again(tmp_path: Path, at: Callable[[float], None]) -> None:
    """A fleet that runs goes on running."""
    made = keys(tmp_path)
    folder, away = tmp_path / "keys", tmp_path / "away"
    folder.rename(away)
    folder.write_text("in the way")
    at(6.5)
    made.tend()
    folder.unlink()
    at(6.5 + AGAIN_S / 86400.0)
    made.tend()
    assert (folder / "router.key").read_bytes() != (away / "router.key").read_bytes()


def test_no_free_port_is_one_of_outgoing_connections() -> None:
    """Else somebody's connection has it when its listener starts, seconds later; twenty are
    twenty.
    """
    lowest = int(reaching.RANGE.read_text().split()[0])
    found = {reaching.free_port() for _ in range(20)}
    assert len(found) == 20
    assert all(1024 <= port < lowest for port in found)


def test_a_port_that_was_given_is_given_to_no_other_fleet(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two of them that start at once: the second asks before the first listens. Where all of these
    ports are taken, one is given that the system has.
    """
    monkeypatch.setattr(reaching, "PORTS", 1)
    monkeypatch.setattr(reaching, "TRIES", 1)
    given = reaching.free_port()
    with socket.socket() as listener, socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        for port in (given, taken.getsockname()[1]):
            monkeypatch.setattr(reaching, "_lowest_given", lambda port=port: port + 1)
            assert reaching.free_port() != port
        listener.bind(("127.0.0.1", given))
