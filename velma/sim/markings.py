"""Markers on the things of a simulated world, for pictures. They have no mass and no contact: the physics is the same.

A body has one texture with all its plates and one mesh of squares: so many geoms would be slower to draw.
"""

import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from velma.eyes import bits
from velma.model.contacts import LOOK_GROUP
from velma.model.markers import Marker, of_scene
from velma.model.scene import Scene, checked
from velma.model.scene_xml import scene_xml

TEXELS = 12
"""Of a field of a plate, each way; a plate of 96 texels is sharp enough (measured)."""


def marked(scene: Scene) -> mujoco.MjModel:
    """Return the model of a scene with markers on its things. Its coordinates are those of the model without."""
    spec = mujoco.MjSpec.from_string(scene_xml(checked(scene)))
    for name, markers in of_scene(scene).items():
        _mark(spec, name, markers)
    return spec.compile()


def _mark(spec: Any, name: str, markers: Sequence[Marker]) -> None:
    """Add one mesh with the plates of a body's markers to the body `name`."""
    label, columns = f"{name}_markers", math.ceil(math.sqrt(len(markers)))
    rows = math.ceil(len(markers) / columns)
    sheet = _sheet(markers, rows, columns)
    height, width = sheet.shape
    texture = spec.add_texture(name=label, type=mujoco.mjtTexture.mjTEXTURE_2D, width=width, height=height, nchannel=3)
    texture.data = np.repeat(sheet[..., None], 3, axis=2).tobytes()
    material = spec.add_material(name=label, specular=0.0, shininess=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = label
    faces = np.array([(4 * k + a, 4 * k + b, 4 * k + c) for k in range(len(markers)) for a, b, c in _HALVES])
    mesh = spec.add_mesh(name=label)
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # an open surface has no volume
    mesh.uservert = np.concatenate([marker.plate() for marker in markers]).ravel().tolist()
    mesh.usertexcoord = _texcoords(len(markers), rows, columns).ravel().tolist()
    mesh.userface = mesh.userfacetexcoord = faces.ravel().tolist()
    geom = spec.body(name).add_geom(name=label, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=label, material=label)
    geom.contype = geom.conaffinity = 0
    geom.group, geom.mass = int(LOOK_GROUP), 0.0


_HALVES = ((3, 2, 1), (3, 1, 0))
"""Triangles of a square whose corners are upper left, upper right, lower right, lower left: seen from its front."""


def _sheet(markers: Sequence[Marker], rows: int, columns: int) -> np.ndarray:
    """Return grey levels (rows x n, columns x n) of all plates, row by row, white where none is."""
    side = bits.MODULES * TEXELS
    sheet = np.full((rows * side, columns * side), 255, np.uint8)
    for k, marker in enumerate(markers):
        y, x = divmod(k, columns)
        sheet[y * side : (y + 1) * side, x * side : (x + 1) * side] = bits.plate(marker.number, TEXELS)
    return sheet


def _texcoords(count: int, rows: int, columns: int) -> np.ndarray:
    """Return where (count, 4, 2) the corners of the plates are in the sheet, 0 to 1, v downwards from the top row."""
    at = np.array([divmod(k, columns)[::-1] for k in range(count)])[:, None, :]
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])[None]
    return np.asarray((at + corners) / np.array([columns, rows]))
