"""What ROS is told of this robot beside what it is told of any system: joints, frames, model,
pictures, things.

Frames have the names of the robot's links, of things, and `world`. Must not know: where messages
go.
"""

from collections.abc import Callable, Iterator
from typing import Any, ClassVar

import numpy as np

from companion.languages import wm
from companion.languages.values import Pose, Vector
from companion.models import KNOWN_AS
from companion.run_files import HELD
from companion.telemetry import Picture, RobotState, TrueState
from companion.tools.pictures import robot, things
from companion.tools.telemetry import PICTURE_FOCAL, PICTURE_SIZE
from companion.tools.verbs.talk import EXECUTOR
from console.fleet.targets import Target
from operate.recording.happenings import Happening
from operate.recording.records import Spoken
from operate.ros.messages import (
    ADD,
    CUBE,
    CYLINDER,
    DELETE_ALL,
    ERROR,
    MARKER,
    MARKERS,
    OK,
    SPHERE,
    SPHERES,
    TRIANGLES,
    WARN,
    Entry,
    Topic,
    diagnosis,
    diagnostics,
    header,
    message,
)
from velma.model import tree, urdf
from velma.names import CAMERA_BODY

WORLD = "world"
BEAT_S = 1.0
"""Between two diagnoses of the control loop."""
UNTURNED = Pose((0.0, 0.0, 0.0))


STRING, TF = "std_msgs/msg/String", "tf2_msgs/msg/TFMessage"
JOINTS, IMAGE = "sensor_msgs/msg/JointState", "sensor_msgs/msg/CompressedImage"
LENS = "sensor_msgs/msg/CameraInfo"


def stopped(fleet: Target) -> str:
    """Stop the robot at once, as `roco stop` does; nothing here lets it go again."""
    fleet.hold(EXECUTOR, True)
    return HELD


class Robot:
    """Remembers which things there are, where they stood last, and whether their truth is told."""

    topics = (
        Topic("/robot_description", STRING, latched=True),
        Topic("/joint_states", JOINTS),
        Topic("/tf", TF),
        Topic("/tf_static", TF, latched=True),
        Topic("/objects", MARKERS, latched=True),
        Topic("/grains", MARKER, latched=True),
        Topic("/camera/image/compressed", IMAGE),
        Topic("/camera/camera_info", LENS),
        Topic("/room/image/compressed", IMAGE),
    )
    services: ClassVar[dict[str, Callable[[Target], str]]] = {"/stop": stopped}

    def __init__(self) -> None:
        self._links = tree.links()
        self._poses: dict[str, Pose] = {}
        self._models: dict[str, str] = {}
        self._true = self._begun = False
        self._grains: tuple[Vector, ...] = ()
        self._missed, self._diagnosed = 0, 0.0

    def take(self, happening: Happening) -> Iterator[Entry]:
        """Yield what is told now."""
        at = happening.at
        if not self._begun:
            self._begun = True
            yield from self._begin(at)
        match happening.what:
            case RobotState() as state:
                yield from self._robot(at, state)
            case TrueState() as truth:
                yield from self._truth(at, truth)
            case Spoken(content=wm.SeenObject() as thing) if not self._true:
                models = self._models | {thing.object: thing.model}
                yield from self._things(at, self._poses | {thing.object: thing.pose}, models)
            case Picture() as picture:
                yield from _pictures(at, picture)

    def _begin(self, at: float) -> Iterator[Entry]:
        """Yield what has no time: the model, and the frames that do not move."""
        model = message(STRING, data=urdf.written())
        yield Entry(at, "/robot_description", STRING, model, latched=True)
        fixed = [
            (link.path[-2] if len(link.path) > 1 else WORLD, link.name, link.at, link.quat_wxyz)
            for link in self._links
            if not link.joint
        ]
        yield _frames(at, fixed, "/tf_static")

    def _robot(self, at: float, state: RobotState) -> Iterator[Entry]:
        q = robot.joints(state)
        empty = np.empty(0)
        told = {"position": np.array([*q.values()]), "velocity": empty, "effort": empty}
        joints = message(JOINTS, header=header(at), name=[*q], **told)
        yield Entry(at, "/joint_states", JOINTS, joints)
        moving = (link for link in self._links if link.joint in q)
        frames = [
            (link.path[-2], link.name, link.at, robot.turned(link, q[link.joint]))
            for link in moving
        ]
        yield _frames(at, frames if self._true else [*frames, *_stood(self._poses)])
        if at - self._diagnosed >= BEAT_S:
            late, missed = state.lateness_us, state.missed - self._missed
            level = ERROR if state.mode == "damping" else WARN if missed else OK
            values = {"late_p50_us": late.p50, "late_p99_us": late.p99, "late_max_us": late.max}
            values |= {"missed": state.missed, "skipped": state.skipped, "faults": state.faults}
            text = f"{state.mode or 'rest'}, {missed} cycles missed since the last diagnosis"
            yield diagnostics(at, diagnosis("loop", level, text, "velma", **values))
            self._missed, self._diagnosed = state.missed, at

    def _truth(self, at: float, truth: TrueState) -> Iterator[Entry]:
        self._true = True
        models = {name: KNOWN_AS.get(kind, kind) for name, kind in truth.models.items()}
        yield from self._things(at, truth.poses, models)
        if truth.grains_at != self._grains:
            self._grains = truth.grains_at
            points = [_point(one) for one in truth.grains_at]
            across = (2 * things.GRAIN_RADIUS,) * 3
            rgba = things.GRAIN_RGBA
            balls = _marker(at, WORLD, "grains", 0, SPHERES, scale=across, rgba=rgba, points=points)
            yield Entry(at, "/grains", MARKER, balls, latched=True)

    def _things(self, at: float, poses: dict[str, Pose], models: dict[str, str]) -> Iterator[Entry]:
        """Yield the frames of all things, also of those that rest: who begins in the middle of a
        bag gets none of before. All looks where other things are there.
        """
        if poses:
            yield _frames(at, _stood(poses))
        if models != self._models:
            looks = [part for name in sorted(models) for part in _parts(at, name, models[name])]
            gone = _marker(at, WORLD, "", 0, CUBE, action=DELETE_ALL)
            array = message(MARKERS, markers=[gone, *looks])
            yield Entry(at, "/objects", MARKERS, array, latched=True)
        self._poses, self._models = poses, models


Frame = tuple[str, str, Vector, tuple[float, float, float, float]]
"""Its parent, its name, where it is in the parent [m], and how it is turned (w first)."""


def _stood(poses: dict[str, Pose]) -> list[Frame]:
    return [(WORLD, name, pose.xyz, pose.quat_wxyz) for name, pose in poses.items()]


def _frames(at: float, frames: list[Frame], topic: str = "/tf") -> Entry:
    one = "geometry_msgs/msg/TransformStamped"
    told = []
    for parent, name, xyz, quat_wxyz in frames:
        way = {"translation": _vector(xyz), "rotation": _turn(quat_wxyz)}
        transform = message("geometry_msgs/msg/Transform", **way)
        place = {"header": header(at, parent), "child_frame_id": name}
        told.append(message(one, **place, transform=transform))
    return Entry(at, topic, TF, message(TF, transforms=told), latched=topic == "/tf_static")


def _parts(at: float, name: str, model: str) -> Iterator[Any]:
    """Yield markers of a thing, in its own frame."""
    found = things.looks(model)
    if found.surface is not None:
        points, faces = things.triangles(found.surface)
        corners = [_point(points[row]) for row in faces.ravel()]
        full = (1.0, 1.0, 1.0)
        yield _marker(at, name, name, 0, TRIANGLES, scale=full, rgba=found.rgba, points=corners)
    for number, shape in enumerate(found.shapes):
        if shape.kind == "cylinder":
            kind, scale = CYLINDER, (2 * shape.size[0], 2 * shape.size[0], shape.size[1])
        else:
            a, b, c = (2 * half for half in shape.size)
            kind, scale = CUBE if shape.kind == "box" else SPHERE, (a, b, c)
        pose = Pose(shape.at, shape.quat_wxyz)
        yield _marker(at, name, name, number, kind, scale=scale, rgba=shape.rgba, pose=pose)


def _marker(
    at: float,
    frame: str,
    space: str,
    number: int,
    kind: int,
    *,
    scale: tuple[float, ...] = (0.0, 0.0, 0.0),
    rgba: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0),
    pose: Pose = UNTURNED,
    points: Any = (),
    action: int = ADD,
) -> Any:
    """A marker that goes with its frame."""
    nothing = np.empty(0, dtype=np.uint8)
    texture = {"header": header(0.0), "format": "", "data": nothing}
    return message(
        MARKER,
        header=header(at, frame),
        ns=space,
        id=number,
        type=kind,
        action=action,
        pose=message(
            "geometry_msgs/msg/Pose",
            position=_point(pose.xyz),
            orientation=_turn(pose.quat_wxyz),
        ),
        scale=_vector(scale),
        color=message("std_msgs/msg/ColorRGBA", **dict(zip("rgba", rgba, strict=True))),
        lifetime=message("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
        frame_locked=True,
        points=list(points),
        colors=[],
        texture_resource="",
        texture=message("sensor_msgs/msg/CompressedImage", **texture),
        uv_coordinates=[],
        text="",
        mesh_resource="",
        mesh_file=message("visualization_msgs/msg/MeshFile", filename="", data=nothing),
        mesh_use_embedded_materials=False,
    )


def _pictures(at: float, picture: Picture) -> Iterator[Entry]:
    """Yield the head camera's picture with its lens, and that of the room."""
    jpegs = {"/camera/image/compressed": picture.jpeg, "/room/image/compressed": picture.room}
    for topic, jpeg in jpegs.items():
        frame = CAMERA_BODY if jpeg is picture.jpeg else WORLD
        data = np.frombuffer(jpeg, dtype=np.uint8)
        image = message(IMAGE, header=header(at, frame), format="jpeg", data=data)
        yield Entry(at, topic, IMAGE, image)
    width, height = PICTURE_SIZE
    k = np.array([[PICTURE_FOCAL, 0.0, width / 2], [0.0, PICTURE_FOCAL, height / 2], [0, 0, 1.0]])
    region = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
    lens = message(
        LENS,
        header=header(at, CAMERA_BODY),
        height=height,
        width=width,
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=k.ravel(),
        r=np.eye(3).ravel(),
        p=np.hstack([k, np.zeros((3, 1))]).ravel(),
        binning_x=0,
        binning_y=0,
        roi=message("sensor_msgs/msg/RegionOfInterest", **region),
    )
    yield Entry(at, "/camera/camera_info", LENS, lens)


def _vector(xyz: Any) -> Any:
    return message("geometry_msgs/msg/Vector3", **dict(zip("xyz", map(float, xyz), strict=True)))


def _point(xyz: Any) -> Any:
    return message("geometry_msgs/msg/Point", **dict(zip("xyz", map(float, xyz), strict=True)))


def _turn(quat_wxyz: tuple[float, ...]) -> Any:
    words = dict(zip("wxyz", quat_wxyz, strict=True))
    return message("geometry_msgs/msg/Quaternion", **words)
