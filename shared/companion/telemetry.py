"""What ex tells people about the robot and, from the simulation, about the truth: no communicates, newest wins.

`RobotState` goes to `DESIGN.house_key("telemetry", owner="ex")`, `TrueState` to the key of kind "truth", both as
msgpack at `RATE_HZ`; only recorders and screens read them, no agent decides by them. Arrays are in the order of
velma.names; poses are in the world frame (torso_base). Must not know: Zenoh, MuJoCo.
"""

import msgspec

from companion.languages.values import Pose, Vector

RATE_HZ = 20.0  # estimate: smooth for eyes; about 1 kB a time


class Lateness(msgspec.Struct, frozen=True):
    """How late cycles of the loop began after their deadlines, or how long they took [us]."""

    p50: float = 0.0
    p99: float = 0.0
    p999: float = 0.0
    max: float = 0.0


class RobotState(msgspec.Struct, frozen=True, omit_defaults=True):
    """The measured robot and what its loop does.

    `body`: 15 joints (velma.names.BODY), `head`: pan, tilt, `spread`: right, left, `proximal` and `distal`: fingers
    one, two, three of the right hand, then of the left [rad]. `act`: key of the act under way, "" for none; `skill`:
    what it is in a word. `work_J`: work of the body joints since the start. `lateness_us` is all zeros where nothing
    paces the loop (it runs as fast as it can); `realtime`: it has the kernel's real-time priority.
    """

    sim_time_s: float
    body: tuple[float, ...]
    head: tuple[float, float] = (0.0, 0.0)
    spread: tuple[float, float] = (0.0, 0.0)
    proximal: tuple[float, ...] = (0.0,) * 6
    distal: tuple[float, ...] = (0.0,) * 6
    mode: str = ""
    act: str = ""
    skill: str = ""
    work_J: float = 0.0
    cycles: int = 0
    missed: int = 0
    skipped: int = 0
    lateness_us: Lateness = Lateness()
    compute_us: Lateness = Lateness()
    realtime: bool = False
    faults: int = 0
    last_fault: str = ""


class TrueState(msgspec.Struct, frozen=True, omit_defaults=True):
    """What is truly so in the simulation; the fields are those of velma.sim.truth.Truth.

    `grains_in`, `tilt_deg`, `at` by vessel id: grains inside, angle between axis and vertical, origin [m].
    `fingers_on`: vessel id -> side -> number of links of that hand that touch it. `poses` of all things by id,
    furniture too, and `models`: thing id -> kind (velma.model.scene.Model); `grains_at`: centres of the grains [m].
    These three are for pictures.
    """

    time_s: float
    grains: int = 0
    grains_in: dict[str, int] = {}
    tilt_deg: dict[str, float] = {}
    at: dict[str, Vector] = {}
    fingers_on: dict[str, dict[str, int]] = {}
    furniture_touched: bool = False
    work_J: float = 0.0
    poses: dict[str, Pose] = {}
    models: dict[str, str] = {}
    grains_at: tuple[Vector, ...] = ()
