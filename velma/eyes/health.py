"""Whether the head camera sees, and whether the encoders between the room and it are right, by what
looks show.

A picture is new, bright enough, of more than one brightness, and not mirrored. Two pictures of a
camera with noise are never equal, even from the same place: one that is has been shown before.
Furniture that was seen before stands where it stood: where all of it in view has turned about the
robot's neck, the measured torso or head is off; where a piece has moved otherwise, somebody has
moved it. An offset that was there at the first look shows in nothing here.
"""

from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from typing import Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from velma.eyes.fit import View, turn
from velma.eyes.seeing import LEAST_MARKERS, Seen
from velma.model.kinds import CABINETS, TABLES
from velma.model.markers import Marker, of_scene
from velma.model.scene import Scene

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]
Pose = tuple[Array, Array]

SMALL = (80, 60)  # pixels of the picture that is judged: a mean of 10 x 10 has a tenth of the noise
LEAST_MEAN, LEAST_DEVIATION = 25.0, 2.0
"""Grey levels of a picture that shows something. In the 524 looks of 20 good pours (10 each in
`canonical` and `env2`): at least 157 and 16; of the bare wall 214 and 4.4. Of pictures dimmed to
0.15 (mean 25 to 36, deviation 2.9 to 6.2) 25 of 26 things were seen, by 5 mm elsewhere at most; to
0.1, 10 of 26; to 0.07, none. What was seen in the bowl stayed the same.
"""
# m: a centimetre from the axes of torso, pan and tilt (a test measures it)
PIVOT = (0.0, 0.0, 1.48)
TURNED, MOST_RMS_PX = 0.006, 0.5
"""Least rotation about the neck that is an offset [rad], most deviation of a corner of furniture
that kept its shape. In the 415 of those looks that show enough furniture: rotation 0.0010 in 95 %,
0.0012 at most, and 0.0044 once, by two markers of two pieces; deviation 0.20 in 95 %, 0.35 at most.
"""
MOST_OFF = 0.02
"""Largest offset with which poses are taken and an arm moves [rad]: a thing 1.1 m from the camera
is 22 mm beside. With a camera that errs by up to 0.01 on each axis, 0.017 in all, 10 of 10 pours
were done (docs/results/disturbances.md); as it looks from side to side, furniture seems to turn by
as much.
"""


class Wrong(StrEnum):
    """Reason why a picture shows nothing that is true."""

    FROZEN = "frozen"
    DARK = "dark"
    UNIFORM = "uniform"
    MIRRORED = "mirrored"


class Look(NamedTuple):
    """A picture (height, width, 3), its number by the camera, and where the joints say that it was
    taken.
    """

    number: int
    pixels: Pixels
    view: View


class Judged(NamedTuple):
    """What is known of camera and encoders after a look.

    `wrong`: with the picture, "" for nothing. `off`: of torso and head [rad], 0 where nothing tells
    an offset. `places`: pose in the world of each piece of furniture; `look`: this look; both to
    compare the next one with.
    """

    wrong: Wrong | Literal[""] = ""
    off: float = 0.0
    places: Mapping[str, Pose] = {}
    look: Look | None = None


class Stand(StrEnum):
    """Way in which furniture is seen now, against where it stood."""

    UNTOLD = "untold"  # too little of it is in view
    STILL = "still"
    TURNED = "turned"  # all of it about the neck
    MOVED = "moved"  # otherwise


def standing(scene: Scene) -> dict[str, tuple[Marker, ...]]:
    """Return the markers of the furniture of a scene that does not move: without doors."""
    of = of_scene(scene)
    return {thing.id: of[thing.id] for thing in scene.of(*CABINETS, *TABLES)}


def judged(
    before: Judged,
    now: Look,
    markers: Mapping[str, Sequence[Marker]],
    found: Mapping[int, Array],
    bodies: Sequence[Seen],
    read: Callable[[Pixels], Sequence[Seen]],
    *,
    noise: bool,
) -> Judged:
    """Return what is known after one more look.

    `markers`: of the furniture; `found`: those in the picture; `bodies`: seen in it; `read`: sees
    those in another one. What was off is so until furniture tells otherwise; while nothing is off,
    furniture that was moved has a new place.
    """
    wrong = picture(now, before.look, noise=noise)
    if not wrong and not bodies and read(np.ascontiguousarray(now.pixels[:, ::-1])):
        wrong = Wrong.MIRRORED
    if wrong:
        return Judged(wrong, before.off, before.places, now)
    how, angle = stand(before.places, markers, found, now.view)
    off = {Stand.TURNED: angle, Stand.UNTOLD: before.off}.get(how, 0.0)
    if off:
        return Judged("", off, before.places, now)
    seen = {one.name: (one.rotation, one.position) for one in bodies if one.name in markers}
    return Judged(
        "", 0.0, {**before.places, **seen} if how is Stand.MOVED else {**seen, **before.places}, now
    )


def picture(now: Look, before: Look | None, *, noise: bool) -> Wrong | Literal[""]:
    """Return what is wrong with a picture by its brightness and by the one before; "" for nothing.

    `noise`: whether the camera has some; without it the same picture twice from the same place is a
    true one.
    """
    grey = cv2.resize(
        cv2.cvtColor(now.pixels, cv2.COLOR_RGB2GRAY), SMALL, interpolation=cv2.INTER_AREA
    )
    if grey.mean() < LEAST_MEAN:
        return Wrong.DARK
    if grey.std() < LEAST_DEVIATION:
        return Wrong.UNIFORM
    if before is None:
        return ""
    again = np.array_equal(now.pixels, before.pixels) and (
        noise or not _there(now.view, before.view)
    )
    return Wrong.FROZEN if again or now.number == before.number else ""


def stand(
    before: Mapping[str, Pose],
    markers: Mapping[str, Sequence[Marker]],
    found: Mapping[int, Array],
    view: View,
) -> tuple[Stand, float]:
    """Return how furniture stands in a picture, and the angle [rad] by which it is turned.

    `before`: where each piece was seen; `markers`: of each; `found`: those in the picture. One
    marker tells nothing. Where the pieces do not agree, one that stands still tells that the others
    were moved.
    """
    whole = _together(before, markers, found, view)
    if whole[0] is not Stand.MOVED:
        return whole
    alone = [_together({name: pose}, markers, found, view) for name, pose in before.items()]
    if any(how is Stand.STILL for how, _ in alone):
        return whole
    return next((way for way in alone if way[0] is Stand.TURNED), whole)


def _together(
    before: Mapping[str, Pose],
    markers: Mapping[str, Sequence[Marker]],
    found: Mapping[int, Array],
    view: View,
) -> tuple[Stand, float]:
    """Return how these pieces stand, taken as one body."""
    there = [(name, one) for name in before for one in markers[name] if one.number in found]
    if len(there) < LEAST_MARKERS:
        return Stand.UNTOLD, 0.0
    stood = [one.corners @ before[name][0].T + before[name][1] for name, one in there]
    corners, pixels = np.concatenate(stood), np.concatenate([found[one.number] for _, one in there])
    body = turn(view, corners, pixels, np.array(PIVOT))
    if body is None:
        return Stand.UNTOLD, 0.0
    angle = float(np.linalg.norm(cv2.Rodrigues(body.rotation)[0]))
    if body.rms_px > MOST_RMS_PX:
        return Stand.MOVED, angle
    return (Stand.TURNED if angle > TURNED else Stand.STILL), angle


def _there(one: View, other: View) -> bool:
    """Whether two pictures were taken from the same place."""
    return np.allclose(one.rotation, other.rotation) and np.allclose(one.position, other.position)
