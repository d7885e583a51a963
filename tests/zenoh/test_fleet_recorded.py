"""A whole fleet, recorded beside its own recorder, watched as `console` over TLS, and replayed
agent by agent.
"""

from pathlib import Path

import msgspec
import pytest
from roco_fleet import RocoFleet
from toy_fleet import wait_for

from console.traffic.replace import Compared
from operate.file_names import TRAFFIC_FILE
from operate.recording import mcap_file
from operate.recording.records import Spoken

pytestmark = [pytest.mark.zenoh, pytest.mark.long, pytest.mark.timeout(600)]


def test_a_fleet_is_recorded_and_its_agents_say_it_again(fleet: RocoFleet) -> None:
    """`roco record` has what the monitor has of that time; co, pl, km and ta repeat their part of
    the run.
    """
    file = fleet.run / "beside.mcap"
    recorder = fleet.begin("record --format json --out", str(file))
    wait_for(lambda: file.exists() or recorder.poll() is not None, "it records", 120.0)
    line = fleet.do("look around")
    assert line.state == "done", line
    recorder.send_signal(2)
    out, _ = recorder.communicate(timeout=60)
    assert msgspec.json.decode(out)["dropped"] == 0
    fleet.down()
    beside, whole = (_said(one) for one in (file, fleet.run / TRAFFIC_FILE))
    assert sorted(beside) == sorted(one for one in whole if min(beside) <= one <= max(beside))
    for agent in ("co", "pl", "km", "ta"):
        words = f"replay {fleet.run} --speed 1 --format json --replace {agent}".split()
        told = msgspec.json.decode(fleet.roco(*words, timeout=300.0, inside=False), type=Compared)
        assert (told.difference, told.spoken) == (None, told.lines), agent


def _said(file: Path) -> list[tuple[float, bytes]]:
    """When each was taken, and its bytes."""
    return [
        (one.received, one.wire) for one in mcap_file.read(file).records if isinstance(one, Spoken)
    ]
