"""scripts/two-hosts: its two hosts are joined by the cable alone and gone afterwards; what crosses
is counted.
"""

import os
import shutil
import subprocess
import sys
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest

from operate.file_names import TRAFFIC_FILE
from operate.recording import mcap_file
from operate.recording.records import House, Spoken

ROOT = Path(__file__).resolve().parents[1]
HISTORY = ROOT / "tests/histories/pour_seed_7"
sys.path.insert(0, str(ROOT / "scripts"))

from crossing import crossed, told  # noqa: E402  (after the path is set)
from namespaces import CannotError, Host, run, two_hosts  # noqa: E402

pytestmark = pytest.mark.process

PORT = "7447"
LISTENS = (
    f"import socket, time; s = socket.create_server(('', {PORT})); print('listens', flush=True);"
    " time.sleep(600)"
)


def can() -> bool:
    """Whether namespaces can be made here: root alone is not enough in some containers."""
    with suppress(CannotError), two_hosts():
        return True
    return False


def reaches(one: Host, other: Host) -> bool:
    """Whether a connection from one host to what listens on the other opens."""
    asks = f"import socket; socket.create_connection(('{other.address}', {PORT}), 1.0)"
    done = subprocess.run(
        one.inside(sys.executable, "-c", asks), capture_output=True, timeout=20.0, check=False
    )
    return done.returncode == 0


@pytest.mark.skipif(
    os.geteuid() != 0 or not can(),
    reason="needs network namespaces (as root, in a container with CAP_SYS_ADMIN: scripts/test)",
)
@pytest.mark.skipif(
    shutil.which("ip") is None, reason="needs iproute2 (Debian: apt install iproute2)"
)
def test_two_hosts_are_joined_by_the_cable_alone_and_gone_afterwards() -> None:
    """A listener on one is reached from the other while the cable is in, and ends with its host."""
    with ExitStack() as ending:
        desk, robot = ending.enter_context(two_hosts())
        command = desk.inside(sys.executable, "-c", LISTENS)
        listener = ending.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE))
        assert listener.stdout is not None
        assert listener.stdout.readline() == b"listens\n"
        assert reaches(robot, desk)
        robot.cable(plugged=False)
        assert not reaches(robot, desk)
        robot.cable(plugged=True)
        assert reaches(robot, desk)
        assert min(robot.carried()) > 0
        spaces = run(["ip", "netns", "list"])
        assert all(host.space in spaces for host in (desk, robot))
        for host in (desk, robot):
            host.clear()
        assert listener.wait(10.0) != 0
    spaces = run(["ip", "netns", "list"])
    assert not any(host.space in spaces for host in (desk, robot))


def test_what_is_not_root_is_told_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before anything is made."""
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    with pytest.raises(CannotError, match="sudo scripts/two-hosts"), two_hosts():
        pass


def test_what_crosses_is_what_ex_says_and_hears() -> None:
    """Of a recorded pour: every communicate and every other thing that ex sends or gets, none of
    others.
    """
    rows = crossed(HISTORY)
    records = mcap_file.read(HISTORY / TRAFFIC_FILE).records
    said = [
        one for one in records if isinstance(one, Spoken) and "ex" in (one.sender, one.receiver)
    ]
    other = [one for one in records if isinstance(one, House) and "ex" in (one.owner, one.peer)]
    assert said
    assert sum(count for _, count, _ in rows) == len(said) + len(other)
    sizes = [*(one.size for one in said), *(len(one.data) for one in other)]
    assert sum(size for *_, size in rows) == sum(sizes)
    assert {what.split()[0] for what, *_ in rows if what.startswith("C")} == {"C5"}
    text = told({"success": True, "poured_fraction": 1.0, "holes": []}, rows, (7_500_000, 300_000))
    assert text.splitlines()[0] == "success"
    assert f"with others: {len(said)}; the paper has 39" in text
