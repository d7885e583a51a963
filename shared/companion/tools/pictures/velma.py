"""Velma in 3D: links with their looks, grip frames, and how each joint turns."""

from itertools import groupby
from typing import Any

import numpy as np
import rerun as rr
from msgspec.structs import replace

from companion.languages.values import Pose
from companion.telemetry import RobotState
from companion.tools.pictures import robot
from companion.world.geometry import place
from operate.pictures.sheet import AXES, Sheet, transforms
from operate.recording.happenings import Happening
from velma.model import tree
from velma.names import BODY, GRIP_BODY, START

VELMA = "world/velma"
STILL_RAD = 1e-4
"""A joint that turned less is not drawn again; estimate: 0.1 mm at an arm's length."""
AXIS_M = 0.06
"""Length of a drawn axis; estimate."""
FLOOR = tree.Shape(
    "box", (2.2, 2.2, 0.01), (0.5, 0.0, -0.01), (1.0, 0.0, 0.0, 0.0), (0.87, 0.886, 0.902)
)


class Velma:
    """Draws what telemetry says of the robot."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet = sheet
        self._last: dict[str, float] = {}
        self._moving = [link for link in tree.links() if link.joint]
        self._entities = {link.name: entity(link) for link in self._moving}
        sheet.static("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        sheet.static("world/floor", drawn("box", [FLOOR]))
        # x red, y green, z blue
        axes = rr.Arrows3D(vectors=np.eye(3) * AXIS_M, colors=AXES, radii=0.0025)
        for link in tree.links():
            shaped(sheet, link)
            placed(sheet, link)
            if link.name in GRIP_BODY.values():
                sheet.static(f"{entity(link)}/frame", axes)
        start = dict(zip(BODY, START.tolist(), strict=True))
        # until the first telemetry, which may be late: the arms hang down
        for link in self._moving:
            turned = (link.at, robot.turned(link, start.get(link.joint, 0.0)))
            sheet.add(self._entities[link.name], transforms, sheet.begin, turned)

    def take(self, happening: Happening) -> None:
        """Turn the joints that moved."""
        state = happening.what
        if not isinstance(state, RobotState):
            return
        q = robot.joints(state)
        for link in self._moving:
            now = q.get(link.joint, 0.0)
            if link.joint not in self._last or abs(now - self._last[link.joint]) > STILL_RAD:
                self._last[link.joint] = now
                turned = (link.at, robot.turned(link, now))
                self._sheet.add(
                    self._entities[link.name], transforms, happening.at, turned, state.sim_time_s
                )


def entity(link: tree.Link, root: str = VELMA) -> str:
    """Return the path of a link in Rerun."""
    return "/".join((root, *link.path))


def placed(sheet: Sheet, link: tree.Link, root: str = VELMA) -> None:
    """Draw how a link that does not move stands to its parent."""
    if not link.joint:
        turn = rr.Quaternion(xyzw=xyzw(link.quat_wxyz))
        sheet.static(entity(link, root), rr.Transform3D(translation=link.at, quaternion=turn))


def shaped(
    sheet: Sheet, link: tree.Link, root: str = VELMA, rgba: tuple[float, ...] | None = None
) -> None:
    """Draw the shapes of a link. `rgba`: of all of them, 0 to 1; None: each has its own."""
    for kind, some in groupby(sorted(link.shapes, key=lambda s: s.kind), key=lambda s: s.kind):
        shapes = [replace(shape, rgba=rgba or shape.rgba) for shape in some]
        sheet.static(f"{entity(link, root)}/{kind}", drawn(kind, shapes))


def drawn(kind: str, shapes: list[tree.Shape]) -> rr.AsComponents:
    """The shapes of one kind on a link, in one batch."""
    at, turn = [s.at for s in shapes], [xyzw(s.quat_wxyz) for s in shapes]
    look: dict[str, Any] = {
        "colors": [s.rgba for s in shapes],
        "quaternions": turn,
        "fill_mode": "solid",
    }
    if kind == "box":
        return rr.Boxes3D(half_sizes=[s.size for s in shapes], centers=at, **look)
    if kind == "ellipsoid":
        return rr.Ellipsoids3D(half_sizes=[s.size for s in shapes], centers=at, **look)
    radii, lengths = [s.size[0] for s in shapes], [s.size[1] for s in shapes]
    if kind == "cylinder":
        return rr.Cylinders3D(lengths=lengths, radii=radii, centers=at, **look)
    # A capsule of Rerun begins at its origin; ours are given by their centres.
    starts = [place(Pose(s.at, s.quat_wxyz), (0.0, 0.0, -s.size[1] / 2)) for s in shapes]
    return rr.Capsules3D(lengths=lengths, radii=radii, translations=starts, **look)


def xyzw(quat_wxyz: tuple[float, ...]) -> tuple[float, float, float, float]:
    """Rerun has w last."""
    w, x, y, z = quat_wxyz
    return x, y, z, w
