"""Velma for the eye: links with their looks, and how each stands to its parent, read from
velma/model/robot.xml.

No simulator: the monitor draws, it does not compute dynamics. Quaternions have w
first; all turning joints of the model are hinges through their body's origin.
"""

import math
from pathlib import Path
from xml.etree import ElementTree as ET

import msgspec
import numpy as np
from numpy.typing import NDArray

import velma.model
from companion.languages.values import Pose
from companion.telemetry import RobotState
from companion.world.geometry import compose, product
from velma.names import BODY, DISTAL, HEAD, PROXIMAL, SIDES, SPREAD

Array = NDArray[np.float64]
ROBOT_XML = Path(velma.model.__path__[0]) / "robot.xml"
LOOK = "look"
Four = tuple[float, float, float, float]
GREY: Four = (0.7, 0.7, 0.7, 1.0)


class Shape(msgspec.Struct, frozen=True):
    """Visible shape of a link: box and ellipsoid with half axes, capsule and cylinder with radius
    and z length.
    """

    kind: str
    size: tuple[float, ...]
    at: tuple[float, float, float]
    quat_wxyz: Four
    rgba: tuple[float, ...]


class Link(msgspec.Struct, frozen=True):
    """A body. `path`: names from the root to it; `joint`: "" where it is fixed to its parent;
    `axis` in its frame.
    """

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


def world_frames(all_links: tuple[Link, ...], q: dict[str, float]) -> dict[str, Pose]:
    """Link name -> T_world_link. Joints that `q` leaves out are at 0."""
    frames: dict[str, Pose] = {}
    for link in all_links:
        quat = turned(link, q.get(link.joint, 0.0)) if link.joint else link.quat_wxyz
        local = Pose(link.at, quat)
        frames[link.name] = compose(frames[link.path[-2]], local) if len(link.path) > 1 else local
    return frames


def chain(all_links: tuple[Link, ...], name: str) -> tuple[Link, ...]:
    """Links from the root to this one."""
    path = next(link.path for link in all_links if link.name == name)
    return tuple(link for link in all_links if link.path == path[: len(link.path)])


def _links(body: ET.Element, above: tuple[str, ...]) -> list[Link]:
    name = body.attrib["name"]
    joint = body.find("joint")
    link = Link(
        name=name,
        path=(*above, name),
        at=_three(body.get("pos")),
        quat_wxyz=_turn(body.get("quat")),
        joint=joint.attrib["name"] if joint is not None else "",
        axis=_three(joint.get("axis"), (0.0, 0.0, 1.0)) if joint is not None else (0.0, 0.0, 1.0),
        shapes=tuple(_shape(geom) for geom in body.findall("geom") if geom.get("class") == LOOK),
    )
    return [link, *(below for child in body.findall("body") for below in _links(child, link.path))]


def _shape(geom: ET.Element) -> Shape:
    """A look; `fromto` shapes become centre, length and a turn of z onto their axis."""
    kind, size = geom.attrib["type"], _numbers(geom.get("size"))
    at, quat = _three(geom.get("pos")), _turn(geom.get("quat"))
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


def _three(
    text: str | None, default: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> tuple[float, float, float]:
    numbers = _numbers(text)
    return (numbers[0], numbers[1], numbers[2]) if numbers else default


def _four(text: str | None, default: Four = (1.0, 0.0, 0.0, 0.0)) -> Four:
    numbers = _numbers(text)
    return (numbers[0], numbers[1], numbers[2], numbers[3]) if numbers else default


def _turn(text: str | None) -> Four:
    """A quaternion as MJCF has it, which need not be of length 1."""
    length = math.hypot(*(quat := _four(text)))
    w, x, y, z = (part / length for part in quat)
    return w, x, y, z
