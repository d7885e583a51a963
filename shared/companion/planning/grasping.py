"""Which grasps of a thing can be reached where it stands, and the primitive step that takes it by
one of them.
"""

from companion.languages import hfsm, rc, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.models import HANDLE, LYING
from companion.planning import steps
from companion.planning.methods import fallen
from companion.planning.steps import Situation, configured, on_wire
from velma.kinematics.frames import transform
from velma.kinematics.tasks import APPROACH_SPEED, LIFT_SPEED, LOADED_SPEED
from velma.kinematics.tasks.grasping import LIFT_M, Approach, GraspWay, Target, approaches

GRASPS = 8  # estimate: found in 0.1 s
# [m] height below which no hand reaches a thing: IK 0 of 15 on the floor, from 0.30 to 0.45 m some
FLOOR_M = 0.3
# [rad] range of the torso at a grasp; same runs; never tried for a box (face)
ANY_TORSO = (-0.9, 0.9)
# [rad], same runs
TORSO = {"side": (-0.7, 0.7), "rim_two_inside": (-1.0, 1.0), "rim_one_inside": (-1.0, 1.0)}


def take(
    geometry: steps.Geometry,
    state: str,
    name: str,
    side: Side,
    *number: str,
    only: frozenset[str] | None = None,
) -> steps.Step | None:
    """The step that grasps an object where it stands and pulls it out; the hand must be empty.

    `number`: of the try, each of which may choose another grasp. `only`: of these grasps, if any.
    """
    here = geometry.at(state)
    known = [one for one in preferred(geometry, state, name) if only is None or one.id in only]
    target = _target(geometry, state, name, known[0].out)
    found = _approaches(geometry, here, side, target, known, number, GRASPS)
    if not found:
        return None
    reached = geometry.free_motion(here, side, [a.way_in[0] for a in found])
    if reached is None:
        geometry.failed(fact(Kind.NO_WAY_TO, side, name))
        return None
    approach, way = found[reached[0]], reached[1]
    query = wm.GraspDefinition(state=here.state, object=name, grasp=approach.grasp)
    grasp = geometry.ask(query, wm.Grasps).grasps[0]
    close = rc.Grasp(
        key="",
        side=side,
        object=name,
        grasp=grasp.id,
        approach=steps.approach_points(approach.steps),
        squeeze=grasp.squeeze,
        speed=grasp.speed,
        mass=geometry.model(here.state, name).mass,
    )
    x, y, z = (float(v) for v in target.out * target.distance)
    segments = (rc.Segment((0.0, 0.0, LIFT_M), LIFT_SPEED), rc.Segment((x, y, z), LOADED_SPEED))
    pull = rc.MoveCartesian(key="", side=side, segments=segments)
    in_grip = on_wire(approach.steps[-1][0].inverse())
    changes = (
        wm.Grasped(object=name, side=side, grasp=grasp.id, pose=in_grip),
        *configured(side, approach.way_out[-1], grasp.closed),
    )
    duration = way.duration + geometry.duration(approach.way_in, APPROACH_SPEED) + steps.CLOSE_S
    duration += geometry.duration(approach.way_out, LOADED_SPEED)
    commands = (steps.move(side, way, steps.free_speed(here), approach.steps[0][1]), close, pull)
    return steps.Step(hfsm.Step("take", (name,)), commands, changes, duration)


def reachable(geometry: steps.Geometry, state: str, name: str, side: Side) -> bool:
    """Whether a thing can be grasped with a hand and pulled out at all; looked for once in a
    state.
    """
    key = (state, name, side)
    if key not in geometry.reachable:
        known = preferred(geometry, state, name)
        target = _target(geometry, state, name, known[0].out)
        ways = _approaches(geometry, geometry.at(state), side, target, known, (), 1)
        geometry.reachable[key] = bool(ways)
    return geometry.reachable[key]


def graspable(
    geometry: steps.Geometry, here: Situation, side: Side, name: str, known: list[wm.GraspDef]
) -> bool:
    """Whether a thing can be grasped and pulled out by one of its known grasps, in the collision
    world of `here`.
    """
    target = _target(geometry, here.state, name, known[0].out)
    return bool(_approaches(geometry, here, side, target, known, (), 1))


def _approaches(
    geometry: steps.Geometry,
    here: Situation,
    side: Side,
    target: Target,
    known: list[wm.GraspDef],
    number: tuple[str, ...],
    wanted: int,
) -> list[Approach]:
    """Solved grasps; none, with the reason noted, if there are none."""
    kind, how = known[0].kind, fallen(target.name, target.pose)
    if kind == HANDLE:
        geometry.failed(fact(Kind.PERSON_NEEDED, fact(Kind.HANGS_ON_A_HINGE, target.name)))
        return []
    if target.pose.translation[2] < FLOOR_M:
        geometry.failed(fact(Kind.ON_THE_FLOOR, target.name))
        return []
    if how and kind != LYING:
        geometry.failed(fact(Kind.PERSON_NEEDED, how))
        return []
    found = approaches(
        geometry.robot, here.world, side, here.q, target, ways(known),
        geometry.rng("take", target.name, side, *number), torso=TORSO.get(kind, ANY_TORSO),
        wanted=wanted,
    )  # fmt: skip
    if not found:
        geometry.failed(fact(Kind.NO_GRASP, side, target.name, (how,) if how else ()))
    return found


def preferred(geometry: steps.Geometry, state: str, name: str) -> list[wm.GraspDef]:
    """The known grasps of an object of the same kind as its first one."""
    known = geometry.ask(wm.GraspSet(state=state, object=name), wm.Grasps).grasps
    return [g for g in known if g.kind == known[0].kind]


def ways(known: list[wm.GraspDef]) -> list[GraspWay]:
    """Grasps of WM as those of velma.kinematics."""
    return [GraspWay(g.id, tuple((transform(s.pose), s.fingers) for s in g.steps)) for g in known]


def _target(geometry: steps.Geometry, state: str, name: str, distance: float) -> Target:
    """An object as it is grasped. It leaves its place out of the opening of what it is in; else
    towards the robot.
    """
    pose, model = geometry.pose(state, name), geometry.model(state, name)
    if geometry.facts.inside(state, name):
        out = geometry.outwards(state, geometry.facts.support(state, name))
    else:
        out = steps.horizontal(-pose.translation)
    return Target(name, pose, model.symmetric, out, distance)
