"""The process that starts the router makes the keys and renews them in time; nothing is plain by
accident.
"""

import shutil
import socket
import subprocess
from pathlib import Path

import pytest
from cryptography import x509

import agent_runtime.io.issuing
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


def test_the_default_is_tls_with_keys_of_a_week_in_the_run_folder(tmp_path: Path) -> None:
    """For the system and the host asked for, with modes that let nobody else read them."""
    made = keys(tmp_path, "tls/192.0.2.7:7447")
    assert (made.address, made.folder) == ("tls/192.0.2.7:7447", tmp_path / "keys")
    assert rights_of(tmp_path / "keys", "velma7")
    router = x509.load_pem_x509_certificate((tmp_path / "keys/router.pem").read_bytes())
    assert (
        7.0
        <= (router.not_valid_after_utc - router.not_valid_before_utc).total_seconds() / 86400.0
        < 7.01
    )
    hosts = router.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert "192.0.2.7" in [str(one) for one in hosts.get_values_for_type(x509.IPAddress)]
    assert (tmp_path / "keys").stat().st_mode & 0o777 == 0o700
    assert {file.stat().st_mode & 0o777 for file in (tmp_path / "keys").iterdir()} == {0o600}


def test_a_free_port_is_reached_by_tls(tmp_path: Path) -> None:
    """A free port is used if no address is asked for."""
    assert keys(tmp_path).address.startswith("tls/127.0.0.1:")


@pytest.mark.parametrize("insecure", [False, True])
def test_a_router_that_others_reach_has_a_listener_of_its_own_for_this_host(
    tmp_path: Path, insecure: bool
) -> None:
    """On loopback, at a port of its own; the processes of this host meet there."""
    way = "tcp/" if insecure else "tls/"
    made = keys(tmp_path, f"{way}192.0.2.7:7447", insecure=insecure)
    assert made.own.startswith(f"{way}127.0.0.1:")
    assert made.listen == f"{way}192.0.2.7:7447,{made.own}"


@pytest.mark.parametrize(
    ("connect", "router"), [("tls/127.0.0.1:7447", True), ("tls/router:7447", False)]
)
def test_elsewhere_all_meet_at_the_address_that_was_asked_for(
    tmp_path: Path, connect: str, router: bool
) -> None:
    """It is on loopback already, or the router is not started here."""
    made = keys(tmp_path, connect, "some", router=router)
    assert (made.own, made.listen) == (connect, connect)


@pytest.mark.parametrize("name", ["x" * 90, "a?b", "a#b", "a;b"])
def test_a_socket_that_cannot_be_is_told(name: str) -> None:
    """The kernel takes 107 bytes for its name, Zenoh a lock file beside it and none of the marks of
    an endpoint.
    """
    assert securing.socket_in(Path("/run/one"), "co") == "unixsock-stream//run/one/links/co.sock"
    with pytest.raises(ValueError, match="name another folder with --out"):
        securing.socket_in(Path("/run") / name, "co")


def test_several_routers_are_refused(tmp_path: Path) -> None:
    """Before anything is written."""
    with pytest.raises(ValueError, match="names several routers: a fleet has one"):
        keys(tmp_path, "tls/a:1,tls/b:1")
    assert list(tmp_path.iterdir()) == []


def test_insecure_is_said_and_makes_no_keys(tmp_path: Path) -> None:
    """Also where keys stand in the environment."""
    made = keys(tmp_path, given=str(tmp_path), insecure=True)
    assert made.folder is None
    assert made.address.startswith("tcp/127.0.0.1:")
    assert not (tmp_path / "keys").exists()


def test_a_part_of_a_fleet_takes_what_it_is_given(tmp_path: Path) -> None:
    """It makes none: they would be of another authority than the router's."""
    assert keys(tmp_path, "tls/router:7447", "some", router=False).folder == Path("some").resolve()
    assert keys(tmp_path, "tcp/router:7447", router=False).folder is None
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("connect", "insecure", "router", "why"),
    [
        ("tcp/127.0.0.1:7447", False, True, "begins with tls/"),
        ("tls/127.0.0.1:7447", True, True, "--keys names their folder"),
        ("tls/router:7447", False, False, "--keys names their folder"),
    ],
)
def test_address_and_keys_that_do_not_fit_are_told(
    tmp_path: Path, connect: str, insecure: bool, router: bool, why: str
) -> None:
    """Before anything is written."""
    with pytest.raises(ValueError, match=why):
        keys(tmp_path, connect, insecure=insecure, router=router)
    assert list(tmp_path.iterdir()) == []


def test_each_start_makes_them_anew(tmp_path: Path) -> None:
    """Keys of the last start are of no use any more."""
    keys(tmp_path)
    before = (tmp_path / "keys/authority.pem").read_bytes()
    keys(tmp_path)
    assert (tmp_path / "keys/authority.pem").read_bytes() != before


def test_they_are_made_anew_before_they_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the last part of their time, once."""
    made = keys(tmp_path)
    file = tmp_path / "keys/router.key"
    first, now = file.read_bytes(), securing.time.time()
    monkeypatch.setattr(securing.time, "time", lambda: now + (1.0 - LAST) * 7 * 86400.0 - 60.0)
    made.tend()
    assert file.read_bytes() == first
    monkeypatch.setattr(securing.time, "time", lambda: now + (1.0 - LAST) * 7 * 86400.0 + 60.0)
    made.tend()
    assert file.read_bytes() != first


def test_keys_that_were_given_are_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Given keys are renewed by whoever made them."""
    made = keys(tmp_path, "tls/router:7447", str(tmp_path), router=False)
    monkeypatch.setattr(securing.time, "time", lambda: 9e9)
    made.tend()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.process
def test_git_takes_no_key(tmp_path: Path) -> None:
    """Git ignores keys anywhere in the project; a copy without git has nothing to take."""
    if not (ROOT / ".git").exists():
        pytest.skip("needs a clone (git clone; this is a copy without .git)")
    made = [
        f"some/where/{one.name}"
        for one in (keys(tmp_path).folder or tmp_path).iterdir()
        if one.suffix != ".json"
    ]
    command = ["git", "check-ignore", "--no-index", *made]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=30.0, check=False
    )
    assert done.stdout.split() == made


def test_what_cannot_be_written_is_told(tmp_path: Path) -> None:
    """Not lost in the thread that makes them."""
    (tmp_path / "keys").write_text("in the way")
    with pytest.raises(OSError, match="keys"):
        keys(tmp_path)


def test_the_time_they_hold_is_said_once() -> None:
    """The supervisor names it before the module is loaded that makes keys."""
    assert agent_runtime.io.issuing.DAYS == DAYS


@pytest.mark.parametrize("hours", [-1, -30, 24 * 6.5, 24 * 400])
def test_keys_are_renewed_for_a_clock_that_was_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hours: float
) -> None:
    """Back or forward: the new ones hold at the time that the clock shows now; a second look renews
    nothing.
    """
    made, now = keys(tmp_path), securing.time.time() + 3600.0 * hours
    monkeypatch.setattr(securing.time, "time", lambda: now)
    before = (tmp_path / "keys/router.pem").read_bytes()
    made.tend()
    after = (tmp_path / "keys/router.pem").read_bytes()
    assert after != before
    begin, end = issuing.lifetime(tmp_path / "keys/router.pem")
    assert begin.timestamp() < now < end.timestamp()
    made.tend()
    assert (tmp_path / "keys/router.pem").read_bytes() == after


def test_deleted_keys_are_made_again(tmp_path: Path) -> None:
    """A run folder that somebody deleted is filled again while the fleet runs."""
    made = keys(tmp_path)
    shutil.rmtree(tmp_path / "keys")
    made.tend()
    assert (tmp_path / "keys/router.pem").exists()


def test_a_renewal_that_fails_is_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fleet that runs goes on running."""
    made, now = keys(tmp_path), securing.time.time()
    (tmp_path / "keys").rename(tmp_path / "away")
    (tmp_path / "keys").write_text("in the way")
    for later in (6.5 * 86400.0, 6.5 * 86400.0 + AGAIN_S):
        monkeypatch.setattr(securing.time, "time", lambda later=later: now + later)
        made.tend()
        if (tmp_path / "keys").is_file():
            (tmp_path / "keys").unlink()
    assert (tmp_path / "keys/router.key").read_bytes() != (
        tmp_path / "away/router.key"
    ).read_bytes()


def test_the_router_cannot_take_the_last_starts_keys(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are away while the new ones are made: the router waits for those."""
    keys(tmp_path)
    monkeypatch.setattr(Keys, "_begin", lambda self: None)
    keys(tmp_path)
    assert not (tmp_path / "keys/router.key").exists()


def test_no_free_port_is_one_of_outgoing_connections() -> None:
    """Else somebody's connection has it when its listener starts, seconds later; twenty are
    twenty.
    """
    lowest = int(reaching.RANGE.read_text().split()[0])
    found = {reaching.free_port() for _ in range(20)}
    assert len(found) == 20
    assert all(1024 <= port < lowest for port in found)


def test_a_port_that_was_given_is_given_to_no_other_fleet(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two of them that start at once: the second asks before the first listens."""
    given = reaching.free_port()
    monkeypatch.setattr(reaching, "_lowest_given", lambda: given + 1)
    monkeypatch.setattr(reaching, "PORTS", 1)
    monkeypatch.setattr(reaching, "TRIES", 1)
    with socket.socket() as listener:
        assert reaching.free_port() != given
        listener.bind(("127.0.0.1", given))


def test_where_all_of_these_are_taken_any_free_port_is_given(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One that the system gives."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        monkeypatch.setattr(reaching, "_lowest_given", lambda: port + 1)
        monkeypatch.setattr(reaching, "PORTS", 1)
        monkeypatch.setattr(reaching, "TRIES", 1)
        assert reaching.free_port() != port
