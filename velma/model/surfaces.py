"""Visuals of a scene: materials, light, and smooth surfaces of revolution for vessels. No
physics.
"""

import math
from typing import NamedTuple
from xml.etree import ElementTree as ET

from velma.model.kinds import DOORS, TABLES, Model

SEGMENTS = 48  # of a full turn; looks smooth in a picture


class Part(NamedTuple):
    """A surface of revolution: its mesh, its material and its outline of (radius, z) [m]."""

    mesh: str
    material: str
    outline: tuple[tuple[float, float], ...]


# The outlines follow objects.yaml's jar and bowl; a jar of thin glass, a bowl with a rounded rim.
_JAR = (
    (0.0, -0.1), (0.036, -0.1), (0.04, -0.096), (0.04, 0.094), (0.0405, 0.1), (0.037, 0.1),
    (0.037, -0.094), (0.0, -0.094),
)  # fmt: skip
_BOWL = (
    (0.0, 0.0), (0.056, 0.0), (0.061, 0.004), (0.0995, 0.096), (0.1, 0.099), (0.0975, 0.1005),
    (0.095, 0.098), (0.056, 0.007), (0.0, 0.006),
)  # fmt: skip
VESSELS = {"jar": Part("jar_glass", "glass", _JAR), "bowl": Part("bowl_glaze", "glaze", _BOWL)}

# rgba, specular, shininess, reflectance. Warm wood, white robot, one strong colour for what
# matters: the grains.
MATERIALS = {
    "wood": ((0.80, 0.62, 0.44, 1.0), 0.2, 0.2, 0.0),
    # Transparent sides: a closed cabinet would hide jar and bowl from most viewpoints.
    "wood_thin": ((0.86, 0.70, 0.52, 0.38), 0.2, 0.2, 0.0),
    "wood_light": ((0.88, 0.76, 0.60, 1.0), 0.2, 0.2, 0.0),
    "steel": ((0.62, 0.64, 0.66, 1.0), 0.6, 0.6, 0.0),
    "glass": ((0.72, 0.88, 0.95, 0.32), 0.9, 0.9, 0.0),
    "glaze": ((0.20, 0.42, 0.62, 1.0), 0.8, 0.7, 0.0),
    "carton": ((0.72, 0.18, 0.14, 1.0), 0.1, 0.1, 0.0),
    "grain": ((0.96, 0.72, 0.16, 1.0), 0.3, 0.3, 0.0),
}


def material(model: Model, part: str) -> str:
    """Return the material of a part of a piece of furniture."""
    if model in TABLES:
        return "wood_light" if part == "top" else "steel"
    if model in DOORS:
        return "wood_light" if part == "panel" else "steel"
    return "wood_thin" if part in ("back", "left_side", "right_side", "top") else "wood"


def studio(root: ET.Element, world: ET.Element) -> None:
    """Add materials, meshes, lights and the floor."""
    asset = ET.SubElement(root, "asset")
    for name, (rgba, *shine) in MATERIALS.items():
        look = dict(zip(("specular", "shininess", "reflectance"), map(_number, shine), strict=True))
        ET.SubElement(
            asset, "material", {"name": name, "rgba": " ".join(map(_number, rgba)), **look}
        )
    sky = {"type": "skybox", "builtin": "gradient", "width": "256", "height": "256"}
    sky |= {"rgb1": "0.86 0.90 0.94", "rgb2": "0.62 0.68 0.76"}
    tiles = {"type": "2d", "builtin": "checker", "width": "512", "height": "512"}
    tiles |= {"rgb1": "0.80 0.80 0.79", "rgb2": "0.76 0.76 0.75"}
    for name, texture in (("sky", sky), ("tiles", tiles)):
        ET.SubElement(asset, "texture", {"name": name, **texture})
    floor = {"texture": "tiles", "texrepeat": "1.5 1.5", "texuniform": "true", "specular": "0.1"}
    ET.SubElement(asset, "material", {"name": "floor", **floor})
    for part in VESSELS.values():
        ET.SubElement(
            asset, "mesh", {"name": part.mesh, "inertia": "shell", **turned(part.outline)}
        )
    visual = ET.SubElement(root, "visual")
    ET.SubElement(visual, "global", offwidth="1280", offheight="960")
    light = {"ambient": "0.38 0.38 0.40", "diffuse": "0.25 0.25 0.25", "specular": "0.1 0.1 0.1"}
    ET.SubElement(visual, "headlight", light)
    ET.SubElement(visual, "quality", shadowsize="8192", offsamples="8")
    ET.SubElement(visual, "map", haze="0.25", fogstart="6", fogend="14", shadowclip="8")
    ET.SubElement(visual, "rgba", haze="0.86 0.90 0.94 1", fog="0.86 0.90 0.94 1")
    ET.SubElement(root, "statistic", center="0.5 0 0.9", extent="2.2")
    sun = {"pos": "-0.6 0.8 3.2", "dir": "0.35 -0.25 -1", "castshadow": "true"}
    sun |= {"diffuse": "0.55 0.53 0.50", "specular": "0.25 0.25 0.25"}
    fill = {"pos": "2 -3 3", "dir": "-0.5 0.8 -0.6", "castshadow": "false"}
    fill |= {"diffuse": "0.22 0.24 0.28"}
    for name, lamp in (("sun", sun), ("fill", fill)):
        ET.SubElement(world, "light", {"name": name, "directional": "true", **lamp})
    ground = {"type": "plane", "size": "0 0 0.1", "material": "floor", "class": "furniture"}
    ET.SubElement(world, "geom", {"name": "floor", **ground})


def _number(x: float) -> str:
    return f"{x:g}"


def turned(outline: tuple[tuple[float, float], ...]) -> dict[str, str]:
    """Return vertices and faces of an outline (radius, z) turned about z, as MJCF words; faces look
    left of its way.
    """
    around = [2 * math.pi * k / SEGMENTS for k in range(SEGMENTS)]
    points = [(r * math.cos(a), r * math.sin(a), z) for r, z in outline for a in around]
    faces = []
    for row in range(len(outline) - 1):
        for k in range(SEGMENTS):
            a, b = row * SEGMENTS + k, row * SEGMENTS + (k + 1) % SEGMENTS
            c, d = a + SEGMENTS, b + SEGMENTS
            if outline[row][0] > 0:
                faces.append((a, b, d))
            if outline[row + 1][0] > 0:
                faces.append((a, d, c))
    return {
        "vertex": " ".join(f"{x:.5g}" for point in points for x in point),
        "face": " ".join(str(i) for face in faces for i in face),
    }
