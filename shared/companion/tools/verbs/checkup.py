"""Checks of `roco doctor` for this robot: libraries, whether real time can be held, a_hi."""

import contextlib
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import msgspec

from companion.run_files import SLOTS_FILE
from companion.tools.system import LOOP
from companion.tools.verbs.hi import HI, tasks
from console.errors import ConsoleError
from console.fleet import checkup
from console.fleet.checkup import Check, Checks, Level
from console.fleet.local import Local
from console.fleet.process_status import Look
from console.fleet.status import GRPC, WEB
from console.fleet.targets import Target
from console.runs import folders
from velma import compiled
from velma.errors import GlError
from velma.sim import gl

# --- Whether this machine holds the control loop's 500 Hz with what runs now ----------------------
# Measured in a process of its own: a second of the loop, or some seconds of one that runs.


PACE = "services.executor.loop.pace"
WITHIN_S = 30.0  # estimate: it takes 3 s at a load of 5 on two cores


class Pace(msgspec.Struct, frozen=True):
    """Periods of the loop, those in which a cycle was late or left out, and whether that is real
    time.

    `realtime`: the loop has the kernel's real-time priority.
    """

    periods: int
    late: int
    held: bool
    realtime: bool = True

    @property
    def sentence(self) -> str:
        """For a person, without a full stop."""
        late = 100 * self.late / max(1, self.periods)
        return f"{late:.0f} % of the control loop's cycles are late here now"


def measure(slots: Path | None = None) -> Pace | None:
    """The pace now: of a loop that runs, by its slot file, or else of one that is tried out.

    None where it cannot be measured: the executor's libraries are not installed, or the loop keeps
    no real time.
    """
    command = [sys.executable, "-P", "-m", PACE, *([str(slots)] if slots else [])]
    with contextlib.suppress(OSError, subprocess.SubprocessError, msgspec.DecodeError):
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, timeout=WITHIN_S, check=True
        )
        found = msgspec.json.decode(done.stdout, type=Pace)
        return found if found.periods else None
    return None


# --- Whether a real robot stands behind the executor: then `roco fault` leaves the fleet alone ----


BACKEND = "ROCO_BACKEND"
HARMLESS = ("", "mujoco", "mock")
"""Back-ends that move nothing; "" is mujoco (services.executor.loop)."""


def untouchable(fleet: Target) -> str:
    """Why no fault may be done to this fleet; "" where its robot is a simulated one."""
    backend = fleet.variable(LOOP, BACKEND)
    return "" if backend in HARMLESS else f"the back-end {backend} may move a real robot"


# --- Checks of `roco doctor` for this robot -------------------------------------------------------


NEEDED = (*checkup.NEEDED, "knowledge", "planner", "executor")
"""The extras that the whole fleet on one machine needs."""
IMPORTS = (*checkup.IMPORTS, "pinocchio", "coal", "ompl", "mujoco", "cv2")
"""Libraries with parts that are not Python: installed is not yet loadable."""
MEMORY = 1 << 30
"""Bytes that the fleet uses: 975 MiB resident before its first task (measured 2026-11-21)."""


def person(fleet: Target, now: Look) -> Iterator[Check]:
    """Whether a_hi answers."""
    if not any(one.name == HI and one.status.pid for one in now.seen):
        return
    try:
        count = len(tasks(fleet))
        yield Check("hi", Level.FINE, f"answers; {count} task{'s' * (count != 1)} so far")
    except ConsoleError as error:
        yield Check("hi", Level.WRONG, str(error), "`roco agent restart hi`")


def real_time() -> Iterator[Check]:
    """Whether the loop would hold 500 Hz with what runs now.

    Tried out only where no fleet runs here: its own loop would be in the way, and is looked at
    instead.
    """
    if not folders.living_here():
        yield from _paced(
            measure(), "end other programs, or start with `--speed max`, which needs no real time"
        )


def loop(fleet: Target, now: Look) -> Iterator[Check]:
    """Whether the loop of a fleet on this machine holds 500 Hz; nothing of one at `--speed max`."""
    if isinstance(fleet, Local) and any(one.name == LOOP and one.status.pid for one in now.seen):
        remedy = (
            "end other programs, or `roco down` and `roco up --speed max`, which needs no real time"
        )
        yield from _paced(measure(fleet.run / SLOTS_FILE), remedy)


def _paced(measured: Pace | None, remedy: str) -> Iterator[Check]:
    """Yield the checks of the measured pace and of the loop's real-time priority; nothing without a
    measurement.
    """
    if measured is None:
        return
    if measured.held:
        yield Check("real time", Level.FINE, f"{measured.sentence}: real time is held")
    else:
        yield Check(
            "real time", Level.WRONG, f"{measured.sentence}: real time cannot be held", remedy
        )
    if not measured.realtime:
        right = (
            "for a real robot or a busy machine: rtprio, memlock in limits.conf(5), or"
            " deploy/compose.rt.yaml"
        )
        yield Check(
            "priority", Level.NOTE, "the loop gets no real-time priority: it runs without", right
        )


def opengl() -> Iterator[Check]:
    """Whether the head camera's pictures can be drawn here."""
    try:
        yield Check("OpenGL", Level.FINE, f"{gl.required()} draws without a display")
    except GlError as error:
        lost = f"{error.why}: no pictures of the head camera, no eyes by pixels"
        yield Check("OpenGL", Level.NOTE, lost, error.REMEDY)


def library() -> Iterator[Check]:
    """Whether the hot loops of planner and control loop run in C here."""
    what = "collision checks, inverse kinematics and the torque law run in C"
    slow = "planning takes twice as long"
    yield from checkup.in_c("compiled", compiled.library(), "velma.compiled", what, slow)


CHECKS = Checks(
    machine={
        "libraries": partial(checkup.libraries, NEEDED),
        "imports": partial(checkup.imports, IMPORTS),
        "ports": partial(checkup.loopback, (GRPC, WEB, "ROCO_HTTP", "ROCO_PAGE")),
        "memory": partial(checkup.memory, MEMORY),
        "OpenGL": opengl,
        "compiled": library,
        "real time": real_time,
    },
    fleet={"hi": person, "real time": loop},
)
