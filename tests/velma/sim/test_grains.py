"""Grains that spin and grains that only slide: how they move, what is counted, what is kept of
them.
"""

import math
from functools import cache

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from velma.model.kinds import Model, objects
from velma.model.scene import Content, Scene, SceneObject, load
from velma.model.scene_xml import grain_name, scene_xml
from velma.sim.backend import no_command
from velma.sim.mujoco_backend import MujocoBackend, compiled
from velma.sim.truth import TruthReader

RADIUS, MASS = objects()["grain"]["radius"], objects()["grain"]["mass"]
JAR, BOWL = "jar_1", "bowl_1"
G, ROLLS_S, STEPS = 9.81, 0.4, 200
AWAY = np.array([5.0, -3.0, RADIUS])  # on the floor, where nothing else is
FRICTION = objects()["contact"]["furniture"]["friction"][0]


@cache
def alone(spin: bool) -> mujoco.MjModel:
    """A scene with one grain, whose jar stands far from AWAY."""
    jar = SceneObject(JAR, Model.JAR, (3, -3, 0.101))
    return compiled(Scene("one", (jar,), Content(grains=1, spin=spin)))


def put(model: mujoco.MjModel, data: mujoco.MjData, name: str, at: np.ndarray) -> None:
    """Put a grain somewhere: sliding ones count from where they begin."""
    body = model.body(name)
    first = model.jnt_qposadr[body.jntadr[0]]
    free = model.jnt_type[body.jntadr[0]] == mujoco.mjtJoint.mjJNT_FREE
    data.qpos[first : first + 3] = at if free else at - body.pos


def rolled(
    spin: bool, slope: float, speed: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return speed (3,), turning (3,) and rotation (3, 3) of a grain that was on a slope down x for
    ROLLS_S.

    `speed`: at first, along x, rolling.
    """
    model = alone(spin)
    data, name = mujoco.MjData(model), grain_name(0)
    model.opt.gravity[:] = G * math.sin(slope), 0.0, -G * math.cos(slope)
    put(model, data, name, AWAY)
    first = model.jnt_dofadr[model.body(name).jntadr[0]]
    data.qvel[first] = speed
    if spin:
        data.qvel[first + 4] = speed / RADIUS
    mujoco.mj_step(model, data, nstep=STEPS)
    both = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, model.body(name).id, both, 0)
    return both[3:], both[:3], data.body(name).xmat.reshape(3, 3).copy()


def slows(slope: float) -> float:
    """Return what a rolling ball loses to rolling friction, as an acceleration along x [m/s^2]."""
    return 5 / 7 * G * math.cos(slope) * objects()["spin"]["rolling"] / RADIUS


@settings(max_examples=15, deadline=None)
@given(slope=st.floats(0.08, 0.4))
def test_a_grain_that_spins_rolls_down_a_slope(slope: float) -> None:
    """As a ball without slip does, which keeps 5/7 of the pull for its way; one that does not spin
    stays.
    """
    speed, turning, _ = rolled(True, slope)
    assert turning * RADIUS == pytest.approx([0.0, speed[0], 0.0], abs=0.06 * speed[0])
    expected = (5 / 7 * G * math.sin(slope) - slows(slope)) * ROLLS_S
    assert speed[0] == pytest.approx(expected, rel=0.05)
    speed, turning, rotation = rolled(False, slope)
    assert np.abs(speed).max() < 1e-3, "the slope is less than its friction"
    assert not turning.any()
    assert (rotation == np.eye(3)).all()


@settings(max_examples=15, deadline=None)
@given(speed=st.floats(0.2, 0.6))
def test_a_rolling_grain_is_slowed_by_the_friction_of_rolling(speed: float) -> None:
    """On the flat floor, as soybeans are."""
    after, turning, _ = rolled(True, 0.0, speed)
    assert after[0] == pytest.approx(speed - slows(0.0) * ROLLS_S, rel=0.05)
    assert turning[1] * RADIUS == pytest.approx(after[0], rel=0.05)


def test_a_grain_that_slides_does_not_turn_on_a_steep_slope() -> None:
    """Where it is steeper than its friction."""
    speed, turning, rotation = rolled(False, 0.9)
    expected = G * (math.sin(0.9) - FRICTION * math.cos(0.9)) * ROLLS_S
    assert speed[0] == pytest.approx(expected, rel=0.05)
    assert not turning.any()
    assert (rotation == np.eye(3)).all()


@pytest.mark.parametrize("friction", [None, 1.2])
def test_grains_that_spin_rub_in_all_ways_on_grains_jar_and_bowl(friction: float | None) -> None:
    """They slide as those that do not; about the normal and in rolling they rub too. Their inertia
    is that of a ball.
    """
    model = compiled(replace(load(), content=Content(friction=friction, spin=True)))
    turns = [objects()["spin"]["about_normal"], objects()["spin"]["rolling"]]
    inner = objects()["contact"]["inner"]["friction"][0] if friction is None else friction
    body = model.body(grain_name(0))
    np.testing.assert_allclose(body.inertia, 0.4 * MASS * RADIUS**2)
    grain = body.geomadr[0]
    assert model.geom_condim[grain] == model.geom(f"{JAR}_bottom").condim[0] == 6
    np.testing.assert_allclose(model.geom_friction[grain], [0.3, *turns])
    np.testing.assert_allclose(model.geom(f"{JAR}_inner_0").friction, [inner, *turns])
    assert model.geom(f"{JAR}_side").condim[0] == 3


def test_nothing_spins_where_nothing_is_said() -> None:
    """The world of a scene without the word is that of `spin = false`."""
    whole = load()
    assert scene_xml(whole) == scene_xml(replace(whole, content=replace(whole.content, spin=False)))
    free = mujoco.mjtJoint.mjJNT_FREE
    counts = [(MujocoBackend(one).model.jnt_type == free).sum() for one in (whole, _spinning(30))]
    assert counts == [2, 32]


@pytest.fixture(params=[False, True], ids=["sliding", "spinning"])
def robot(request: pytest.FixtureRequest) -> MujocoBackend:
    """The canonical scene, its pile settled."""
    robot = MujocoBackend(replace(load(), content=Content(spin=request.param)))
    _run(robot, 200)
    return robot


def _spinning(grains: int) -> Scene:
    return replace(load(), content=Content(grains=grains, spin=True))


def _run(robot: MujocoBackend, steps: int) -> None:
    for _ in range(steps):
        robot.step(no_command())


def test_truth_counts_the_grains_where_they_are(robot: MujocoBackend) -> None:
    """All in the jar at first; a grain put into the bowl is counted there; one on the floor
    nowhere.
    """
    truth = TruthReader(robot)
    first = truth.read()
    assert first.grains_in == {JAR: 30, BOWL: 0}
    assert max(first.tilt_deg.values()) < 0.5
    assert not first.furniture_touched
    put(robot.model, robot.data, grain_name(0), np.add(first.at[BOWL], (0, 0, 0.03)))
    put(robot.model, robot.data, grain_name(1), np.array([0.0, -1.5, 0.13]))
    mujoco.mj_step1(robot.model, robot.data)
    after = truth.read()
    assert after.grains_in == {JAR: 28, BOWL: 1}
    np.testing.assert_allclose(after.grains_at[1], (0.0, -1.5, 0.13))


def test_a_restored_pile_moves_on_as_it_would_have(robot: MujocoBackend) -> None:
    """In motion, in the jar and in the air: the same bits, and the same grains in jar and bowl."""
    at = np.add(TruthReader(robot).read().at[BOWL], (0.06, 0, 0.12))
    put(robot.model, robot.data, grain_name(7), at)
    _run(robot, 60)
    assert np.abs(robot.data.qvel).max() > 0.1
    other = MujocoBackend(robot.scene)
    other.restore(robot.save())
    for _ in range(150):
        assert other.configuration().tobytes() == robot.configuration().tobytes()
        assert other.data.qvel.tobytes() == robot.data.qvel.tobytes()
        _run(robot, 1)
        _run(other, 1)
    told, again = TruthReader(robot).read(), TruthReader(other).read()
    assert told == again
    assert told.grains_in == {JAR: 29, BOWL: 1}


def test_a_pile_comes_to_rest(robot: MujocoBackend) -> None:
    """None is pressed through the jar, and none creeps on."""
    _run(robot, 400)
    assert TruthReader(robot).grains_in(JAR) == 30
    before = robot.data.xpos.copy()
    _run(robot, 100)
    assert np.abs(robot.data.xpos - before).max() < 1e-3
