"""Writes robot.xml, Velma alone in MJCF, from the numbers of robot.yaml.

One file serves Pinocchio and MuJoCo: it holds dampings and armatures (so both know the same mass
matrix), the shapes of contacts with their classes and exclusions, the drives and the coupling of
the fingers. It has no site: Pinocchio 4.1 misplaces a site behind a chain of welded bodies, so
frames are those of bodies. Knows no scene.

`python -m velma.model.build` writes the file; a test compares the committed one with the output.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from enum import IntFlag
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import yaml

from velma.model.tree import LOOK_CLASS, ROBOT_XML
from velma.names import FINGERS, SIDES

# --- Which bodies can collide, as classes of geoms and excluded pairs -----------------------------
# Classes are bit masks: two geoms are compared if the contype of one has a bit of the conaffinity
# of the other. Grains never touch the robot, since each would cost a contact island. The inside of
# the jar is a separate ring that only grains touch: on a jar of plates the hand would slip at the
# edges.


class Kind(IntFlag):
    """Class of a geom, one bit each."""

    WORLD = 1
    ARM = 2
    HAND = 4
    OBJECT = 8
    GRAIN = 16
    INNER = 32


ROBOT_CLASS = {"trunk": "arm", "arm": "arm", "head": "arm", "hand": "hand", "finger": "finger"}

# Renderers show groups 0 to 2 by default; visual shapes are drawn in place of contact shapes.
SHAPE_GROUP, LOOK_GROUP = "3", "1"

# Shapes of forearm and hand overlap at their joint; pairs of a chain this close are never compared.
# From two links further on the wrist can turn the hand into the forearm, and they are compared.
ARM_REACH, MOUNT_REACH, PALM_REACH, FINGER_REACH = 3, 4, 3, 2


def masks(kind: Kind, meets: Kind) -> dict[str, str]:
    """Return the two masks of a class of geoms."""
    return {"contype": str(int(kind)), "conaffinity": str(int(meets))}


def robot_defaults(default: ET.Element, hand: Mapping[str, Any]) -> None:
    """Classes of the robot's geoms; `hand` holds the contact numbers of robot.yaml."""
    meets = Kind.WORLD | Kind.ARM | Kind.HAND | Kind.OBJECT
    add_class(default, "arm", group=SHAPE_GROUP, mass="0", **masks(Kind.ARM, meets))
    grip = {key: _text(one if isinstance(one, list) else [one]) for key, one in hand.items()}
    for name in ("hand", "finger"):
        add_class(default, name, group=SHAPE_GROUP, mass="0", **masks(Kind.HAND, meets), **grip)
    add_class(default, LOOK_CLASS, group=LOOK_GROUP, mass="0", **masks(Kind(0), Kind(0)))


def add_class(default: ET.Element, name: str, **attributes: str) -> None:
    """Add a class of geoms."""
    ET.SubElement(ET.SubElement(default, "default", {"class": name}), "geom", attributes)


def exclusions(contact: ET.Element, bodies: Sequence[Mapping[str, Any]]) -> None:
    """Add pairs that touch by construction: neighbours in a chain, a hand and itself, torso and
    shoulders.
    """
    parent = {body["name"]: body["parent"] for body in bodies}
    shaped = [body for body in bodies if "shapes" in body]
    pairs: dict[tuple[str, str], None] = {}
    for body in shaped:
        for other in shaped:
            a, b = body["name"], other["name"]
            if (
                a != b
                and (b, a) not in pairs
                and (_joined(body, other, parent) or _one_hand(body, other))
            ):
                pairs[a, b] = None
    for side in ("right", "left"):
        pairs[f"{side}_arm_1_link", "torso_link0"] = pairs[f"{side}_arm_2_link", "torso_link0"] = (
            None
        )
    pairs["head_tilt_link", "torso_link0"] = None
    for a, b in pairs:
        ET.SubElement(contact, "exclude", body1=a, body2=b)


def _reach(body: Mapping[str, Any]) -> tuple[str, int]:
    """Return the body from which the distance along the chain counts, and how far it goes."""
    name, group = body["name"], body["group"]
    side = name.split("_")[0]
    if group == "finger":
        return f"{side}_arm_7_link", FINGER_REACH
    if group == "hand":
        return f"{side}_arm_7_link", MOUNT_REACH if "mount" in name else PALM_REACH
    return name, ARM_REACH


def _joined(body: Mapping[str, Any], other: Mapping[str, Any], parent: Mapping[str, str]) -> bool:
    above, reach = _reach(body)
    chain = [above] if above != body["name"] else []
    while above in parent and len(chain) < reach:
        above = parent[above]
        chain.append(above)
    return other["name"] in chain


def _one_hand(body: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    groups = {body["group"], other["group"]}
    return (
        groups <= {"hand", "finger"} and body["name"].split("_")[0] == other["name"].split("_")[0]
    )


# --- The visual shapes of Velma, in a group of their own, without mass and contact ----------------
# Drawn after the proportions of the robot: a white torso on a dark base, two light arms with orange
# joints, dark hands with light fingers, a head with a wide sensor bar. Lengths are those of the
# kinematic tree, the rest is design.


Point = tuple[float, float, float]

SHELL = (0.91, 0.91, 0.89, 1.0)
JOINT = (0.90, 0.45, 0.14, 1.0)
DARK = (0.20, 0.21, 0.24, 1.0)
METAL = (0.66, 0.68, 0.71, 1.0)
LENS = (0.05, 0.10, 0.22, 1.0)
Colour = tuple[float, float, float, float]


class Look(NamedTuple):
    """A shape on a body: capsules and cylinders between two points, ellipsoids and boxes by centre
    and half axes.
    """

    kind: str
    size: Sequence[float]
    colour: Colour
    start: Point
    end: Point | None = None


def rod(start: Point, end: Point, radius: float, colour: Colour, kind: str = "capsule") -> Look:
    """Return a capsule or cylinder between two points."""
    return Look(kind, (radius,), colour, start, end)


# Links of an arm from its shoulder: how far each reaches along z [m], and the radii of both ends of
# its shell.
_ARM_SHELLS = {1: (0.13, 0.062), 2: (0.15, 0.060), 3: (0.15, 0.059), 4: (0.15, 0.057),
               5: (0.14, 0.055)}  # fmt: skip
_TURNING_ABOUT_Y = (2, 4, 6)


def _arm(link: int) -> list[Look]:
    out = []
    if link in _ARM_SHELLS:
        length, radius = _ARM_SHELLS[link]
        low = 0.045 if link in _TURNING_ABOUT_Y else 0.0
        out.append(rod((0, 0, low), (0, 0, length), radius, SHELL))
    if link in _TURNING_ABOUT_Y:
        half, radius = (0.066, 0.060) if link < 6 else (0.058, 0.066)
        out.append(rod((0, -half, 0), (0, half, 0), radius, JOINT, "cylinder"))
        for y in (-half, half):
            out.append(rod((0, y - 0.004, 0), (0, y + 0.004, 0), 0.85 * radius, SHELL, "cylinder"))
    return out


_PALM = [
    rod((0, 0, -0.002), (0, 0, 0.05), 0.043, DARK, "cylinder"),
    Look("box", (0.045, 0.027, 0.014), DARK, (0, 0, 0.062)),
    Look("box", (0.014, 0.03, 0.016), DARK, (0, -0.032, 0.06)),
    rod((0, -0.05, 0.07), (0, -0.05, 0.078), 0.019, METAL),
]
_MOUNT = [
    rod((0, 0, 0.0), (0, 0, 0.035), 0.056, METAL, "cylinder"),
    rod((0.0, 0, 0.022), (0.075, 0, 0.008), 0.026, DARK),
    rod((0.075, 0, 0.008), (0.1, 0, -0.035), 0.026, DARK),
    Look("box", (0.008, 0.04, 0.046), METAL, (0.1035, 0, -0.076)),
]
_KNUCKLES = {
    "One": [
        rod((0, 0, 0.002), (0.048, 0, 0.002), 0.0155, METAL),
        rod((0.05, 0, 0.0), (0.05, 0, 0.02), 0.0165, DARK),
    ],
    "Two": [rod((0.008, 0, 0), (0.066, 0, 0), 0.0112, SHELL)],
    "Three": [
        rod((0.004, 0, 0), (0.046, 0.001, 0), 0.0105, METAL),
        rod((0.036, 0.001, 0), (0.046, 0.001, 0), 0.0112, DARK),
    ],
}

# A chest that widens upwards: rods across, so close that they look like one surface.
_CHEST = [rod((0, -y, z), (0, y, z), r, SHELL) for z, y, r in (
    (0.83, 0.045, 0.100), (0.87, 0.052, 0.106), (0.91, 0.060, 0.111), (0.95, 0.068, 0.114),
    (0.99, 0.077, 0.115),
    (1.03, 0.086, 0.114), (1.07, 0.094, 0.110), (1.11, 0.100, 0.102), (1.14, 0.105, 0.092),
)]  # fmt: skip

LOOKS: dict[str, list[Look]] = {
    "torso_base": [
        Look("cylinder", (0.34, 0.06), DARK, (0, 0, 0.07)),
        Look("cylinder", (0.345, 0.008), JOINT, (0, 0, 0.137)),
        Look("ellipsoid", (0.30, 0.30, 0.09), SHELL, (0, 0, 0.145)),
        rod((0, 0, 0.1), (0, 0, 0.30), 0.15, SHELL, "cylinder"),
    ],
    "torso_link0": [
        rod((0, 0, 0.27), (0, 0, 0.30), 0.152, DARK, "cylinder"),
        rod((0, 0, 0.30), (0, 0, 0.72), 0.105, METAL, "cylinder"),
        rod((0, 0, 0.70), (0, 0, 0.73), 0.135, DARK, "cylinder"),
        *_CHEST,
        rod((0, -0.13, 1.16), (0, 0.13, 1.16), 0.072, SHELL),
        rod((0.005, 0, 1.20), (0.01, 0, 1.33), 0.042, DARK, "cylinder"),
    ],
    "head_pan_link": [rod((0, 0, -0.06), (0, 0, 0.03), 0.046, METAL, "cylinder")],
    # In the tilting frame x is ahead, y up and z to the right.
    "head_tilt_link": [
        rod((0, 0, -0.042), (0, 0, 0.042), 0.038, JOINT, "cylinder"),
        rod((-0.005, 0.0, 0), (-0.035, 0.09, 0), 0.034, DARK),
        Look("ellipsoid", (0.10, 0.115, 0.085), SHELL, (-0.045, 0.16, 0)),
        rod((0.005, 0.205, -0.115), (0.005, 0.205, 0.115), 0.036, DARK),
        rod((0.036, 0.214, -0.06), (0.043, 0.214, -0.06), 0.021, LENS, "cylinder"),
        rod((0.036, 0.214, 0.06), (0.043, 0.214, 0.06), 0.021, LENS, "cylinder"),
        rod((0.040, 0.205, 0.0), (0.0425, 0.205, 0.0), 0.011, JOINT, "cylinder"),
    ],
}
for _side in SIDES:
    LOOKS[f"calib_{_side}_arm_base_link"] = [
        rod((0, 0, -0.03), (0, 0, 0.09), 0.068, JOINT, "cylinder")
    ]
    LOOKS |= {f"{_side}_arm_{k}_link": _arm(k) for k in range(1, 7)}
    LOOKS[f"{_side}_gripper_mount_link"], LOOKS[f"{_side}_HandPalmLink"] = _MOUNT, _PALM
    for _finger_look in FINGERS:
        for _knuckle_look, _parts in _KNUCKLES.items():
            if (_finger_look, _knuckle_look) != ("Three", "One"):
                LOOKS[f"{_side}_HandFinger{_finger_look}Knuckle{_knuckle_look}Link"] = _parts


def dress(elements: Mapping[str, ET.Element]) -> None:
    """Add the looks to the bodies `elements` (name -> element)."""
    for body, parts in LOOKS.items():
        for k, look in enumerate(parts):
            words = {"name": f"{body}_look_{k}", "class": LOOK_CLASS, "type": look.kind}
            words |= {"rgba": _text(look.colour), "size": _text(look.size)}
            if look.end is None:
                words["pos"] = _text(look.start)
            else:
                words["fromto"] = _text((*look.start, *look.end))
            ET.SubElement(elements[body], "geom", words)


def _text(numbers: Sequence[float]) -> str:
    return " ".join(f"{x:.6g}" for x in numbers)


# --- Writes robot.xml, Velma alone in MJCF, from the numbers of robot.yaml ------------------------


HERE = Path(__file__).parent

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
    return ET.SubElement(
        parent, "geom", {"name": name, "type": kind, "size": text(size), **placed, **attributes}
    )


def load() -> Tree:
    """Return the numbers of robot.yaml."""
    tree: Tree = yaml.safe_load((HERE / "robot.yaml").read_text())
    return tree


def bodies(tree: Tree) -> Iterator[dict[str, Any]]:
    """Yield every body of the robot, parents first, with `{side}` filled in and all fingers of the
    hands.
    """
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
    kinds = {"torso": "torso", "head": "head", "KnuckleOne": "spread", "Knuckle": "finger"}
    for word, kind in kinds.items():  # in this order: the third one has the fourth one in it
        if word in joint:
            return float(numbers[kind])
    raise ValueError(
        f"joint {joint} has no armature in robot.yaml; its name has none of torso, arm, head,"
        " Knuckle"
    )


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
        shape(element, f"{name}_{k}", numbers, **{"class": ROBOT_CLASS[body["group"]]})
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
        for kind, knuckle in (("proximal", "Two"), ("distal", "Three")):
            for finger in FINGERS:
                joint = f"{side}_HandFinger{finger}Knuckle{knuckle}Joint"
                servo(f"{side}_{kind}_{finger}", joint, kind)


def robot() -> ET.Element:
    """Return the robot as an MJCF tree: compiler, defaults, bodies, contact exclusions, coupling
    and drives.
    """
    tree = load()
    root = ET.Element("mujoco", model="velma")
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    robot_defaults(ET.SubElement(root, "default"), tree["contact"]["hand"])
    elements = {"world": ET.SubElement(root, "worldbody")}
    every = list(bodies(tree))
    for body in every:
        _body(elements, tree, body)
    dress(elements)
    exclusions(ET.SubElement(root, "contact"), every)
    equality = ET.SubElement(root, "equality")
    # one motor spreads both fingers, the second mirrors the first (BHR axes are opposite)
    for side in SIDES:
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
