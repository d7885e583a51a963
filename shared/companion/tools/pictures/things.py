"""Things for the eye: smooth vessels of velma/model/surfaces.py, else the shapes that km knows them
by.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.languages.values import Box, Cylinder, Shape, Sphere
from companion.models import MODELS
from companion.world.geometry import half_sizes
from velma.model import tree
from velma.model.surfaces import MATERIALS, VESSELS, Part, turned

Colour = tuple[float, ...]
SURFACES = {"bowl_high": "bowl"}
"""Names of companion.models -> those of the drawn surfaces, where they differ."""
COLOURS = {"table": MATERIALS["wood_light"][0], "cabinet": MATERIALS["wood_thin"][0]}
"""Of a model's shapes that has no surface of its own; a thinner one for what hides the story."""
OTHER = (0.62, 0.64, 0.66, 1.0)
GRAIN_RADIUS = 0.008  # velma/model/objects.yaml
GRAIN_RGBA = (0.96, 0.72, 0.16, 1.0)


class Looks(NamedTuple):
    """A thing has a surface, or shapes, or neither where nobody knows its model."""

    rgba: Colour
    surface: Part | None = None
    shapes: tuple[tree.Shape, ...] = ()


def looks(model: str, colour: Colour | None = None) -> Looks:
    """Looks of a thing of this model, in its own frame.

    `colour`: red, green, blue and opacity, 0 to 1, of all parts; None: its own.
    """
    vessel = VESSELS.get(SURFACES.get(model, model))
    if vessel is not None:
        return Looks(colour or MATERIALS[vessel.material][0], vessel)
    fitting = (rgba for kind, rgba in COLOURS.items() if model.startswith(kind))
    rgba = colour or next(fitting, OTHER)
    known = MODELS[model].shapes if model in MODELS else ()
    return Looks(rgba, None, tuple(_look(shape, rgba) for shape in known))


def _look(shape: Shape, rgba: Colour) -> tree.Shape:
    """A shape of a model as one of the robot's, which are drawn."""
    a, b, c = half_sizes(shape)
    kind, size = {
        Box: ("box", (a, b, c)),
        Cylinder: ("cylinder", (a, 2 * c)),
        Sphere: ("ellipsoid", (a, b, c)),
    }[type(shape)]
    return tree.Shape(kind, size, shape.at.xyz, shape.at.quat_wxyz, rgba)


def triangles(part: Part) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points (n, 3) [m] of a surface, and faces (m, 3) as rows of them."""
    words = turned(part.outline)
    points = np.array(words["vertex"].split(), dtype=np.float64).reshape(-1, 3)
    return points, np.array(words["face"].split(), dtype=np.int64).reshape(-1, 3)
