"""A whole fleet, recorded beside its own recorder, watched as `console` over TLS, and replayed agent by agent."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from roco_fleet import RocoFleet
from toy_fleet import wait_for

from operate.cli.traffic.replace import Compared
from operate.recording import mcap_file
from operate.recording.records import Spoken

pytestmark = [pytest.mark.zenoh, pytest.mark.long, pytest.mark.timeout(600)]


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[RocoFleet]:
    """All six agents."""
    made = RocoFleet(tmp_path / "run")
    yield made
    made.down()


def test_a_fleet_is_recorded_and_its_agents_say_it_again(fleet: RocoFleet) -> None:
    """`roco record` has what the monitor has of that time; co, pl, km and ta repeat their part of the run."""
    file = fleet.run / "beside.mcap"
    command = [sys.executable, "-m", "operate.cli", "record", "--out", str(file), "--run-dir", str(fleet.run)]
    recorder = subprocess.Popen([*command, "--format", "json"], stdout=subprocess.PIPE)
    wait_for(lambda: file.exists() or recorder.poll() is not None, "it records", 120.0)
    line = fleet.do("look around")
    assert line.state == "done", line
    recorder.send_signal(2)
    out, _ = recorder.communicate(timeout=60)
    assert msgspec.json.decode(out)["dropped"] == 0
    fleet.down()
    beside, whole = (_said(one) for one in (file, fleet.run / mcap_file.FILE))
    first, last = whole.index(beside[0]), whole.index(beside[-1])
    assert sorted(beside) == sorted(whole[first : last + 1])
    for agent in ("co", "pl", "km", "ta"):
        again = [sys.executable, "-m", "operate.cli", "replay", str(fleet.run), "--replace", agent]
        done = subprocess.run(
            [*again, "--speed", "1", "--format", "json"], capture_output=True, timeout=300, check=False
        )
        assert done.returncode == 0, (agent, done.stdout, done.stderr)
        told = msgspec.json.decode(done.stdout, type=Compared)
        assert (told.difference, told.spoken) == (None, told.lines)


def _said(file: Path) -> list[bytes]:
    return [record.wire for record in mcap_file.read(file).records if isinstance(record, Spoken)]
