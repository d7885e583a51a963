"""The skill that opens a leaf: take the bar of its handle, turn it, let go, look how far it is
open.
"""

import math
from itertools import chain

import numpy as np
import pinocchio as pin

from companion.languages.evidence import Sense
from companion.languages.facts import Kind, fact
from companion.skills import motions, moving, senses
from companion.skills.loop_messages import Close, Open, Until
from companion.skills.moving import joining, legs, line_ends
from companion.skills.senses import missed
from companion.skills.situation import MARGIN_M, Situation
from companion.skills.skill import (
    Cancelled,
    NotPossible,
    Skill,
    SkillRow,
    despite_cancel,
    empty,
    missing,
    replan,
)
from companion.tasks.open_door.done import DoorClaim, DoorKind, OpenDoor
from velma import names
from velma.kinematics import backing, ik
from velma.kinematics.frames import heading, transform
from velma.kinematics.tasks import APPROACH_SPEED, PULL_SPEED, RETREAT_SPEED, attaching, opening

FINGERS_NEEDED = 2  # one on each side of the bar hold it
SETTLE_S = 0.3  # as of a hand that grasps (tasks/take)
BESIDE_M = 0.2  # tolerated of the hand while the hinge leads it (estimate: twice the usual)
OPEN_BY, OPEN_SPEED = 0.5, 0.8  # [rad], [rad/s]: the bar is free before the hand moves (estimates)


def open_door(here: Situation, command: OpenDoor) -> Skill:
    """Open a leaf. Raises replan if it is unknown, out of reach, or is not seen open enough at the
    end.

    Raises missing if it is not where it was, empty if the hand closes on nothing.
    """
    if command.door not in here.seen:
        raise replan(fact(Kind.NOT_SEEN, command.door))
    side, door = command.side, command.door
    with attaching.allowed(here.world, (door, f"{side}_hand")):
        yield from _to_handle(here, side, command)
        before = here.seen[door]
        try:
            yield from _take(here, side, command)
            yield from _turn(here, side, command)
        except (Cancelled, NotPossible):
            yield from _let_go(here, side, command)
            raise
        yield from _let_go(here, side, command)
    yield from _judge(here, command, before)


def _to_handle(here: Situation, side: str, command: OpenDoor) -> Skill:
    """Go to the outermost point, look at the leaf, and go on to the handle."""
    watch = _middle(here.seen[command.door])
    way = _solved(here, side, command)
    sensed = yield motions.along(
        here, command.key, joining(here, way[0]), APPROACH_SPEED, watch=watch, settle_s=SETTLE_S,
        **motions.hand(side, motions.fingers(command.approach[0].fingers)),
    )  # fmt: skip
    here.set_fingers(side, command.approach[0].fingers)
    if (yield from missed(here, command.key, command.door, sensed)):
        raise missing(fact(Kind.NOT_WHERE_IT_WAS, command.door))
    way = _solved(here, side, command)
    yield motions.along(here, command.key, [*joining(here, way[0]), *way], APPROACH_SPEED)


def _middle(leaf: pin.SE3) -> np.ndarray:
    """The place of a leaf's hinge, at half its height: the head sees all of it and the cabinet from
    there.
    """
    return np.asarray(leaf.translation)


def _solved(here: Situation, side: str, command: OpenDoor) -> list[np.ndarray]:
    """Postures from the outermost point to the handle, by where the leaf is seen now."""
    poses = [here.seen[command.door] * transform(point.at) for point in command.approach]
    here.set_fingers(side, command.approach[-1].fingers)
    start = ik.solve(here.robot, side, poses[0], here.q, columns=names.ARM[side])
    if start is None:
        raise replan(fact(DoorKind.HANDLE_UNREACHED, side, command.door))
    # Torso and arm move, as in pl, which saw room for the turn.
    return [start, *chain.from_iterable(legs(here, side, start, poses[1:], torso=True))]


def _take(here: Situation, side: str, command: OpenDoor) -> Skill:
    """Close the fingers on the bar. They are not locked: whatever ends the act, the hand can
    open.
    """
    close = Close(command.squeeze, command.closed, command.speed, settle_s=SETTLE_S, lock=False)
    sensed = yield motions.still(here, command.key, until=Until.TOUCH, **motions.hand(side, close))
    touched = sum(sensed.touched[side])
    if touched < FINGERS_NEEDED:
        raise empty(fact(DoorKind.TOUCHED_HANDLE, side, command.door, touched))
    here.set_fingers(side, command.closed)


def _turn(here: Situation, side: str, command: OpenDoor) -> Skill:
    """Lead the handle about the hinge. Raises replan where the arm does not follow."""
    leaf = here.seen[command.door]
    begin = leaf.inverse() * here.robot.grip(here.q, side)
    end = begin if command.end is None else transform(command.end)
    for room in (MARGIN_M, 0.0):  # with some room where that is possible
        try:
            with attaching.room(here.world, room):
                path = opening.arc(
                    here.robot, here.world, side, here.q, command.door, leaf, command.turn, end
                )
            break
        except ik.PathBlocked as blocked:
            why = line_ends(blocked)
    else:
        raise replan(fact(DoorKind.NOT_TURNED, side, command.door, why))
    try:
        yield motions.along(
            here, command.key, path, PULL_SPEED, settle_s=SETTLE_S, tolerance_m=BESIDE_M
        )
    finally:
        here.place(
            command.door, opening.led(leaf, command.turn, begin, end, here.robot.grip(here.q, side))
        )


def _let_go(here: Situation, side: str, command: OpenDoor) -> Skill:
    """Open the fingers and draw the hand back, as far as there is room. A cancel changes
    nothing.
    """
    wide = command.approach[-1].fingers
    loose = (Open(OPEN_BY, OPEN_SPEED), motions.fingers(wide))
    yield from despite_cancel(
        lambda: motions.still(here, command.key, **motions.hand(side, loose[0]))
    )
    yield from despite_cancel(
        lambda: motions.still(here, command.key, **motions.hand(side, loose[1]))
    )
    here.set_fingers(side, wide)
    first, last = (transform(point.at) for point in (command.approach[0], command.approach[-1]))
    out = here.robot.grip(here.q, side) * last.inverse() * first
    path = backing.way_out(here.robot, here.world, side, here.q, [out])
    yield from despite_cancel(
        lambda: motions.along(here, command.key, moving.rest(here, path), RETREAT_SPEED)
    )


def _judge(here: Situation, command: OpenDoor, before: pin.SE3) -> Skill:
    """Look at the leaf. Raises replan if it is not seen, or is not open enough."""
    sensed = yield motions.still(
        here, command.key, watch=_middle(here.seen[command.door]), settle_s=SETTLE_S
    )
    if command.door not in {sight.name for sight in sensed.sights}:
        raise replan(fact(DoorKind.NOT_SEEN_TURNED, command.door))
    now, then = (heading(leaf.rotation[:, 0]) for leaf in (here.seen[command.door], before))
    done = math.copysign(1.0, command.turn) * math.remainder(now - then, math.tau)
    if done < command.least:
        raise replan(fact(DoorKind.TURNED_TOO_LITTLE, command.door, done, command.least))


SKILLS = (SkillRow(OpenDoor, open_door, tells={(DoorClaim.OPEN, Sense.EYES): senses.seen}),)
