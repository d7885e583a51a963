"""Sessions that the router refuses, and their names in its log; keys that are missing."""

import datetime as dt
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh
from guarded import SYSTEM
from toy_fleet import wait_for

from agent_runtime.io import issuing
from agent_runtime.io.secured import AUTHORITY, KeysError, Rights, client_tls, rights_of
from agent_runtime.io.sessions import client_config, free_endpoint
from companion.design import DESIGN
from topdown.model.rights import ROUTER, access_control, identities

pytestmark = pytest.mark.zenoh
RIGHTS = Rights((SYSTEM,), access_control(DESIGN, SYSTEM))
WEEK = dt.timedelta(days=7)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keys of the router and of co, and what co once had, will have, or got from another
    authority.
    """
    where, now = tmp_path_factory.mktemp("keys"), dt.datetime.now(dt.UTC)
    issuer = issuing.authority("authority", now - 3 * WEEK, now + 3 * WEEK)
    foreign = issuing.authority("authority", now - 3 * WEEK, now + 3 * WEEK)
    issuing.publish(where, issuer, RIGHTS)
    issuing.certify(where, issuer, ROUTER, now, now + WEEK, issuing.HOSTS)
    issuing.certify(where, issuer, "co", now, now + WEEK)
    for name, begin, by in (
        ("expired", now - 2 * WEEK, issuer),
        ("early", now + WEEK, issuer),
        ("foreign", now, foreign),
    ):
        (where / name).mkdir()
        issuing.publish(where / name, issuer, RIGHTS)
        issuing.certify(where / name, by, "co", begin, begin + WEEK)
    return where


@pytest.fixture(scope="module")
def router(folder: Path) -> Iterator[str]:
    """A router as a process, with those keys; its address."""
    address = free_endpoint().replace("tcp/", "tls/")
    told = {
        "ROCO_LISTEN": address,
        "ROCO_RUN_DIR": str(folder),
        "ROCO_TLS_DIR": str(folder),
        "ROCO_SYSTEM": SYSTEM,
    }
    with (folder / "router.log").open("ab") as log:
        command = [sys.executable, "-m", "services.router"]
        process = subprocess.Popen(command, env=os.environ | told, stdout=log, stderr=log)
    wait_for((folder / "router.ready").exists, "the router listens")
    yield address
    process.send_signal(signal.SIGTERM)
    assert process.wait(30.0) == 0


REASONS = {
    "foreign": "BadSignature",
    "expired": "certificate expired",
    "early": "not valid yet",
    "router": "does not allow extended key usage for client authentication",
    "none": "peer sent no certificates",
    "plain": "corrupt message",
}


@pytest.mark.parametrize("why", REASONS)
def test_a_session_without_a_good_certificate_is_refused(
    folder: Path, router: str, why: str
) -> None:
    """The router does not let it in, and its log has one more line that says why; co with its own
    gets in after it.
    """
    log = folder / "router.log"
    before = log.read_text().count(REASONS[why])
    tls, address = client_tls(folder, "co"), router
    if why in ("foreign", "expired", "early"):
        tls = client_tls(folder / why, "co")
    elif why == "router":
        tls = client_tls(folder, ROUTER)
    elif why == "none":
        tls = {"root_ca_certificate": str(folder / AUTHORITY)}
    else:
        address = router.replace("tls/", "tcp/")
    with pytest.raises(zenoh.ZError):
        zenoh.open(client_config(address, tls if address == router else None))
    wait_for(
        lambda: log.read_text().count(REASONS[why]) == before + 1,
        f"the log says why:\n{log.read_text()}",
    )
    zenoh.open(client_config(router, client_tls(folder, "co"))).close()


def test_a_client_does_not_speak_to_a_foreign_router(tmp_path: Path, router: str) -> None:
    """A process at the router's address without its certificate hears nothing: the client refuses
    it.
    """
    issuing.issue(tmp_path, DESIGN, (SYSTEM,))
    with pytest.raises(zenoh.ZError):
        zenoh.open(client_config(router, client_tls(tmp_path, "co")))


def test_missing_keys_and_rights_of_another_system_are_told(folder: Path) -> None:
    """Before anything is opened, with what is there and what to do."""
    with pytest.raises(
        KeysError, match="identities with a key there: co, router; `roco keys make`"
    ):
        client_tls(folder, "ta")
    with pytest.raises(KeysError, match="'guarded', this router serves 'other'"):
        rights_of(folder, "other")


def test_keys_are_for_their_owner_alone(tmp_path: Path) -> None:
    """Mode 0700 and 0600; the authority's private key is nowhere."""
    issuing.issue(tmp_path / "keys", DESIGN, (SYSTEM,))
    assert (tmp_path / "keys").stat().st_mode & 0o777 == 0o700
    files = list((tmp_path / "keys").iterdir())
    assert {file.stat().st_mode & 0o777 for file in files} == {0o600}
    assert {file.stem for file in files if file.suffix == ".key"} == set(identities(DESIGN))


def test_an_agent_without_its_keys_ends_and_says_why(folder: Path, tmp_path: Path) -> None:
    """Exit status 1, one line, nothing opened."""
    told = {"ROCO_RUN_DIR": str(tmp_path), "ROCO_TLS_DIR": str(folder), "ROCO_SYSTEM": SYSTEM}
    told["ROCO_AGENTS"] = ",".join(f"{name}=tls/127.0.0.1:1" for name in DESIGN.agents)
    command = [sys.executable, "-m", "services.task"]
    done = subprocess.run(
        command, env=os.environ | told, capture_output=True, text=True, timeout=30.0, check=False
    )
    assert done.returncode == 1
    assert f"{folder / 'ta.pem'} is missing" in done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    assert not (tmp_path / "journal").exists()
