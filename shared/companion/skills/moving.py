"""Skills that move an arm: along a planned joint path, in a straight line, and home."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress

import numpy as np
import pinocchio as pin

from companion.languages import rc
from companion.languages.facts import Fact, Facts, Kind, fact
from companion.skills import motions
from companion.skills.situation import MARGIN_M, Situation
from companion.skills.skill import NotPossible, Skill, SkillRow, replan
from velma import names
from velma.kinematics import backing, ik, motion
from velma.kinematics.frames import shifted, tilt
from velma.kinematics.tasks import EMPTY_SPEED, LOADED_SPEED, RETREAT_SPEED, attaching
from velma.kinematics.tasks.carrying import FINGERS, homes, upright

# [m] tried in turn. In task runs hands were up to 24 mm beside their path, mostly 10; poses seen
# are wrong by 4 mm.
ROOM_M = (0.02, 0.01, MARGIN_M)
ATTEMPTS = 2  # trees for each goal: any path will do, and ta waits (estimate)


def free_path(
    here: Situation,
    side: str,
    goals: Iterable[np.ndarray],
    speed: float,
    keep: motion.Keep | None = None,
) -> list[np.ndarray] | None:
    """A free path to the first possible of `goals` (15,), with the largest margin possible, or
    None.
    """
    wanted = list(goals)
    for margin in ROOM_M:
        with attaching.room(here.world, margin):
            for goal in wanted:
                found = motion.plan(
                    here.robot,
                    here.world,
                    side,
                    here.q,
                    goal,
                    keep=keep,
                    tool_speed=speed,
                    attempts=ATTEMPTS,
                )
                if found is not None:
                    return found.path
    return None


def rest(here: Situation, path: list[np.ndarray]) -> list[np.ndarray]:
    """The rest of a path from the present posture on."""
    return path[_reached(here, path) :] if path else []


def back(here: Situation, path: list[np.ndarray]) -> list[np.ndarray]:
    """The way from the present posture back to the begin of a path that was followed as far as
    here.
    """
    return path[: _reached(here, path) + 1][::-1]


def _reached(here: Situation, path: list[np.ndarray]) -> int:
    """Which posture of a path is nearest to the present one."""
    return int(np.argmin([np.abs(q - here.q).max() for q in path]))


# --- Skills that move an arm: along a planned joint path, in a straight line, and home ------------


JOIN_STEP = 0.05  # [rad] between two states checked on the way to a path
NEAR = 1e-4  # [rad]
TILTED_MORE = 0.05  # [rad] than on the planned path a held thing may tilt on another one (estimate)
Accept = Callable[[np.ndarray], bool] | None


def move_joint(here: Situation, command: rc.MoveJoint) -> Skill:
    """Move to the start of the planned path in a checked straight segment, then follow it.

    Where it goes into something, another one is taken: what was seen again since the path was
    planned is up to 8 mm elsewhere, and plans keep off by 6 mm. The fingers move on the way, or at
    its end where they would meet something. Raises replan if there is none.
    """
    columns = names.COLUMNS[command.side]
    path = []
    for point in command.path:
        q = here.q.copy()
        q[columns] = point
        path.append(q)
    path = [*joining(here, path[0]), *path]
    side, bent = command.side, command.fingers if command.side not in here.held else None
    later = False
    try:
        path = _clear(here, path, side, bent, command.speed)
    except NotPossible:  # beside a door, fingers that close meet it
        if bent is None or not _free(here, path[-1], side, bent):
            raise
        path, later = _clear(here, path, side, None, command.speed), True
    fingers = {} if bent is None else motions.hand(side, motions.fingers(bent))
    if bent is not None and not later:
        here.set_fingers(side, bent)
    watch = _watched(here, path[-1])
    yield motions.along(
        here, command.key, path, command.speed, watch=watch, **({} if later else fingers)
    )
    if bent is not None and later:
        yield motions.still(here, command.key, **fingers)
        here.set_fingers(side, bent)


def _clear(
    here: Situation, path: list[np.ndarray], side: str, bent: float | None, speed: float
) -> list[np.ndarray]:
    """The path, or one of ex's own to its end where it goes into something. Raises replan if there
    is none.

    `bent`: angle of the fingers on it [rad], None: as they are.
    """
    here.world.fingers(side, here.fingers[side] if bent is None else bent)
    try:
        accept = _outwards(here, path[0])
        met = next((state for state in path if not accept(state)), None)
        if met is None:
            return path
        why, keep = _in_the_way(here, met), None
        if side in here.held:
            T_grip_object = here.held[side].T_grip_object
            tilted = max(tilt(here.robot.grip(state, side) * T_grip_object) for state in path)
            keep = upright(here.robot, side, T_grip_object, tilted + TILTED_MORE)
        another = free_path(here, side, path[-1:], speed, keep)
    finally:
        here.world.fingers(side, here.fingers[side])
    if another is None:
        raise replan(*why)
    return another


def _free(here: Situation, q: np.ndarray, side: str, bent: float) -> bool:
    """Whether a posture is free with the fingers bent so [rad]."""
    here.world.fingers(side, bent)
    try:
        return here.world.free(q)
    finally:
        here.world.fingers(side, here.fingers[side])


def _watched(here: Situation, q: np.ndarray) -> np.ndarray | None:
    """Where the head looks after a free motion: at what was put down and not seen since, else at
    the held object nearest to the middle, if any.
    """
    if here.put:
        return np.asarray(next(iter(here.put.values())).translation)
    held = [here.robot.grip(q, side) * h.T_grip_object for side, h in here.held.items()]
    return min((p.translation for p in held), key=lambda p: abs(p[1]), default=None)


def joining(here: Situation, goal: np.ndarray) -> list[np.ndarray]:
    """The straight, checked joint path from the set-point to q (15,). Raises replan if it is not
    free.
    """
    if np.abs(goal - here.q).max() < NEAR:
        return []
    states = between(here, goal)
    for state in states:
        if not here.world.free(state):
            raise replan(*_in_the_way(here, state))
    return states


def between(here: Situation, goal: np.ndarray) -> list[np.ndarray]:
    """The straight joint path from the set-point to q (15,), in small steps, unchecked."""
    way = goal - here.q
    steps = max(1, int(np.ceil(np.abs(way).max() / JOIN_STEP)))
    return [here.q + way * k / steps for k in range(1, steps + 1)]


def _in_the_way(here: Situation, q: np.ndarray) -> Facts:
    met = tuple(fact(Kind.WAY_NOT_FREE, a, b) for a, b, _ in here.world.touching(q)[:2])
    return met or (fact(Kind.WAY_BLOCKED),)


def move_cartesian(here: Situation, command: rc.MoveCartesian) -> Skill:
    """Move the grip straight by each segment. The first is not checked, since it lifts an object
    off its support.
    """
    for index, segment in enumerate(command.segments):
        target = shifted(here.robot.grip(here.q, command.side), np.array(segment.offset))
        accept = here.world.free if index else None
        path = straight(here, command.side, here.q, target, accept)
        yield motions.along(
            here, command.key, path, segment.speed, watch=target.translation if index else None
        )


def straight(
    here: Situation,
    side: str,
    q: np.ndarray,
    target: pin.SE3,
    accept: Accept = None,
    *,
    torso: bool = False,
) -> list[np.ndarray]:
    """Postures on the straight line of the grip from q (15,) to `target`. Raises replan if it is
    blocked.

    The torso moves only if the arm alone does not reach; with `torso` it moves where that is
    possible. A line that is blocked by the margin alone, or leads out of what touches already, is
    taken all the same: poses are seen again at a grasp, and differ by more than the margin.
    """
    moving = (names.ARM[side], names.COLUMNS[side])
    for columns in reversed(moving) if torso else moving:
        with suppress(ik.PathBlocked):
            return ik.line(here.robot, side, q, target, accept=accept, columns=columns)[1:]
    try:
        outwards = None if accept is None else _outwards(here, q)
        return ik.line(here.robot, side, q, target, accept=outwards, columns=names.COLUMNS[side])[
            1:
        ]
    except ik.PathBlocked as blocked:
        raise replan(fact(Kind.NOT_STRAIGHT, side, line_ends(blocked))) from None


def line_ends(blocked: ik.PathBlocked) -> Fact:
    """Why a straight line of the grip cannot be followed to its end, and where it ends."""
    return fact(Kind.LINE_ENDS, 100.0 * blocked.fraction, blocked.reason)


def legs(
    here: Situation, side: str, q: np.ndarray, poses: Sequence[pin.SE3], *, torso: bool = False
) -> list[list[np.ndarray]]:
    """A straight, checked path of the grip from q (15,) to the first pose, and one to each further
    pose.

    `torso`: as of straight. Raises replan if one is blocked.
    """
    found: list[list[np.ndarray]] = []
    for pose in poses:
        found.append(straight(here, side, q, pose, here.world.free, torso=torso))
        q = found[-1][-1]
    return found


def _outwards(here: Situation, q: np.ndarray) -> Callable[[np.ndarray], bool]:
    """Whether nothing overlaps in a state but what did in the one before, and no deeper; begins at
    q (15,).
    """
    deep = {(a, b): d for a, b, d in here.world.touching(q)}

    def accept(state: np.ndarray) -> bool:
        nonlocal deep
        now = {(a, b): d for a, b, d in here.world.touching(state)}
        if any(d < min(0.0, deep.get(pair, 0.0)) for pair, d in now.items()):
            return False
        deep = now
        return True

    return accept


def home(here: Situation, command: rc.Home) -> Skill:
    """Bring an empty arm to its start posture by a path planned now, after backing away from
    contacts.
    """
    side = command.side
    if side in here.held:
        raise replan(fact(Kind.PUT_DOWN_FIRST, side, here.held[side].object))
    speed = LOADED_SPEED if here.held else EMPTY_SPEED
    aside = backing.out_of_touch(here.robot, here.world, side, here.q)
    if len(aside) > 1:
        yield motions.along(here, command.key, aside, RETREAT_SPEED)
    path = free_path(here, side, homes(here.q, side), speed)
    if path is None:
        raise replan(fact(Kind.NO_WAY_HOME, side))
    yield motions.along(
        here, command.key, path, speed, watch=_watched(here, path[-1]) if here.put else None
    )
    here.set_fingers(side, FINGERS)
    yield motions.still(here, command.key, **motions.hand(side, motions.fingers(FINGERS)))


SKILLS = (
    SkillRow(rc.MoveJoint, move_joint, carries=True),
    SkillRow(rc.MoveCartesian, move_cartesian, carries=True),
    SkillRow(rc.Home, home),
)
