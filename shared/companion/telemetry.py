"""Telemetry of ex for people about the robot and, from the simulation, the truth; not communicates,
newest wins.

`RobotState` goes to `DESIGN.signal_key("telemetry", owner="ex")`, `TrueState` to the key of kind
"truth", both as msgpack, at `RATE_HZ` while anything changes and twice a second while nothing does.
A `Picture` goes to the first key, too, at most once in `PICTURE_S`, told apart by its tag: who
knows `RobotState` only finds fields missing. A `Frame` goes to the key of kind "frame", for the
page alone, as long as its `Watch` on the key of kind "watch" is younger than `WATCHED_S`. Only
recorders and screens read them, no agent decides by them. Arrays are in the order of velma.names;
poses are in the world frame (torso_base). Must not know: Zenoh, MuJoCo.
"""

from enum import StrEnum

import msgspec

from companion.languages.values import Pose, Vector

RATE_HZ = 20.0  # estimate: smooth for eyes; about 1 kB a time

PICTURE_S = 1.0  # estimate: enough to see what the robot looks at; 30 kB a time (measured)
FRAME_S = 0.2
"""Between two frames of a picture that somebody watches, while anything moves; at rest one says
once in PICTURE_S that the last one is still true. Estimate: a person sees motion, and a rendering
takes a quarter of it.
"""
ASK_S, WATCHED_S = 1.0, 3.5
"""Between two words of a page in which people watch, and how long one of them holds: two may be
lost.
"""


class Lateness(msgspec.Struct, frozen=True):
    """Lateness of the loop's cycles after their deadlines, or their duration [us]."""

    p50: float = 0.0
    p99: float = 0.0
    p999: float = 0.0
    max: float = 0.0


class PageFaults(msgspec.Struct, frozen=True):
    """Page faults of the loop during motions: the page was in memory (`minor`), or had to be read
    (`major`).

    `late`: missed cycles with a major one.
    """

    minor: int = 0
    major: int = 0
    late: int = 0


class RobotState(msgspec.Struct, frozen=True, omit_defaults=True):
    """The measured robot and what its loop does.

    `body`: 15 joints (velma.names.BODY), `head`: pan, tilt, `spread`: right, left, `proximal` and
    `distal`: fingers one, two, three of the right hand, then of the left [rad]. `act`: key of the
    act under way, "" for none; `skill`: what it is in a word. `work_J`: work of the body joints
    since the start. `lateness_us` is all zeros where nothing paces the loop (it runs as fast as it
    can); `realtime`: it has the kernel's real-time priority. `saturated`: cycles whose torque was
    cut to what the robot accepts.
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
    saturated: int = 0
    page_faults: PageFaults = PageFaults()


class Contact(msgspec.Struct, frozen=True, array_like=True):
    """Contact of the robot with a thing [m] and the force on the thing [N], both in the world
    frame.
    """

    at: Vector
    force_N: Vector


class TrueState(msgspec.Struct, frozen=True, omit_defaults=True):
    """True state of the simulation; the fields are those of velma.sim.truth.Truth.

    `grains_in`, `tilt_deg`, `at` by vessel id: grains inside, angle between axis and vertical,
    origin [m]. `fingers_on`: vessel id -> side -> number of links of that hand that touch it.
    `poses` of all things by id, furniture too, and `models`: thing id -> kind
    (velma.model.kinds.Model); `grains_at`: centres of the grains [m]. These three are for pictures,
    and so are: `contacts` of the robot with things; `torque_Nm` of the drives of the body
    (velma.names.BODY), the arms' own weight in it; `wrench` by side: force [N] and torque [Nm] of
    the arm on the hand and what it holds, in the frame of the sensor in the wrist: at rest it
    carries their weight.
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
    contacts: tuple[Contact, ...] = ()
    torque_Nm: tuple[float, ...] = ()
    wrench: dict[str, tuple[float, ...]] = {}


class Found(msgspec.Struct, frozen=True, array_like=True):
    """A marker that was found in a picture: the thing it is on, its number, x and y of its four
    corners, in pixels from the picture's upper left corner.
    """

    thing: str
    number: int
    corners: tuple[float, float, float, float, float, float, float, float]


class Picture(msgspec.Struct, frozen=True, tag=True, omit_defaults=True):
    """A state of the simulation in pictures, as JPEG files: `jpeg` by the head camera, `room` from
    a place in the room.

    `markers`: those that the eyes find in the first one at full size and with the camera's noise,
    which it is without.
    """

    sim_time_s: float
    jpeg: bytes
    room: bytes
    markers: tuple[Found, ...] = ()


class Camera(StrEnum):
    """Whose picture: of the camera on the robot's head, or of one in the room."""

    HEAD = "picture"
    ROOM = "room"


class Watch(msgspec.Struct, frozen=True):
    """From a page to ex: people look at the pictures, at those of `large` as they move.

    `had`: number of the newest frame that the page has of each camera.
    """

    large: tuple[Camera, ...] = ()
    had: dict[Camera, int] = {}


class Frame(msgspec.Struct, frozen=True):
    """A picture as a JPEG file, `age_s` after the state that it shows; without a file: so long ago
    the picture of this `number` was still what the camera saw.
    """

    camera: Camera
    number: int
    age_s: float
    jpeg: bytes = b""


class _Tagged(msgspec.Struct):
    type: str = ""


_tagged = msgspec.msgpack.Decoder(_Tagged)
_decoders: dict[str, msgspec.msgpack.Decoder[RobotState] | msgspec.msgpack.Decoder[Picture]] = {
    "": msgspec.msgpack.Decoder(RobotState),
    Picture.__name__: msgspec.msgpack.Decoder(Picture),
}


def decoded(data: bytes) -> RobotState | Picture:
    """What stands on the key of telemetry. Raises msgspec.MsgspecError for anything else."""
    tag = _tagged.decode(data).type
    if tag not in _decoders:
        raise msgspec.ValidationError(
            f"telemetry of type {tag!r}; there are {', '.join(map(repr, _decoders))}"
        )
    return _decoders[tag].decode(data)
