"""Places behind an opening to the side, in a cabinet say: a thing goes in on the way on which it
would be taken out.

So a place that was found can also be emptied again with the same grasp.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from velma.kinematics import ik
from velma.kinematics.collision import World
from velma.kinematics.frames import shifted, standing
from velma.kinematics.robot import Robot
from velma.kinematics.tasks import attaching
from velma.kinematics.tasks.grasping import LIFT_M, Approach, GraspWay, Target, approaches
from velma.kinematics.tasks.placing import CLEARANCE_M, Placing, backwards, retreat_poses

# of one place, of all: where it can be reached, one in ten succeeds (measured, canonical scene)
LEAST, TRIES = 40, 240


# [m] straight on after the outermost step, the farthest that can be reached: an arm that went home
# with its fingers still behind the opening caught on it (one of two runs)
DRAWN_OUT_M = (0.15, 0.1, 0.05, 0.0)


@dataclass(frozen=True)
class Opening:
    """The furniture behind whose opening the places are; direction (3,) out of it, way [m] until a
    thing is out.
    """

    name: str
    out: np.ndarray
    distance: float

    @property
    def way(self) -> tuple[np.ndarray, np.ndarray]:
        """Offsets (3,) [m] from a place: in front of the opening, then over the place."""
        up = np.array([0.0, 0.0, LIFT_M])
        return up + self.out * self.distance, up


def insertions(
    robot: Robot,
    world: World,
    side: str,
    q: np.ndarray,
    name: str,
    opening: Opening,
    spots: Sequence[np.ndarray],
    ways: Sequence[GraspWay],
    rng: np.random.Generator,
    *,
    torso: tuple[float, float],
    wanted: int = 6,
) -> Iterator[tuple[str, Placing]]:
    """Yield grasps of `ways` with solved places, the thing's origin on one of `spots` (3,) [m], in
    their order.

    About `wanted`, at most a third of them on one of several spots. The thing may be in the hand or
    stand elsewhere in `world`; afterwards it is there again. It is turned about the vertical as the
    hand comes, and taken for round.
    """
    of_one, tries = max(1, wanted // min(3, len(spots))), max(LEAST, TRIES // len(spots))
    in_hand = {way.name: way.steps[-1][0] for way in ways}
    for spot in spots:
        place = standing(spot + np.array([0.0, 0.0, CLEARANCE_M]))
        target = Target(name, place, True, opening.out, opening.distance)
        with attaching.stood(world, name, place, side):
            found = approaches(
                robot, world, side, q, target, ways, rng, torso=torso, wanted=of_one, tries=tries
            )
            solved = [
                (
                    one.grasp,
                    _reversed(robot, world, side, target, opening.name, one, in_hand[one.grasp]),
                )
                for one in found
            ]
        yield from ((grasp, placing) for grasp, placing in solved if placing is not None)


def _reversed(
    robot: Robot,
    world: World,
    side: str,
    target: Target,
    support: str,
    approach: Approach,
    T_grip_object: pin.SE3,
) -> Placing | None:
    """Return the placing that undoes an approach; None if the hand cannot get away as after every
    release.
    """
    grip, way_down = target.pose * approach.steps[-1][0], approach.way_out[::-1]
    for distance in DRAWN_OUT_M:
        drawn = shifted(target.pose * approach.steps[0][0], target.out * distance)
        retreat = [*backwards(approach.steps), (grip.inverse() * drawn, approach.steps[0][1])]
        end = _drawn_out(
            robot, world, side, target.name, approach, [drawn, retreat_poses(grip, retreat)[-1]]
        )
        if end:
            way_back = [*approach.way_in[::-1], *end]
            return Placing(grip * T_grip_object, support, way_down[0], way_down, way_back, retreat)
    return None


def _drawn_out(
    robot: Robot, world: World, side: str, name: str, approach: Approach, poses: list[pin.SE3]
) -> list[np.ndarray]:
    """Return the way of the open hand from the outermost step through these grip poses; empty if
    there is none.
    """
    world.fingers(side, approach.steps[0][1])
    with attaching.allowed(world, (name, f"{side}_hand")):
        path = ik.lines(robot, side, approach.way_in[0], poses, world.free)
    if path is None or not world.free(path[-1]) or not ik.comfortable(robot, path[-1], side):
        return []
    return path[1:]
