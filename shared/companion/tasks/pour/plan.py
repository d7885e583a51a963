"""Planning to pour: the source is taken first, as in the paper's plan #1, and tilted over what
stands free.

Methods follow the published domain of the paper's authors (github.com/dseredyn/proghtn-backstream,
019fd34: pour, pourAt, takeSd, place, lookAt).

A subtask is a tuple of a name and arguments. Names that begin with `a_` are actions or conditions;
companion.planning.registry lists the general ones, the others are in the PLAN of another task.
`unfit`: this method does not apply, another one may; `failed`: it cannot be done, and the person is
told.
"""

import math
from collections.abc import Iterator
from functools import partial
from itertools import islice

from companion.languages import hfsm, wm
from companion.languages.facts import Fact, Kind, fact
from companion.languages.values import Side
from companion.planning.grasping import preferred
from companion.planning.methods import OTHER, Known, Subtasks
from companion.planning.registry import HANDS, Argument, Plan, each_hand
from companion.planning.steps import Geometry, Situation, Step, configured, move
from companion.tasks.pour.done import Pour, PourKind
from velma.kinematics.frames import transform
from velma.kinematics.tasks import BACK_SPEED, LOADED_SPEED, TILT_SPEED
from velma.kinematics.tasks.pouring import FIRST_TILT, LAST_TILT, TRIES, Stream, stream, tiltings

# most that a held source is tilted on the way; from runs with the true robot model
HELD_TILT = math.radians(40.0)
HELD_TRIES = 4 * TRIES
"""Samples of a tilt. There is only one grasp of a source that is held already, so more are tried:
in env2 seed 113, beside the box before the bowl, none of 1500 samples was a tilt, and some of 6000
were.
"""
TILTINGS = 8  # estimate: the quickest of this number of tilts is chosen
HOLD_S = 2.0  # at the last tilt; from the same runs
SAMPLES, AT_ONCE, ENOUGH = 1500, 30, 2
"""Samples (a grasp and a tilt) for each hand at most; the hands take turns of AT_ONCE, until one
has ENOUGH that succeed. In 30 of 30 runs on 15 seeds of env2 this found the hand that can pour, in
0.05 to 0.55 s (measured on a busy machine).
"""


def into_itself(source: str, destination: str) -> Fact | None:
    """Why nothing is poured, if both are the same thing."""
    return fact(PourKind.INTO_ITSELF, source) if source == destination else None


# --- in which order -------------------------------------------------------------------------------


def pour_held(known: Known, state: str, source: str, destination: str) -> Subtasks | None:
    """Tilt a source that is held over a destination that stands free and was seen there."""
    side = known.facts.holder(state, source)
    if not side:
        return known.unfit(fact(Kind.NO_HAND_HOLDS, source))
    return (
        [("a_pour_held", source, destination, side)]
        if _stands_free(known, state, destination)
        else None
    )


def pour_into_standing(known: Known, state: str, source: str, destination: str) -> Subtasks | None:
    """Take the source and tilt it over a destination that stands free and was seen there."""
    if holder := known.facts.holder(state, source):
        return known.unfit(fact(Kind.HOLDS, holder, source))
    if not _stands_free(known, state, destination):
        return None
    return [("take_and_pour", source, destination)]


def pour_into_held(known: Known, state: str, source: str, destination: str) -> Subtasks | None:
    """Put a destination that is held down, look at it, plan again."""
    if known.facts.holder(state, destination) is None:
        return known.unfit(fact(Kind.NO_HAND_HOLDS, destination))
    return [("set_down", destination), ("localize", destination)]


def pour_into_unseen(known: Known, state: str, source: str, destination: str) -> Subtasks | None:
    """Look at a destination that was put down and not seen since, plan again."""
    if holder := known.facts.holder(state, destination):
        return known.unfit(fact(Kind.HOLDS, holder, destination))
    if known.facts.exact(state, destination):
        return known.unfit(fact(Kind.SEEN_WHERE_IT_STANDS, destination))
    return [("localize", destination)]


def pour_taking_both(
    known: Known, state: str, first: Side, source: str, destination: str
) -> Subtasks | None:
    """Take the source with one hand and the destination with the other, then put the destination
    down.
    """
    if holder := known.facts.holder(state, destination):
        return known.unfit(fact(Kind.HOLDS, holder, destination))
    if not known.facts.inside(state, destination) and known.facts.looked_into(state, destination):
        return known.unfit(fact(Kind.STANDS_FREE, destination))
    if (holder := known.facts.holder(state, source)) not in (None, first):
        return known.unfit(fact(Kind.HOLDS, holder, source))
    taken = [("take", source, first), ("a_carry", first), ("take", destination, OTHER[first])]
    return [*taken, ("set_down", destination), ("localize", destination)]


def pour_taken_again(known: Known, state: str, source: str, destination: str) -> Subtasks | None:
    """Put the source down, and take it by another grasp: as it is held it cannot be tilted
    there.
    """
    if known.facts.holder(state, source) is None:
        return known.unfit(fact(Kind.NO_HAND_HOLDS, source))
    if not _stands_free(known, state, destination):
        return None
    return [("set_down", source), ("a_confirm", source), ("take_and_pour", source, destination)]


def pour_with_likely(
    known: Known, state: str, hand: Side, source: str, destination: str
) -> Subtasks | None:
    """Take the source and tilt it with the hand that is likely to have a way."""
    return _pour_with(known, state, hand, source, destination, "a_likely")


def pour_with_other(
    known: Known, state: str, hand: Side, source: str, destination: str
) -> Subtasks | None:
    """Take the source and tilt it with the other hand."""
    return _pour_with(known, state, hand, source, destination, "a_not_likely")


def _pour_with(
    known: Known, state: str, hand: Side, source: str, destination: str, which: str
) -> Subtasks | None:
    if held := known.facts.in_hand(state, hand):
        known.failed(fact(Kind.HOLDS, hand, held))
        return None
    tilted = ("a_pour", source, destination, hand)
    return [(which, source, destination, hand), ("take", source, hand), tilted]


def _stands_free(known: Known, state: str, name: str) -> bool:
    """Whether the thing was seen where it stands, is not inside another one, and can be looked
    into: nobody could tell whether content arrived in it.
    """
    if holder := known.facts.holder(state, name):
        known.unfit(fact(Kind.HOLDS, holder, name))
    elif known.facts.inside(state, name):
        known.unfit(fact(Kind.INSIDE_ANOTHER, name))
    elif not known.facts.looked_into(state, name):
        known.unfit(fact(PourKind.TOO_HIGH, name))
    elif not known.facts.exact(state, name):
        known.unfit(fact(Kind.PUT_DOWN_UNSEEN, name))
    else:
        return True
    return False


# --- by which hand --------------------------------------------------------------------------------


def likely(geometry: Geometry, state: str, source: str, destination: str, hand: Side) -> bool:
    """Whether samples of grasps and tilts find a way for this hand sooner than for the other one.

    They are tried once for each place of the destination, with nothing but that and the furniture
    in the way: other things may be put aside.
    """
    at = geometry.ask(wm.ObjectPose(state=state, object=destination), wm.PoseOf).pose
    key = (source, destination, at)
    if key not in geometry.pouring:
        geometry.pouring[key] = _likely(geometry, state, source, destination)
    geometry.unfit(fact(Kind.OTHER_HAND_WANTED, OTHER[hand]))
    return geometry.pouring[key] is hand


def not_likely(geometry: Geometry, state: str, source: str, destination: str, hand: Side) -> bool:
    """Whether the other hand is the likely one."""
    return not likely(geometry, state, source, destination, hand)


def _likely(geometry: Geometry, state: str, source: str, destination: str) -> Side:
    """The hand that is likely to pour, the preferred one if none is likely."""
    here = geometry.at(state)
    for other in geometry.facts.moveable(state):
        if other not in (source, destination, *(held.object for held in here.held.values())):
            here.world.remove(other)
    samples = {hand: _samples(geometry, here, source, destination, hand) for hand in HANDS}
    found = dict.fromkeys(HANDS, 0)
    for _ in range(SAMPLES // AT_ONCE):
        for hand in HANDS:
            found[hand] += sum(islice(samples[hand], AT_ONCE))
        if max(found.values()) >= ENOUGH:
            break
    return max(HANDS, key=found.__getitem__)


def _samples(
    geometry: Geometry, here: Situation, source: str, destination: str, hand: Side
) -> Iterator[bool]:
    """Yield, for some grasp and tilt after the other, whether the hand can pour so."""
    known = preferred(geometry, here.state, source)
    flow = _stream(geometry, here.state, source, destination)
    poses = [transform(grasp.steps[-1].pose) for grasp in known]
    rng = geometry.rng("hands", source, destination, hand)
    while True:
        k = int(rng.integers(len(known)))
        here.world.attach(source, hand, poses[k])
        here.world.fingers(hand, known[k].closed)
        yield any(tiltings(geometry.robot, here.world, hand, here.q, poses[k], flow, rng, tries=1))


# --- the step that tilts --------------------------------------------------------------------------


def pour(
    geometry: Geometry, state: str, source: str, destination: str, side: Side, tries: int = TRIES
) -> Step | None:
    """The step that moves the held source beside the destination, tilts it, holds, and turns it
    back.
    """
    here = geometry.at(state)
    flow = _stream(geometry, state, source, destination)
    rng = geometry.rng("pour", source, destination)
    held = here.held[side].T_grip_object
    found = tiltings(geometry.robot, here.world, side, here.q, held, flow, rng, tries=tries)
    while some := list(islice(found, TILTINGS)):
        reached = geometry.free_motion(
            here, side, [t.path[0] for t in some], largest_tilt=HELD_TILT
        )
        if reached is not None:
            tilting, way = some[reached[0]], reached[1]
            command = Pour(
                key="",
                side=side,
                source=source,
                destination=destination,
                azimuth=tilting.azimuth,
                spin=tilting.spin,
                tilts=(FIRST_TILT, LAST_TILT),
                hold=HOLD_S,
                empty_mass=geometry.model(state, source).mass,
            )
            poured = wm.Poured(source=source, destination=destination)
            changes = (poured, *configured(side, tilting.path[0]))
            duration = way.duration + geometry.duration(tilting.path, TILT_SPEED) + HOLD_S
            duration += geometry.duration(tilting.path, BACK_SPEED)
            commands = (move(side, way, LOADED_SPEED), command)
            return Step(hfsm.Step("pour", (source, destination)), commands, changes, duration)
    geometry.failed(fact(PourKind.NO_POUR, side, source, destination))
    return None


def _stream(geometry: Geometry, state: str, source: str, destination: str) -> Stream:
    """The geometry of the tilt, from km."""
    rim = geometry.ask(wm.ObjectHole(state=state, object=destination), wm.Hole)
    opening = geometry.ask(wm.ObjectHole(state=state, object=source), wm.Hole)
    return stream(geometry.pose(state, destination), rim.centre, rim.radius, opening.centre)


PLAN = Plan(
    tasks={"pour": (Argument.THING, Argument.THING)},
    refused={"pour": into_itself},
    methods={
        "pour": (
            "after_opening",
            pour_held,
            pour_into_held,
            pour_into_unseen,
            pour_into_standing,
            each_hand(pour_taking_both),
            pour_taken_again,
            "after_arms_home",
        ),
        "take_and_pour": (each_hand(pour_with_likely), each_hand(pour_with_other)),
    },
    actions={"a_pour": pour, "a_pour_held": partial(pour, tries=HELD_TRIES)},
    conditions={"a_likely": likely, "a_not_likely": not_likely},
)
