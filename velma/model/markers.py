"""Square markers on things and furniture: where each is, and its number.

A marker is a black square with 4 x 4 bits inside (ArUco 4x4), on a white plate one sixth of the
square wider on each side. Sizes, places and numbers were chosen by a trial of 221 rendered views
(docs/decisions/2026-11-25-eyes.md): as large as the thing allows, out of the way of fingers, and
two or more in sight from most sides. Knows no detector.
"""

import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count, product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from velma.errors import SceneError
from velma.model.kinds import BOXES, DOORS, TABLES, Model, objects

if TYPE_CHECKING:  # a scene is checked for its markers
    from velma.model.scene import Scene

Array = NDArray[np.float64]

PLATE = 4.0 / 3.0
"""Side of the white plate by that of the black square."""
MOST = 250
"""Numbers that the largest dictionary of these bits has (OpenCV's DICT_4X4_250)."""
OFF_M = 0.0005  # plates lie this far before the surface, or the surface would be drawn through them
# on a box: largest marker, white left at the edge of a face; estimates
LARGEST_M, RIM_M = 0.06, 0.002
# marker on a fin of a leaf: as large as on the jar; its middle before the panel's
FIN_M, FIN_X_M = 0.026, 0.026
# from a table's edge to the middle of a marker: the plate of 80 mm stays on the table
TABLE_INSET_M = 0.0515


class Marker(NamedTuple):
    """Corners (4, 3) [m] of the black square in its thing's frame, as seen upright from the front:
    upper left, upper right, lower right, lower left.
    """

    number: int
    corners: Array

    def plate(self) -> Array:
        """Return the corners (4, 3) of its white plate."""
        middle = self.corners.mean(axis=0)
        return np.asarray(middle + PLATE * (self.corners - middle))


def of_scene(scene: "Scene") -> dict[str, tuple[Marker, ...]]:
    """Return the markers of each thing by id. Raises SceneError for the first thing for which none
    are left.

    The first of a kind has the numbers of the trial, all others the next ones from 46 on, in the
    order of the scene.
    """
    kept = {kind: iter(numbers) for kind, numbers in _KEPT.items()}
    free, out = count(_FREE), dict[str, tuple[Marker, ...]]()
    for thing in scene.things:
        corners = list(_PLACES[thing.model]())
        reserved = next(kept[_kind(thing.model)], ()) if _kind(thing.model) in kept else ()
        numbers = reserved or [next(free) for _ in corners]
        if max(numbers) >= MOST:
            most = (
                f"at most {MOST} markers in all: they suffice for the {len(out)} things before it"
            )
            raise SceneError(
                f"thing {thing.id}", f"a {thing.model} with {len(corners)} markers", most
            )
        out[thing.id] = tuple(
            Marker(number, at) for number, at in zip(numbers, corners, strict=True)
        )
    return out


def _square(centre: Array, normal: Array, up: Array, side: float) -> Array:
    """Return the corners (4, 3) of a square that looks along `normal`; both directions of
    length 1.
    """
    right = np.cross(up, normal)
    return np.array(
        [centre + side / 2 * (x * right + y * up) for x, y in ((-1, 1), (1, 1), (1, -1), (-1, -1))]
    )


def _ring(
    amount: int, side: float, radius: float, z: float, rise: float, first: float = 0.0
) -> Iterator[Array]:
    """Yield squares about the z axis. `rise`: angle of the normals above the horizontal; beyond 90
    degrees they look inwards. `first`: angle about z of the first one. All in rad.
    """
    for k in range(amount):
        around = first + math.tau * k / amount
        out = np.array([math.cos(around), math.sin(around), 0.0])
        normal = math.cos(rise) * out + math.sin(rise) * np.array([0.0, 0.0, 1.0])
        up = math.copysign(1.0, math.cos(rise)) * (
            math.cos(rise) * np.array([0.0, 0.0, 1.0]) - math.sin(rise) * out
        )
        yield _square(radius * out + np.array([0.0, 0.0, z]), normal, up, side)


def _jar() -> Iterator[Array]:
    """Yield one ring at the foot and one at the rim, the hand between them."""
    apothem, z = objects()["jar"]["radius"] + OFF_M, 0.08
    yield from _ring(8, 0.026, apothem, -z, 0.0)
    yield from _ring(8, 0.026, apothem, z, 0.0, math.pi / 8)


def _bowl() -> Iterator[Array]:
    """Yield a skirt about the foot, below the fingers, and a ring inside along the wall."""
    yield from _ring(10, 0.028, 0.087, 0.018, math.radians(50.0))
    # of the wall's inner side from the vertical, velma.model.surfaces
    slant = math.atan2(0.039, 0.091)
    yield from _ring(8, 0.030, 0.0765, 0.066, math.pi - slant)


def _cabinet() -> Iterator[Array]:
    """Yield two on the low board of the front, two below the front edge of the top."""
    ahead, up = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    for side, y, z, x in ((0.06, 0.24, -0.3025, 0.123), (0.045, 0.252, 0.308, 0.151)):
        for sign in (1.0, -1.0):
            yield _square(np.array([x, sign * y, z]), ahead, up, side)


def _cabinet_door() -> Iterator[Array]:
    """Yield four on the low board, below the leaves, and two that stand on the roof, where no leaf
    hides them.
    """
    ahead, up = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    for side, across, z, x in (
        (0.036, (0.24, 0.08, -0.08, -0.24), -0.32, 0.123),
        (0.045, (0.26, -0.26), 0.38, 0.149),
    ):
        for y in across:
            yield _square(np.array([x, y, z]), ahead, up, side)


def _table(model: Model) -> Iterator[Array]:
    """Yield one near each corner of the top."""
    top = objects()[model]["parts"]["top"]
    x, y, z = np.array(top["box"]) / 2
    for across, along in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        at = (
            np.array([across * (x - TABLE_INSET_M), along * (y - TABLE_INSET_M), z + OFF_M])
            + top["xyz"]
        )
        yield _square(at, np.array([0.0, 0.0, 1.0]), np.array([-1.0, 0.0, 0.0]), 0.06)


def _box(model: Model) -> Iterator[Array]:
    """Yield two on each side and on the top, side by side along the longer edge."""
    half = np.array(objects()[model]["edges"]) / 2
    axes = np.eye(3)
    for axis, sign in ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0)):
        long, short = sorted((k for k in range(3) if k != axis), key=lambda k: -half[k])
        side = min((min(half[long], 2 * half[short]) - RIM_M) / PLATE, LARGEST_M)
        middle = sign * (half[axis] + OFF_M) * axes[axis]
        for shift in (-0.5, 0.5):
            yield _square(
                middle + shift * half[long] * axes[long], sign * axes[axis], axes[short], side
            )


def _door(model: Model) -> Iterator[Array]:
    """Yield four on each side of the panel, beside the handle and the edges of the shelves, and
    three on fins that stand between panel and bar: who looks along an open leaf sees them.
    """
    panel = objects()[model]["parts"]["panel"]
    thick, width, _ = panel["box"]
    middle, ahead, up = np.array(panel["xyz"]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    for sign, z in product((1.0, -1.0), (0.22, 0.13, -0.13, -0.22)):
        y = math.copysign(width / 2 - LARGEST_M, z * (abs(z) - 0.2) * middle[1])
        at = middle + np.array([sign * (thick / 2 + OFF_M), y, z])
        yield _square(at, sign * ahead, up, LARGEST_M)
    edge = np.array([0.0, math.copysign(1.0, middle[1]), 0.0])
    for z in (0.2, 0.11, -0.11):
        yield _square(np.array([FIN_X_M, middle[1], z]) + 0.49 * width * edge, edge, up, FIN_M)


def _lid() -> Iterator[Array]:
    """Yield a ring and one on the top."""
    lid = objects()[Model.LID]
    yield from _ring(8, 0.022, lid["radius"] + OFF_M, 0.0, 0.0)
    top = np.array([0.0, 0.0, lid["height"] / 2 + OFF_M])
    yield _square(top, np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), 0.04)


_PLACES: dict[Model, Callable[[], Iterator[Array]]] = {
    Model.JAR: _jar,
    Model.BOWL: _bowl,
    Model.CABINET: _cabinet,
    Model.CABINET_DOOR: _cabinet_door,
    Model.LID: _lid,
    **{model: partial(_table, model) for model in TABLES},
    **{model: partial(_box, model) for model in BOXES},
    **{model: partial(_door, model) for model in DOORS},
}
_KEPT = {
    Model.JAR: ((*range(0, 16),),),
    Model.BOWL: ((*range(16, 26), *range(38, 46)),),
    Model.CABINET: ((*range(26, 30),),),
    Model.TABLE: ((*range(30, 34),), (*range(34, 38),)),
}
_FREE = 46


def _kind(model: Model) -> Model:
    """Return the model whose numbers it may have: all tables have four markers."""
    return Model.TABLE if model in TABLES else model
