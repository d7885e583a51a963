"""The rehearsal leaves no trace, and after it a motion needs no page of a library that was not
needed before.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from services.executor.loop.__main__ import build
from services.executor.loop.memory import Restorable
from services.executor.loop.process import LoopProcess, Speed
from services.executor.loop.rehearsal import rehearse
from velma.model import scene
from velma.sim.backend import Backend
from velma.sim.mock_backend import MockBackend
from velma.sim.mujoco_backend import MujocoBackend

pytestmark = [pytest.mark.process, pytest.mark.timeout(120)]

MOTIONS = """
import sys
from pathlib import Path
import numpy as np
from companion.skills.loop_messages import Close, HeadGoal, Move, Open, Payload, Until, motion
from services.executor.loop.__main__ import build
from services.executor.loop.process import Speed
from services.executor.loop.rehearsal import rehearse
from velma.model import scene
from velma.sim.mujoco_backend import MujocoBackend

def code():
    "Resident kB of each mapping of code."
    found, name = {}, ""
    for line in Path("/proc/self/smaps").read_text().splitlines():
        words = line.split()
        if "-" in words[0] and len(words) >= 5:
            name = f"{words[5]} {words[0]}" if len(words) > 5 and "x" in words[1] else ""
        elif words[0] == "Rss:" and name:
            found[name] = int(words[1])
    return found

def made(path, robot, settle_s=0.4):
    return build(path, robot, speed=Speed.MAX, realtime=False, settle_s=settle_s)

robot, folder = MujocoBackend(scene.load()), Path(sys.argv[1])
if sys.argv[2] == "rehearsed":
    rehearse(folder, robot, lambda path, twin: made(path, twin, 0.0))
loop = made(folder / "loop.slots", robot)
start, u = loop.core.setpoint, np.linspace(0, 1, 100)[:, None]
there = start + 0.4 * u**3 * (10 - 15 * u + 6 * u * u) * np.sign(-start)
close = Close(0.1, upto=1.0, speed=1.0)
before = code()
for asked in (
    motion(
        "there", there, head=HeadGoal(0.2, 0.3), right=Move((0.5, 0.5, 0.5)),
        payload_right=Payload(0.4),
    ),
    motion("back", there[::-1], until=Until.CONTACT, tare="left"),
    motion("close", start, right=close, left=close, until=Until.TOUCH),
    motion("open", start, right=Open(), left=Open()),
):
    loop.core.run(asked)
print(sum(max(0, now - before.get(name, 0)) for name, now in code().items()))
"""


def made(path: Path, robot: Backend) -> LoopProcess:
    return build(path, robot, speed=Speed.MAX, realtime=False, settle_s=0.0)


def grown(folder: Path, how: str) -> int:
    """Code [kB] that motions touch first, in a process of its own."""
    words = [sys.executable, "-P", "-c", MOTIONS, str(folder), how]
    return int(
        subprocess.run(words, capture_output=True, text=True, timeout=100, check=True).stdout
    )


def test_motions_need_no_code_that_the_rehearsal_did_not(tmp_path: Path) -> None:
    """And without it they do."""
    assert grown(tmp_path, "rehearsed") == 0
    assert grown(tmp_path, "at once") > 0


@pytest.mark.parametrize(
    "robot", [MockBackend(), MujocoBackend(scene.load())], ids=["mock", "simulated"]
)
def test_it_leaves_no_trace(robot: Backend, tmp_path: Path) -> None:
    """The robot is as it was, and so is the folder; the rehearsed loop meets no fault but the end
    it is told of.
    """
    loops: list[LoopProcess] = []

    def kept(path: Path, twin: Backend) -> LoopProcess:
        loops.append(made(path, twin))
        return loops[-1]

    before, state = robot.configuration().copy(), robot.observe().q.copy()
    saved = robot.save() if isinstance(robot, Restorable) else b""
    rehearse(tmp_path, robot, kept)
    np.testing.assert_array_equal(robot.configuration(), before)
    np.testing.assert_array_equal(robot.observe().q, state)
    assert (robot.save() if isinstance(robot, Restorable) else b"") == saved
    assert not list(tmp_path.iterdir())
    (loop,) = loops
    assert (loop.core.faults, loop.core.last_fault) == (0, "")
    assert loop.core.cycles > 100
