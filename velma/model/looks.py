"""The visual shapes of Velma, in a group of their own, without mass and contact.

Drawn after the proportions of the robot: a white torso on a dark base, two light arms with orange joints, dark
hands with light fingers, a head with a wide sensor bar. Lengths are those of the kinematic tree, the rest is design.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple
from xml.etree import ElementTree as ET

from velma.model.contacts import LOOK_CLASS
from velma.names import FINGERS, SIDES

Point = tuple[float, float, float]

SHELL = (0.91, 0.91, 0.89, 1.0)
JOINT = (0.90, 0.45, 0.14, 1.0)
DARK = (0.20, 0.21, 0.24, 1.0)
METAL = (0.66, 0.68, 0.71, 1.0)
LENS = (0.05, 0.10, 0.22, 1.0)
Colour = tuple[float, float, float, float]


class Look(NamedTuple):
    """A shape on a body: capsules and cylinders between two points, ellipsoids and boxes by centre and half axes."""

    kind: str
    size: Sequence[float]
    colour: Colour
    start: Point
    end: Point | None = None


def rod(start: Point, end: Point, radius: float, colour: Colour, kind: str = "capsule") -> Look:
    """Return a capsule or cylinder between two points."""
    return Look(kind, (radius,), colour, start, end)


# Links of an arm from its shoulder: how far each reaches along z [m], and the radii of both ends of its shell.
_ARM_SHELLS = {1: (0.13, 0.062), 2: (0.15, 0.060), 3: (0.15, 0.059), 4: (0.15, 0.057), 5: (0.14, 0.055)}
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
    "One": [rod((0, 0, 0.002), (0.048, 0, 0.002), 0.0155, METAL), rod((0.05, 0, 0.0), (0.05, 0, 0.02), 0.0165, DARK)],
    "Two": [rod((0.008, 0, 0), (0.066, 0, 0), 0.0112, SHELL)],
    "Three": [
        rod((0.004, 0, 0), (0.046, 0.001, 0), 0.0105, METAL),
        rod((0.036, 0.001, 0), (0.046, 0.001, 0), 0.0112, DARK),
    ],
}

# A chest that widens upwards: rods across, so close that they look like one surface.
_CHEST = [rod((0, -y, z), (0, y, z), r, SHELL) for z, y, r in (
    (0.83, 0.045, 0.100), (0.87, 0.052, 0.106), (0.91, 0.060, 0.111), (0.95, 0.068, 0.114), (0.99, 0.077, 0.115),
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
    LOOKS[f"calib_{_side}_arm_base_link"] = [rod((0, 0, -0.03), (0, 0, 0.09), 0.068, JOINT, "cylinder")]
    LOOKS |= {f"{_side}_arm_{k}_link": _arm(k) for k in range(1, 7)}
    LOOKS[f"{_side}_gripper_mount_link"], LOOKS[f"{_side}_HandPalmLink"] = _MOUNT, _PALM
    for _finger in FINGERS:
        for _knuckle, _parts in _KNUCKLES.items():
            if (_finger, _knuckle) != ("Three", "One"):
                LOOKS[f"{_side}_HandFinger{_finger}Knuckle{_knuckle}Link"] = _parts


def dress(elements: Mapping[str, ET.Element]) -> None:
    """Add the looks to the bodies `elements` (name -> element)."""
    for body, parts in LOOKS.items():
        for k, look in enumerate(parts):
            words = {"name": f"{body}_look_{k}", "class": LOOK_CLASS, "type": look.kind, "rgba": _text(look.colour)}
            words["size"] = _text(look.size)
            if look.end is None:
                words["pos"] = _text(look.start)
            else:
                words["fromto"] = _text((*look.start, *look.end))
            ET.SubElement(elements[body], "geom", words)


def _text(numbers: Sequence[float]) -> str:
    return " ".join(f"{x:.6g}" for x in numbers)
