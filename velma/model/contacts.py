"""Pairs of bodies that can collide, as classes of geoms and excluded pairs of MJCF.

Classes are bit masks: two geoms are compared if the contype of one has a bit of the conaffinity of
the other. Grains never touch the robot, since each would cost a contact island. The inside of the
jar is a separate ring that only grains touch: on a jar of plates the hand would slip at the edges.
"""

from collections.abc import Mapping, Sequence
from enum import IntFlag
from typing import Any
from xml.etree import ElementTree as ET


class Kind(IntFlag):
    """Class of a geom, one bit each."""

    WORLD = 1
    ARM = 2
    HAND = 4
    OBJECT = 8
    GRAIN = 16
    INNER = 32


ROBOT_CLASS = {"trunk": "arm", "arm": "arm", "head": "arm", "hand": "hand", "finger": "finger"}

# Renderers show groups 0 to 2 by default; the shapes of looks.py are drawn in place of contact
# shapes.
SHAPE_GROUP, LOOK_GROUP = "3", "1"
LOOK_CLASS = "look"

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
    grip = {key: _attribute_text(value) for key, value in hand.items()}
    for name in ("hand", "finger"):
        add_class(default, name, group=SHAPE_GROUP, mass="0", **masks(Kind.HAND, meets), **grip)
    add_class(default, LOOK_CLASS, group=LOOK_GROUP, mass="0", **masks(Kind(0), Kind(0)))


def add_class(default: ET.Element, name: str, **attributes: str) -> None:
    """Add a class of geoms."""
    ET.SubElement(ET.SubElement(default, "default", {"class": name}), "geom", attributes)


def _attribute_text(value: Any) -> str:
    return " ".join(f"{x:g}" for x in value) if isinstance(value, list) else f"{value:g}"


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
