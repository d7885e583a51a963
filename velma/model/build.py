"""Writes robot.xml, Velma alone in MJCF, from the numbers of robot.yaml.

One file serves Pinocchio and MuJoCo: it holds dampings and armatures (so both know the same mass matrix), the
shapes of contacts with their classes and exclusions, the drives and the coupling of the fingers. It has no site:
Pinocchio 4.1 misplaces a site behind a chain of welded bodies, so frames are those of bodies. Knows no scene.

`python -m velma.model.build` writes the file; a test compares the committed one with the output.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import yaml

from velma.model import contacts, looks
from velma.names import FINGERS, SIDES

HERE = Path(__file__).parent
ROBOT_XML = HERE / "robot.xml"

Numbers = Sequence[float]
Tree = Mapping[str, Any]  # as it stands in robot.yaml

# Camera of MuJoCo looks along -z with y up; the optical frame has z forward and y down.
OPTICAL_TO_CAMERA_WXYZ = (0.0, 1.0, 0.0, 0.0)


def text(numbers: Iterable[float]) -> str:
    """Return numbers as MJCF writes them; ten digits, so that both libraries read the same."""
    return " ".join(f"{x:.10g}" for x in numbers)


def quat_wxyz(rpy: Numbers) -> tuple[float, float, float, float]:
    """Return the unit quaternion of R = Rz(yaw) Ry(pitch) Rx(roll), angles in rad."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(a / 2), math.cos(a / 2)) for a in rpy)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def shape(parent: ET.Element, name: str, numbers: Tree, **attributes: str) -> ET.Element:
    """Add a contact shape: `{box: full edges | sphere: radius, xyz, rpy}`."""
    if "box" in numbers:
        kind, size = "box", [edge / 2 for edge in numbers["box"]]
    else:
        kind, size = "sphere", [numbers["sphere"]]
    placed = {"pos": text(numbers["xyz"])}
    if "rpy" in numbers:
        placed["quat"] = text(quat_wxyz(numbers["rpy"]))
    return ET.SubElement(parent, "geom", {"name": name, "type": kind, "size": text(size), **placed, **attributes})


def load() -> Tree:
    """Return the numbers of robot.yaml."""
    tree: Tree = yaml.safe_load((HERE / "robot.yaml").read_text())
    return tree


def bodies(tree: Tree) -> Iterator[dict[str, Any]]:
    """Yield every body of the robot, parents first, with `{side}` filled in and all fingers of the hands."""
    yield from (dict(body, group="trunk") for body in tree["bodies"])
    for side in SIDES:
        yield from (_of_side(body, side, "arm") for body in tree["arm"])
        yield from (_of_side(body, side, "hand") for body in tree["hand"])
        for finger in FINGERS:
            yield from _finger(tree, side, finger)
    yield from (dict(body, group="head") for body in tree["head"])


def _of_side(body: Tree, side: str, group: str) -> dict[str, Any]:
    out = dict(body, group=group)
    out["name"], out["parent"] = body["name"].format(side=side), body["parent"].format(side=side)
    out["at"] = body["at"].get(side, body["at"])
    if "joint" in body:
        out["joint"] = dict(body["joint"], name=body["joint"]["name"].format(side=side))
    return out


def _finger(tree: Tree, side: str, finger: str) -> Iterator[dict[str, Any]]:
    where, parent, at = tree["fingers"][finger], f"{side}_HandPalmLink", tree["knuckle_two"]["at"]
    if "spread" in where:
        turning = dict(tree["knuckle_one"]["joint"], axis=where["spread"]["axis"])
        body = dict(tree["knuckle_one"], joint=turning, at=where["spread"])
        yield _knuckle(body, f"{side}_HandFinger{finger}KnuckleOne", parent)
        parent = f"{side}_HandFinger{finger}KnuckleOneLink"
    else:
        at = where["fixed"]
    yield _knuckle(dict(tree["knuckle_two"], at=at), f"{side}_HandFinger{finger}KnuckleTwo", parent)
    parent = f"{side}_HandFinger{finger}KnuckleTwoLink"
    yield _knuckle(tree["knuckle_three"], f"{side}_HandFinger{finger}KnuckleThree", parent)


def _knuckle(body: Tree, stem: str, parent: str) -> dict[str, Any]:
    joint = dict(body["joint"], name=f"{stem}Joint")
    return dict(body, name=f"{stem}Link", parent=parent, joint=joint, group="finger")


def _armature(tree: Tree, joint: str) -> float:
    numbers = tree["armature"]
    if "_arm_" in joint:
        return float(numbers["arm"][int(joint.split("_")[2])])
    for word, kind in (("torso", "torso"), ("head", "head"), ("KnuckleOne", "spread"), ("Knuckle", "finger")):
        if word in joint:
            return float(numbers[kind])
    raise ValueError(f"joint {joint} has no armature in robot.yaml; its name has none of torso, arm, head, Knuckle")


def _body(elements: dict[str, ET.Element], tree: Tree, body: Tree) -> None:
    name, at = body["name"], body["at"]
    place = {"name": name, "pos": text(at["xyz"]), "quat": text(quat_wxyz(at["rpy"]))}
    element = elements[name] = ET.SubElement(elements[body["parent"]], "body", place)
    if "joint" in body:
        joint = body["joint"]
        ET.SubElement(
            element,
            "joint",
            name=joint["name"],
            axis=text(joint["axis"]),
            range=text(joint["range"]),
            damping=text([joint["damping"]]),
            armature=text([_armature(tree, joint["name"])]),
        )
    if "inertial" in body:
        mass = body["inertial"]
        about = {"mass": text([mass["mass"]]), "fullinertia": text(mass["inertia"])}
        ET.SubElement(element, "inertial", {"pos": text(mass["com"]), **about})
    for k, numbers in enumerate(body.get("shapes", ())):
        shape(element, f"{name}_{k}", numbers, **{"class": contacts.ROBOT_CLASS[body["group"]]})
    if "camera" in body:
        camera = body["camera"]
        width, height = camera["size"]
        fovy = 2 * math.atan(math.tan(camera["hfov"] / 2) * height / width)
        look = {"quat": text(OPTICAL_TO_CAMERA_WXYZ), "fovy": text([math.degrees(fovy)])}
        ET.SubElement(element, "camera", {"name": camera["name"], **look})


def _drives(root: ET.Element, tree: Tree) -> None:
    drives, numbers = ET.SubElement(root, "actuator"), tree["actuators"]

    def motor(joint: str, limit: float) -> None:
        ET.SubElement(drives, "motor", name=joint, joint=joint, ctrlrange=text([-limit, limit]))

    def servo(name: str, joint: str, kind: str) -> None:
        gains = numbers[kind]
        limit = text([-gains["limit"], gains["limit"]])
        gain = {"kp": text([gains["kp"]]), "kv": text([gains["kv"]]), "forcerange": limit}
        ET.SubElement(drives, "position", {"name": name, "joint": joint, **gain})

    motor("torso_0_joint", numbers["torso"])
    for side in SIDES:
        for k, limit in enumerate(numbers["arm"]):
            motor(f"{side}_arm_{k}_joint", limit)
    for joint in ("head_pan_joint", "head_tilt_joint"):
        servo(joint, joint, "head")
    for side in SIDES:
        servo(f"{side}_spread", f"{side}_HandFingerOneKnuckleOneJoint", "spread")
        for finger in FINGERS:
            servo(f"{side}_proximal_{finger}", f"{side}_HandFinger{finger}KnuckleTwoJoint", "proximal")
        for finger in FINGERS:
            servo(f"{side}_distal_{finger}", f"{side}_HandFinger{finger}KnuckleThreeJoint", "distal")


def robot() -> ET.Element:
    """Return the robot as an MJCF tree: compiler, defaults, bodies, contact exclusions, coupling and drives."""
    tree = load()
    root = ET.Element("mujoco", model="velma")
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    contacts.robot_defaults(ET.SubElement(root, "default"), tree["contact"]["hand"])
    elements = {"world": ET.SubElement(root, "worldbody")}
    every = list(bodies(tree))
    for body in every:
        _body(elements, tree, body)
    looks.dress(elements)
    contacts.exclusions(ET.SubElement(root, "contact"), every)
    equality = ET.SubElement(root, "equality")
    for side in SIDES:  # one motor spreads both fingers, the second mirrors the first (BHR axes are opposite)
        one, two = (f"{side}_HandFinger{finger}KnuckleOneJoint" for finger in ("One", "Two"))
        ET.SubElement(equality, "joint", joint1=two, joint2=one, polycoef="0 1 0 0 0")
    _drives(root, tree)
    return root


def written() -> str:
    """Return the text of robot.xml."""
    root = robot()
    ET.indent(root)
    head = "<!-- Written by velma/model/build.py from robot.yaml; change those, not this. -->\n"
    return head + ET.tostring(root, encoding="unicode") + "\n"


def main() -> None:
    """Write robot.xml beside this script."""
    ROBOT_XML.write_text(written())


if __name__ == "__main__":
    main()
