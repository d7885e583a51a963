"""Velma for the eye: links with their looks, and how each stands to its parent, read from velma/model/robot.xml.

Numpy alone, no simulator: the monitor draws, it does not compute dynamics. Quaternions have w first; all turning joints
of the model are hinges through their body's origin.
"""

import math
from itertools import groupby
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import msgspec
import numpy as np
import rerun as rr
from numpy.typing import NDArray

import velma.model
from companion.languages.values import Pose
from companion.quaternions import product
from companion.telemetry import RobotState
from companion.tools.pictures import robot
from operate.pictures.colours import AXES
from operate.pictures.happenings import Happening
from operate.pictures.sheet import Sheet, transforms
from velma.names import BODY, DISTAL, GRIP_BODY, HEAD, PROXIMAL, SIDES, SPREAD, START

Array = NDArray[np.float64]
ROBOT_XML = Path(velma.model.__path__[0]) / "robot.xml"
LOOK = "look"
Four = tuple[float, float, float, float]
GREY: Four = (0.7, 0.7, 0.7, 1.0)


class Shape(msgspec.Struct, frozen=True):
    """Visible shape of a link: box and ellipsoid with half axes, capsule and cylinder with radius and z length."""

    kind: str
    size: tuple[float, ...]
    at: tuple[float, float, float]
    quat_wxyz: tuple[float, float, float, float]
    rgba: tuple[float, float, float, float]


class Link(msgspec.Struct, frozen=True):
    """A body. `path`: names from the root to it; `joint`: "" where it is fixed to its parent; `axis` in its frame."""

    name: str
    path: tuple[str, ...]
    at: tuple[float, float, float]
    quat_wxyz: tuple[float, float, float, float]
    joint: str
    axis: tuple[float, float, float]
    shapes: tuple[Shape, ...]


def links(path: Path = ROBOT_XML) -> tuple[Link, ...]:
    """All links, parents before their children."""
    world = ET.parse(path).getroot().find("worldbody")
    assert world is not None
    return tuple(link for body in world.findall("body") for link in _links(body, ()))


def joints(state: RobotState) -> dict[str, float]:
    """Joint name -> position [rad] of a telemetry record; what it does not carry is left out."""
    found = dict(zip((*BODY, *HEAD), (*state.body, *state.head), strict=False))
    for row, side in enumerate(SIDES):
        found |= dict(zip(PROXIMAL[side], state.proximal[3 * row :], strict=False))
        found |= dict(zip(DISTAL[side], state.distal[3 * row :], strict=False))
        found |= dict.fromkeys(SPREAD[side], state.spread[row])
    return found


def turned(link: Link, q: float) -> Four:
    """Quaternion of a link in its parent's frame, w first, at joint position `q` [rad]."""
    x, y, z = link.axis
    length = math.sqrt(x * x + y * y + z * z)
    s = math.sin(q / 2) / length
    return product(link.quat_wxyz, (math.cos(q / 2), s * x, s * y, s * z))


def world_frames(all_links: tuple[Link, ...], q: dict[str, float]) -> dict[str, Array]:
    """Link name -> T_world_link (4, 4). Joints that `q` leaves out are at 0."""
    frames: dict[str, Array] = {}
    for link in all_links:
        quat = turned(link, q.get(link.joint, 0.0)) if link.joint else link.quat_wxyz
        local = np.eye(4)
        local[:3, :3], local[:3, 3] = matrix(quat), link.at
        above = frames[link.path[-2]] if len(link.path) > 1 else np.eye(4)
        frames[link.name] = above @ local
    return frames


def chain(all_links: tuple[Link, ...], name: str) -> tuple[Link, ...]:
    """Links from the root to this one."""
    path = next(link.path for link in all_links if link.name == name)
    return tuple(link for link in all_links if link.path == path[: len(link.path)])


def frame(pose: Pose) -> Array:
    """a pose as a matrix (4, 4)."""
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = matrix(pose.quat_wxyz), pose.xyz
    return found


def pose(frame: Array) -> Pose:
    """a matrix (4, 4) as a pose; the turn is the eigenvector of Bar-Itzhack's symmetric matrix (2000)."""
    (a, b, c), (d, e, f), (g, h, i) = frame[:3, :3]
    symmetric = (
        (a + e + i, h - f, c - g, d - b),
        (h - f, a - e - i, b + d, c + g),
        (c - g, b + d, e - a - i, f + h),
        (d - b, c + g, f + h, i - a - e),
    )
    w, x, y, z = np.linalg.eigh(np.array(symmetric))[1][:, -1].tolist()
    at = frame[:3, 3].tolist()
    return Pose((at[0], at[1], at[2]), (w, x, y, z))


def matrix(quat_wxyz: Four) -> Array:
    """The rotation (3, 3) of a quaternion."""
    w, x, y, z = quat_wxyz
    length = math.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / length, x / length, y / length, z / length
    return np.array(
        (
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )
    )


def _links(body: ET.Element, above: tuple[str, ...]) -> list[Link]:
    name = body.attrib["name"]
    joint = body.find("joint")
    link = Link(
        name=name,
        path=(*above, name),
        at=_three(body.get("pos")),
        quat_wxyz=_four(body.get("quat")),
        joint=joint.attrib["name"] if joint is not None else "",
        axis=_three(joint.get("axis"), (0.0, 0.0, 1.0)) if joint is not None else (0.0, 0.0, 1.0),
        shapes=tuple(_shape(geom) for geom in body.findall("geom") if geom.get("class") == LOOK),
    )
    return [link, *(below for child in body.findall("body") for below in _links(child, link.path))]


def _shape(geom: ET.Element) -> Shape:
    """A look; `fromto` shapes become centre, length and a turn of z onto their axis."""
    kind, size = geom.attrib["type"], _numbers(geom.get("size"))
    at, quat = _three(geom.get("pos")), _four(geom.get("quat"))
    if ends := _numbers(geom.get("fromto")):
        a, b = np.array(ends[:3]), np.array(ends[3:])
        length = float(np.linalg.norm(b - a))
        size, at, quat = (size[0], length), tuple((a + b) / 2), _from_z((b - a) / max(length, 1e-9))
    elif kind in ("capsule", "cylinder"):
        size = (size[0], 2 * size[1])  # MJCF gives half the length
    return Shape(kind, size, at, quat, _four(geom.get("rgba"), GREY))


def _from_z(direction: Array) -> tuple[float, float, float, float]:
    """The shortest turn that brings z onto a unit vector."""
    x, y, z = direction
    if z < -1 + 1e-9:
        return 0.0, 1.0, 0.0, 0.0
    w = math.sqrt((1 + z) / 2)
    return w, float(-y / (2 * w)), float(x / (2 * w)), 0.0


def _numbers(text: str | None) -> tuple[float, ...]:
    return tuple(float(word) for word in text.split()) if text else ()


def _three(text: str | None, default: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[float, float, float]:
    numbers = _numbers(text)
    return (numbers[0], numbers[1], numbers[2]) if numbers else default


def _four(text: str | None, default: Four = (1.0, 0.0, 0.0, 0.0)) -> Four:
    numbers = _numbers(text)
    return (numbers[0], numbers[1], numbers[2], numbers[3]) if numbers else default


# --- Velma in 3D: links with their looks, grip frames, and how each joint turns ---------------------------------------


VELMA = "world/velma"
STILL_RAD = 1e-4
"""A joint that turned less is not drawn again; estimate: 0.1 mm at an arm's length."""
AXIS_M = 0.06
"""Length of a drawn axis; estimate."""
FLOOR = rr.Boxes3D(
    centers=[(0.5, 0.0, -0.01)], half_sizes=[(2.2, 2.2, 0.01)], colors=[(222, 226, 230)], fill_mode="solid"
)


class Velma:
    """Draws what telemetry says of the robot."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet = sheet
        self._last: dict[str, float] = {}
        self._moving = [link for link in robot.links() if link.joint]
        self._entities = {link.name: entity(link) for link in self._moving}
        sheet.static("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        sheet.static("world/floor", FLOOR)
        for link in robot.links():
            shaped(sheet, link)
            placed(sheet, link)
            if link.name in GRIP_BODY.values():
                sheet.static(f"{entity(link)}/frame", axes())
        start = dict(zip(BODY, START.tolist(), strict=True))
        for link in self._moving:  # until the first telemetry, which may be late: the arms hang down
            turned = (link.at, robot.turned(link, start.get(link.joint, 0.0)))
            sheet.add(self._entities[link.name], transforms, sheet.begin, turned)

    def take(self, happening: Happening) -> None:
        """Turn the joints that moved."""
        state = happening.what
        if not isinstance(state, RobotState):
            return
        q = robot.joints(state)
        for link in self._moving:
            now = q.get(link.joint, 0.0)
            if link.joint not in self._last or abs(now - self._last[link.joint]) > STILL_RAD:
                self._last[link.joint] = now
                turned = (link.at, robot.turned(link, now))
                self._sheet.add(self._entities[link.name], transforms, happening.at, turned, state.sim_time_s)


def axes(length: float = AXIS_M) -> rr.Arrows3D:
    """x red, y green, z blue."""
    return rr.Arrows3D(vectors=np.eye(3) * length, colors=AXES, radii=0.0025)


def entity(link: robot.Link, root: str = VELMA) -> str:
    """The path of a link in Rerun."""
    return "/".join((root, *link.path))


def placed(sheet: Sheet, link: robot.Link, root: str = VELMA) -> None:
    """Draw how a link that does not move stands to its parent."""
    if not link.joint:
        turn = rr.Quaternion(xyzw=xyzw(link.quat_wxyz))
        sheet.static(entity(link, root), rr.Transform3D(translation=link.at, quaternion=turn))


def shaped(sheet: Sheet, link: robot.Link, root: str = VELMA, rgba: robot.Four | None = None) -> None:
    """Draw the shapes of a link. `rgba`: of all of them, 0 to 1; None: each has its own."""
    for kind, some in groupby(sorted(link.shapes, key=lambda s: s.kind), key=lambda s: s.kind):
        shapes = [msgspec.structs.replace(shape, rgba=rgba or shape.rgba) for shape in some]
        sheet.static(f"{entity(link, root)}/{kind}", _drawn(kind, shapes))


def _drawn(kind: str, shapes: list[robot.Shape]) -> rr.AsComponents:
    """The shapes of one kind on a link, in one batch."""
    at, turn = [s.at for s in shapes], [xyzw(s.quat_wxyz) for s in shapes]
    look: dict[str, Any] = {"colors": [s.rgba for s in shapes], "quaternions": turn, "fill_mode": "solid"}
    if kind == "box":
        return rr.Boxes3D(half_sizes=[s.size for s in shapes], centers=at, **look)
    if kind == "ellipsoid":
        return rr.Ellipsoids3D(half_sizes=[s.size for s in shapes], centers=at, **look)
    radii, lengths = [s.size[0] for s in shapes], [s.size[1] for s in shapes]
    if kind == "cylinder":
        return rr.Cylinders3D(lengths=lengths, radii=radii, centers=at, **look)
    # A capsule of Rerun begins at its origin; ours are given by their centres.
    starts = [np.array(s.at) - robot.matrix(s.quat_wxyz)[:, 2] * s.size[1] / 2 for s in shapes]
    return rr.Capsules3D(lengths=lengths, radii=radii, translations=starts, **look)


def xyzw(quat_wxyz: tuple[float, ...]) -> tuple[float, float, float, float]:
    """Rerun has w last."""
    w, x, y, z = quat_wxyz
    return x, y, z, w
