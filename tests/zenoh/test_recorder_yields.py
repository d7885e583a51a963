"""The recorder works with what the fleet leaves of the processor, and makes its report as everybody
else works.
"""

from pathlib import Path

import pytest
from secured_fleet import serve, session
from toy_fleet import Fleet, wait_for

from operate.recording.mcap_file import FILE
from operate.recording.recorder import NICENESS

pytestmark = pytest.mark.zenoh
KEY, TOPIC = "roco/roco/_/state/hi", b"house/state"


@pytest.fixture
def fleet(secured_router: Fleet, monkeypatch: pytest.MonkeyPatch) -> Fleet:
    """A router with keys, and the monitor."""
    monkeypatch.setenv("ROCO_VIEW", "off")
    serve(secured_router, "monitor")
    secured_router.ready("monitor")
    return secured_router


def threads(pid: int) -> dict[str, int]:
    """Niceness of each thread; the first is the one that began."""
    files = sorted(Path(f"/proc/{pid}/task").glob("*/stat"), key=lambda file: int(file.parent.name))
    return {
        file.parent.name: int(file.read_text().rpartition(")")[2].split()[16]) for file in files
    }


def test_who_records_gives_way_and_who_reports_does_not(fleet: Fleet) -> None:
    """The threads that hear and write are nicer than the fleet's, the first one, which makes the
    report, is not.
    """
    pid = fleet.processes["monitor"].pid
    found, router = threads(pid), threads(fleet.processes["router"].pid)
    usual = next(iter(router.values()))
    assert found.pop(str(pid)) == usual
    assert found
    assert set(found.values()) == {usual + NICENESS}


def test_what_it_hears_is_recorded_and_it_ends_in_order(fleet: Fleet) -> None:
    """As before it gave way: a signal reaches the thread that writes, and the file is closed."""
    with session(fleet, "hi") as hi:
        wait_for(
            lambda: hi.put(KEY, b"{}") or TOPIC in (fleet.run / FILE).read_bytes(), "it is written"
        )
    assert fleet.stop("monitor") == 0
    assert (fleet.run / FILE).read_bytes().endswith(b"\x89MCAP0\r\n")
