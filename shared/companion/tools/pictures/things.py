"""Shapes of things in Rerun: smooth vessels of velma/model/surfaces.py, else the shapes that km knows them by."""

import numpy as np
import rerun as rr

from companion.languages.values import Box, Cylinder, Sphere
from companion.models import MODELS
from velma.model.surfaces import MATERIALS, VESSELS, Part, turned

# Names of companion.models -> those of the drawn surfaces, where they differ.
SURFACES = {"bowl_high": "bowl"}
# How a model's shapes are drawn that has no surface of its own: a colour, and a thinner one for what hides the story.
COLOURS = {"table": MATERIALS["wood_light"][0], "cabinet": MATERIALS["wood_thin"][0]}
OTHER = (0.62, 0.64, 0.66, 1.0)
Drawn = tuple[str, rr.AsComponents]


def looks(model: str, colour: tuple[float, ...] | None = None) -> list[Drawn]:
    """Named parts of a thing of this model, in its own frame; nothing for a model that nobody knows.

    `colour`: red, green, blue and opacity, 0 to 1, of all parts; None: its own.
    """
    vessel = VESSELS.get(SURFACES.get(model, model))
    if vessel is not None:
        return [(part.mesh, _mesh(part, colour or MATERIALS[part.material][0])) for part in vessel]
    if model not in MODELS:
        return []
    colour = colour or next((rgba for kind, rgba in COLOURS.items() if model.startswith(kind)), OTHER)
    shapes = MODELS[model].shapes
    boxes = [shape for shape in shapes if isinstance(shape, Box)]
    round_ones = [shape for shape in shapes if isinstance(shape, Cylinder)]
    balls = [shape for shape in shapes if isinstance(shape, Sphere)]
    parts: list[Drawn] = []
    if boxes:
        parts.append(("boards", _boxes(boxes, colour)))
    if round_ones:
        parts.append(("rounds", _cylinders(round_ones, colour)))
    if balls:
        at, radii = [ball.at.xyz for ball in balls], [ball.radius for ball in balls]
        parts.append(("balls", rr.Ellipsoids3D(radii=radii, centers=at, colors=[colour], fill_mode="solid")))
    return parts


def _boxes(boxes: list[Box], colour: tuple[float, ...]) -> rr.AsComponents:
    return rr.Boxes3D(
        sizes=[box.size for box in boxes],
        centers=[box.at.xyz for box in boxes],
        quaternions=[_xyzw(box.at.quat_wxyz) for box in boxes],
        colors=[colour],
        fill_mode="solid",
    )


def _cylinders(rounds: list[Cylinder], colour: tuple[float, ...]) -> rr.AsComponents:
    return rr.Cylinders3D(
        lengths=[one.length for one in rounds],
        radii=[one.radius for one in rounds],
        centers=[one.at.xyz for one in rounds],
        quaternions=[_xyzw(one.at.quat_wxyz) for one in rounds],
        colors=[colour],
        fill_mode="solid",
    )


def _mesh(part: Part, colour: tuple[float, ...]) -> rr.Mesh3D:
    """A surface of revolution, with a normal for each corner of each face: edges of the outline stay sharp enough."""
    words = turned(part.outline)
    points = np.array(words["vertex"].split(), dtype=np.float64).reshape(-1, 3)
    faces = np.array(words["face"].split(), dtype=np.int64).reshape(-1, 3)
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    smooth = np.zeros_like(points)
    for corner in range(3):
        np.add.at(smooth, faces[:, corner], normals)
    length = np.linalg.norm(smooth, axis=1, keepdims=True)
    smooth /= np.where(length > 0, length, 1.0)
    return rr.Mesh3D(vertex_positions=points, triangle_indices=faces, vertex_normals=smooth, albedo_factor=colour)


def _xyzw(quat_wxyz: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    w, x, y, z = quat_wxyz
    return x, y, z, w
