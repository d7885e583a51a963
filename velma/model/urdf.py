"""Velma as URDF, the form in which RViz, Foxglove, MoveIt and most other tools take a robot; made
from robot.xml.

Kinematics, masses, limits, damping, contact shapes and the coupling of the fingers are those of
robot.xml. URDF has no place for armature, for exclusions of contacts, and for capsules and
ellipsoids: a capsule is a cylinder with two spheres, an ellipsoid a pile of discs. The file names
no other file. Links have the names of robot.xml's bodies; the root, torso_base, is the world frame.
"""

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

from msgspec.structs import replace

from velma.model.tree import ROBOT_XML, Four, Link, Shape, Three, from_z, links
from velma.names import BODY, FINGER_SPEED, HEAD, HEAD_SPEED, SPEED

DISCS = 12
"""Discs of an ellipsoid; estimate: steps of 15 mm show that it is one."""
HEAD_LINE = "<!-- Written by velma/model/urdf.py from robot.xml; change robot.yaml, not this. -->\n"


def written(robot_xml: Path = ROBOT_XML) -> str:
    """Return the text of the file."""
    source = ET.parse(robot_xml).getroot()
    every, efforts, followed = links(robot_xml), _efforts(source), _followed(source)
    root = ET.Element("robot", name="velma")
    # MuJoCo else welds links together that are fixed to each other, and forgets their names
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", fusestatic="false")
    seen = dict.fromkeys(shape.rgba for link in every for shape in link.shapes)
    colours = {rgba: f"colour_{k}" for k, rgba in enumerate(seen)}
    for rgba, name in colours.items():
        ET.SubElement(ET.SubElement(root, "material", name=name), "color", rgba=_text(rgba))
    for link in every:
        _link(root, link, colours)
    for link in every:
        if len(link.path) > 1:
            _joint(root, link, efforts, followed)
    ET.indent(root)
    return f'<?xml version="1.0"?>\n{HEAD_LINE}{ET.tostring(root, encoding="unicode")}\n'


def _efforts(source: ET.Element) -> dict[str, float]:
    """Return joint -> torque of its drive [Nm]."""
    bounds = {"motor": "ctrlrange", "position": "forcerange"}
    drives = ((one, one.attrib[bounds[one.tag]].split()) for one in source.findall("actuator/*"))
    return {one.attrib["joint"]: float(highest) for one, (_, highest) in drives}


def _followed(source: ET.Element) -> dict[str, str]:
    """Return joint -> the one it is coupled to, one to one."""
    return {one.attrib["joint1"]: one.attrib["joint2"] for one in source.findall("equality/joint")}


def _link(root: ET.Element, link: Link, colours: dict[tuple[float, ...], str]) -> None:
    element = ET.SubElement(root, "link", name=link.name)
    if (mass := link.mass) is not None:
        inertial = ET.SubElement(element, "inertial")
        ET.SubElement(inertial, "origin", xyz=_text(mass.at))
        ET.SubElement(inertial, "mass", value=_text([mass.kg]))
        names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        words = zip(names, (_text([one]) for one in mass.inertia), strict=True)
        ET.SubElement(inertial, "inertia", dict(words))
    for shape in link.shapes:
        for part in parts(shape):
            visual = _shape(element, "visual", part)
            ET.SubElement(visual, "material", name=colours[shape.rgba])
    for shape in link.contacts:
        _shape(element, "collision", shape)


def _joint(
    root: ET.Element, link: Link, efforts: dict[str, float], followed: dict[str, str]
) -> None:
    kind, name = ("revolute", link.joint) if link.joint else ("fixed", f"{link.name}_fixed")
    element = ET.SubElement(root, "joint", name=name, type=kind)
    _origin(element, link.at, link.quat_wxyz)
    ET.SubElement(element, "parent", link=link.path[-2])
    ET.SubElement(element, "child", link=link.name)
    if not link.joint:
        return
    ET.SubElement(element, "axis", xyz=_text(link.axis))
    lower, upper = link.limits
    leader = followed.get(name)
    most = {"effort": efforts[leader or name], "velocity": _speed(name)}
    numbers = {"lower": lower, "upper": upper, **most}
    ET.SubElement(element, "limit", {key: _text([one]) for key, one in numbers.items()})
    ET.SubElement(element, "dynamics", damping=_text([link.damping]), friction="0")
    if leader is not None:
        ET.SubElement(element, "mimic", joint=leader, multiplier="1", offset="0")


def _speed(joint: str) -> float:
    """Return the largest speed of a joint [rad/s]."""
    if joint in BODY:
        return float(SPEED[BODY.index(joint)])
    return HEAD_SPEED if joint in HEAD else FINGER_SPEED


def _shape(link: ET.Element, tag: str, shape: Shape) -> ET.Element:
    element = ET.SubElement(link, tag)
    _origin(element, shape.at, shape.quat_wxyz)
    geometry = ET.SubElement(element, "geometry")
    if shape.kind == "box":
        ET.SubElement(geometry, "box", size=_text([2 * half for half in shape.size]))
    elif shape.kind == "sphere":
        ET.SubElement(geometry, "sphere", radius=_text(shape.size))
    else:
        radius, length = shape.size
        ET.SubElement(geometry, "cylinder", radius=_text([radius]), length=_text([length]))
    return element


def parts(shape: Shape) -> Iterator[Shape]:
    """Yield the shapes of URDF that make up a look."""
    if shape.kind == "capsule":
        radius, length = shape.size
        yield replace(shape, kind="cylinder")
        for end in (-length / 2, length / 2):
            yield replace(shape, kind="sphere", size=(radius,), at=_along(shape, 2, end))
    elif shape.kind == "ellipsoid":
        yield from _discs(shape)
    else:
        yield shape


def _discs(shape: Shape) -> Iterator[Shape]:
    """Yield the discs of an ellipsoid, across its shortest axis; across that it is round."""
    thin = min(range(3), key=shape.size.__getitem__)
    half = shape.size[thin]
    round_m = math.fsum(size for axis, size in enumerate(shape.size) if axis != thin) / 2
    turn = from_z(*_axis(shape, thin))
    for k in range(DISCS):
        height = (2 * k + 1 - DISCS) / DISCS
        size = (round_m * math.sqrt(1 - height * height), 2 * half / DISCS)
        yield replace(
            shape, kind="cylinder", size=size, at=_along(shape, thin, height * half), quat_wxyz=turn
        )


def _along(shape: Shape, axis: int, way: float) -> Three:
    """The point on an axis of a shape, so far from its centre."""
    x, y, z = (at + way * part for at, part in zip(shape.at, _axis(shape, axis), strict=True))
    return x, y, z


def _axis(shape: Shape, axis: int) -> Three:
    """A shape's x, y or z in the frame of its link."""
    x, y, z = (row[axis] for row in _rotation(shape.quat_wxyz))
    return x, y, z


def _origin(element: ET.Element, at: Three, quat_wxyz: Four) -> None:
    ET.SubElement(element, "origin", xyz=_text(at), rpy=_text(rpy(quat_wxyz)))


def rpy(quat_wxyz: Four) -> Three:
    """Roll, pitch, yaw [rad] with R = Rz(yaw) Ry(pitch) Rx(roll); exact also where pitch is a right
    angle.
    """
    r = _rotation(quat_wxyz)
    roll = math.atan2(r[2][1], r[2][2])
    s, c = math.sin(roll), math.cos(roll)
    yaw = math.atan2(s * r[0][2] - c * r[0][1], c * r[1][1] - s * r[1][2])
    return roll, math.atan2(-r[2][0], math.hypot(r[2][1], r[2][2])), yaw


def _rotation(quat_wxyz: Four) -> tuple[Three, Three, Three]:
    w, x, y, z = quat_wxyz
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def _text(numbers: Iterable[float]) -> str:
    return " ".join(f"{x:.17g}" for x in numbers)
