"""A whole fleet, recorded beside its own recorder, watched as `console` over TLS, and replayed
agent by agent.
"""

import os
import signal
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeGuard

import msgspec
import pytest
from roco_fleet import RocoFleet
from toy_fleet import wait_for

from companion.tools.system import SYSTEM
from operate.cli.traffic.replace import Compared
from operate.recording import mcap_file
from operate.recording.ends import Ends
from operate.recording.records import Identity, Origin, Record, Spoken
from operate.recording.run import Run

pytestmark = [pytest.mark.zenoh, pytest.mark.long, pytest.mark.timeout(600)]
PHASES, FIRST, APART = 12, 30, 25
"""Of a pour of some 400 communicates."""
SAID = 10


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
    beside, whole = (_said(one) for one in (file, fleet.run / mcap_file.FILE))
    assert sorted(beside) == sorted(one for one in whole if min(beside) <= one <= max(beside))
    for agent in ("co", "pl", "km", "ta"):
        words = f"replay {fleet.run} --speed 1 --format json --replace {agent}".split()
        told = msgspec.json.decode(fleet.roco(*words, timeout=300.0, inside=False), type=Compared)
        assert (told.difference, told.spoken) == (None, told.lines), agent


@pytest.mark.parametrize("first", [0, 1], ids=["killed first", "frozen first"])
def test_a_recorder_misses_nothing_at_any_phase_of_a_pour(fleet: RocoFleet, first: int) -> None:
    """At twelve phases it is killed, or frozen until agents have said more: each communicate is
    recorded once, and the pour is done.
    """
    ends, taken = Ends(fleet.run, SYSTEM), list[Identity]()

    def said() -> int:
        taken.extend(one.identity for one in ends.new(time.time()) if _is_taken(one))
        return len(taken)

    with ThreadPoolExecutor(1) as person:
        pour = person.submit(fleet.do, "pour the jar into the bowl")
        for phase in range(PHASES):
            enough = FIRST + phase * APART
            wait_for(lambda: said() >= enough or pour.done(), f"phase {phase}", 120.0)  # noqa: B023
            pid = int((fleet.run / "monitor.pid").read_text())
            if (phase + first) % 2:
                os.kill(pid, signal.SIGSTOP)
                here = said()
                wait_for(lambda: said() >= here + SAID or pour.done(), "agents go on", 120.0)  # noqa: B023
                os.kill(pid, signal.SIGCONT)
            else:
                os.kill(pid, signal.SIGKILL)
                wait_for(lambda: _pid(fleet) not in (0, pid), "the monitor is back", 60.0)  # noqa: B023
        assert not pour.done(), "all phases were in the pour"
        line = pour.result()
    assert line.state == "done", line
    fleet.down()
    taken.extend(one.identity for one in ends.rest() if _is_taken(one))
    recorded = mcap_file.read(fleet.run / mcap_file.FILE, SYSTEM)
    assert recorded.whole
    assert Counter(one.identity for one in recorded.records if _is_taken(one)) == Counter(taken)
    judged = Run(fleet.run, SYSTEM).history.judged
    assert [one for one in judged if one.violation or one.verdict == "not judged"] == []


def _is_taken(one: Record) -> TypeGuard[Spoken]:
    return isinstance(one, Spoken) and one.origin is Origin.RECEIVER


def _pid(fleet: RocoFleet) -> int:
    """Of a monitor that is ready; 0 while none is."""
    ready, pid = fleet.run / "monitor.ready", fleet.run / "monitor.pid"
    return int(pid.read_text() or 0) if ready.exists() and pid.exists() else 0


def _said(file: Path) -> list[tuple[float, bytes]]:
    """When each was taken, and its bytes."""
    return [
        (one.received, one.wire) for one in mcap_file.read(file).records if isinstance(one, Spoken)
    ]
