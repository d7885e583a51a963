"""Velma's links as robot.xml has them: how each stands to its parent, turns, weighs, touches and
looks.

For those who need no simulator. Quaternions have w first; all turning joints of the model are
hinges through their body's origin; the mass of a body stands in its own axes.
"""

import math
from pathlib import Path
from xml.etree import ElementTree as ET

import msgspec

ROBOT_XML = Path(__file__).with_name("robot.xml")
LOOK_CLASS = "look"
Three = tuple[float, float, float]
Four = tuple[float, float, float, float]
GREY: Four = (0.7, 0.7, 0.7, 1.0)


class Shape(msgspec.Struct, frozen=True):
    """Shape on a link: box and ellipsoid with half axes, sphere with radius, capsule and cylinder
    with radius and z length [m].
    """

    kind: str
    size: tuple[float, ...]
    at: Three
    quat_wxyz: Four
    rgba: tuple[float, ...]


class Mass(msgspec.Struct, frozen=True):
    """Mass [kg], its centre [m] and its inertia about that (xx, yy, zz, xy, xz, yz) [kg m2]."""

    kg: float
    at: Three
    inertia: tuple[float, ...]


class Link(msgspec.Struct, frozen=True):
    """A body. `path`: names from the root to it; `joint`: "" where it is fixed to its parent;
    `axis` in its frame; `limits`: lower and upper [rad]; `damping` [Nms/rad]; `shapes` are looked
    at, `contacts` touch.
    """

    name: str
    path: tuple[str, ...]
    at: Three
    quat_wxyz: Four
    joint: str
    axis: Three
    shapes: tuple[Shape, ...]
    contacts: tuple[Shape, ...]
    mass: Mass | None
    limits: tuple[float, ...]
    damping: float


def links(path: Path = ROBOT_XML) -> tuple[Link, ...]:
    """All links, parents before their children."""
    world = ET.parse(path).getroot().find("worldbody")
    assert world is not None
    return tuple(link for body in world.findall("body") for link in _links(body, ()))


def chain(all_links: tuple[Link, ...], name: str) -> tuple[Link, ...]:
    """Links from the root to this one."""
    path = next(link.path for link in all_links if link.name == name)
    return tuple(link for link in all_links if link.path == path[: len(link.path)])


def _links(body: ET.Element, above: tuple[str, ...]) -> list[Link]:
    name = body.attrib["name"]
    joint, inertial = body.find("joint"), body.find("inertial")
    turns = {} if joint is None else joint.attrib
    geoms = [(geom.get("class") == LOOK_CLASS, _shape(geom)) for geom in body.findall("geom")]
    link = Link(
        name=name,
        path=(*above, name),
        at=_three(body.get("pos")),
        quat_wxyz=_turn(body.get("quat")),
        joint=turns.get("name", ""),
        axis=_three(turns.get("axis"), (0.0, 0.0, 1.0)),
        shapes=tuple(shape for looks, shape in geoms if looks),
        contacts=tuple(shape for looks, shape in geoms if not looks),
        mass=None if inertial is None else _mass(inertial),
        limits=_numbers(turns.get("range")),
        damping=float(turns.get("damping", 0.0)),
    )
    return [link, *(below for child in body.findall("body") for below in _links(child, link.path))]


def _mass(inertial: ET.Element) -> Mass:
    inertia = _numbers(inertial.attrib["fullinertia"])
    return Mass(float(inertial.attrib["mass"]), _three(inertial.get("pos")), inertia)


def _shape(geom: ET.Element) -> Shape:
    """`fromto` shapes become centre, length and a turn of z onto their axis."""
    kind, size = geom.attrib["type"], _numbers(geom.get("size"))
    at, quat = _three(geom.get("pos")), _turn(geom.get("quat"))
    if ends := _numbers(geom.get("fromto")):
        a, b = ends[:3], ends[3:]
        length = math.dist(a, b)
        x, y, z = ((end - start) / max(length, 1e-9) for start, end in zip(a, b, strict=True))
        at = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2)
        size, quat = (size[0], length), from_z(x, y, z)
    elif kind in ("capsule", "cylinder"):
        size = (size[0], 2 * size[1])  # MJCF gives half the length
    return Shape(kind, size, at, quat, _four(geom.get("rgba"), GREY))


def from_z(x: float, y: float, z: float) -> Four:
    """The shortest turn that brings z onto a unit vector."""
    if z < -1 + 1e-9:
        return 0.0, 1.0, 0.0, 0.0
    w = math.sqrt((1 + z) / 2)
    return w, -y / (2 * w), x / (2 * w), 0.0


def _numbers(text: str | None) -> tuple[float, ...]:
    return tuple(float(word) for word in text.split()) if text else ()


def _three(text: str | None, default: Three = (0.0, 0.0, 0.0)) -> Three:
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
