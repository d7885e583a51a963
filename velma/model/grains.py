"""Writes the content of a jar as MJCF: balls, a body `grain_<k>` for each.

Grains that do not spin slide along three axes, and their coordinates count from where they begin.
Those that spin have a free joint, and theirs are in the world: the first three of both are along
the axes of the world.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from velma.model.build import text
from velma.model.scene import Content, Vector

Numbers = Mapping[str, Any]
AXES = ("1 0 0", "0 1 0", "0 0 1")


GRAIN = "grain_"
"""The body of the k-th grain is GRAIN and k."""


def grain_name(k: int) -> str:
    """Return the body of the k-th grain."""
    return f"{GRAIN}{k}"


def contacts(objects: Numbers, content: Content | None) -> Numbers:
    """Return the numbers of all contacts, those of grains and of the inside of a jar as the content
    says.
    """
    contact: dict[str, Numbers] = dict(objects["contact"])
    if content is not None and content.friction is not None:
        inner = contact["inner"]
        contact["inner"] = {**inner, "friction": [content.friction, *inner["friction"][1:]]}
    if content is not None and content.spin:
        spin = objects["spin"]
        for kind in ("grain", "inner"):
            friction = [contact[kind]["friction"][0], spin["about_normal"], spin["rolling"]]
            contact[kind] = {**contact[kind], "friction": friction, "condim": spin["condim"]}
    return contact


def add(world: ET.Element, objects: Numbers, jar: Vector, content: Content) -> None:
    """Add the grains, in a jar whose centre is at `jar` [m]."""
    grain = objects["grain"]
    for k, at in zip(
        range(content.grains), _stacked(objects["jar"], grain["radius"]), strict=False
    ):
        body = ET.SubElement(world, "body", name=grain_name(k), pos=text(np.add(jar, at)))
        if content.spin:
            ET.SubElement(body, "freejoint")
        else:
            for axis in AXES:
                ET.SubElement(body, "joint", type="slide", axis=axis)
        look = {"class": "grain", "material": "grain"}
        size = text([grain["radius"]])
        ET.SubElement(
            body, "geom", {"type": "sphere", "size": size, "mass": text([grain["mass"]]), **look}
        )


def _stacked(jar: Numbers, radius: float) -> Iterator[Vector]:
    """Yield places in a jar without overlap, layer by layer from the bottom, in the frame of the
    jar.
    """
    room = jar["radius"] - jar["wall"] - radius - 0.0015
    pitch = 2.06 * radius
    reach = int(room / pitch) + 2
    for layer in range(int(jar["height"] / pitch)):
        z = -jar["height"] / 2 + 0.006 + radius + 0.95 * pitch * layer
        shift = 0.25 * pitch * (layer % 2)
        for ix in range(-reach, reach + 1):
            for iy in range(-reach, reach + 1):
                x, y = (ix + 0.5 * (iy % 2)) * pitch + shift, 0.87 * iy * pitch + shift
                if math.hypot(x, y) <= room:
                    yield x, y, z
