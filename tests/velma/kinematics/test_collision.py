"""The collision world gives MuJoCo's verdicts, and its groups follow what is held and allowed."""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from velma import names
from velma.errors import VelmaError
from velma.kinematics.collision import UnknownThing, World
from velma.kinematics.frames import standing
from velma.kinematics.robot import Robot
from velma.kinematics.shapes import Box, NoShape, Sphere
from velma.model.build import SHAPE_GROUP

OBJECTS = ("jar_1", "bowl_1")
Furnish = Callable[[], World]
MARGIN, UNCERTAIN = 0.006, 0.0005  # m
BESIDE = 0.003  # m


class Judge:
    """MuJoCo's opinion: the nearest contact of the scene, with objects in hands and fingers bent as
    told.
    """

    def __init__(self, robot: Robot, model: mujoco.MjModel) -> None:
        self.robot, self.model = robot, model
        self.model.geom_margin[:] = 0.02
        self.model.body_margin[:] = 0.02  # of the broad phase, compiled from those of the geoms
        self.model.geom_gap[:] = 0.0
        self.data = mujoco.MjData(self.model)
        self.columns = [self.model.joint(name).qposadr[0] for name in names.BODY]
        self.held: dict[str, tuple[str, pin.SE3]] = {}

    def fingers(self, side: str, angle: float) -> None:
        """Bend all fingers of a hand."""
        for inner, outer in zip(names.PROXIMAL[side], names.DISTAL[side], strict=True):
            self.data.qpos[self.model.joint(inner).qposadr[0]] = angle
            self.data.qpos[self.model.joint(outer).qposadr[0]] = angle / 3

    def nearest(self, q: np.ndarray) -> float:
        """Distance [m] of the nearest pair that counts, at most 0.02."""
        self.data.qpos[self.columns] = q
        for name, (side, T_grip_object) in self.held.items():
            at = self.model.joint(name).qposadr[0]
            xyz_quat = pin.SE3ToXYZQUAT(self.robot.grip(q, side) * T_grip_object)
            self.data.qpos[at : at + 7] = [*xyz_quat[:3], xyz_quat[6], *xyz_quat[3:6]]
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)
        counted = [c.dist for c in self.data.contact[: self.data.ncon] if self._counts(c)]
        return min(counted, default=0.02)

    def _counts(self, contact: Any) -> bool:
        a, b = (self.model.body(self.model.geom_bodyid[g]).name for g in contact.geom)
        resting = [n for n in OBJECTS if n not in self.held]
        furniture = ("cabinet_2", "table_1", "table_2", "torso_base")
        if a in (*resting, *furniture) and b in (*resting, *furniture):
            return False
        own = [(name, f"{side}_Hand") for name, (side, _) in self.held.items()]
        return not any((a == n and b.startswith(h)) or (b == n and a.startswith(h)) for n, h in own)


def _near(robot: Robot, rng: np.random.Generator) -> np.ndarray:
    """A random posture of the kind that plans are made of."""
    return np.clip(names.START + rng.normal(0.0, 0.7, 15), robot.lower, robot.upper)


def _compare(
    world: World, judge: Judge, robot: Robot, rng: np.random.Generator, count: int
) -> list[bool]:
    verdicts = []
    while len(verdicts) < count:
        q = _near(robot, rng)
        nearest = judge.nearest(q)
        if abs(nearest - MARGIN) > UNCERTAIN:
            assert world.free(q) == (nearest > MARGIN), (nearest, world.touching(q))
            verdicts.append(nearest > MARGIN)
    return verdicts


def test_verdicts_are_those_of_mujoco(
    robot: Robot, furnished: Furnish, canonical: mujoco.MjModel, rng: np.random.Generator
) -> None:
    """With nothing in the hands, 400 random states with bent fingers get MuJoCo's verdict, near the
    margin aside.
    """
    world, judge = furnished(), Judge(robot, canonical)
    for angle in (0.0, 0.6, 1.2, 1.8):
        for side in names.SIDES:
            world.fingers(side, angle)
            judge.fingers(side, angle)
        verdicts = _compare(world, judge, robot, rng, 100)
        assert 20 < sum(verdicts) < 80


def test_held_things_get_the_verdicts_of_mujoco(
    robot: Robot, furnished: Furnish, canonical: mujoco.MjModel, rng: np.random.Generator
) -> None:
    """With jar and bowl in the hands they are checked against furniture, robot and each other, but
    not their hand.
    """
    world, judge = furnished(), Judge(robot, canonical)
    jar = pin.SE3(pin.exp3(np.array([0.0, 1.5, 0.0])), np.array([0.0, 0.0, 0.0]))
    bowl = pin.SE3(pin.exp3(np.array([0.0, 0.8, 0.3])), np.array([0.02, 0.0, 0.08]))
    for name, side, T_grip_object in (("jar_1", "left", jar), ("bowl_1", "right", bowl)):
        world.attach(name, side, T_grip_object)
        judge.held[name] = (side, T_grip_object)
    assert 20 < sum(_compare(world, judge, robot, rng, 200)) < 180


def test_touching_names_what_free_refuses(
    robot: Robot, furnished: Furnish, rng: np.random.Generator
) -> None:
    """A state is free exactly if no pair is named; the pairs come nearest first, all below the
    margin.
    """
    world = furnished()
    for _ in range(100):
        q = _near(robot, rng)
        found = world.touching(q)
        assert world.free(q) == (not found)
        assert [d for *_, d in found] == sorted(d for *_, d in found)
        assert all(d <= MARGIN + 1e-6 for *_, d in found)


def test_the_margin_is_kept_and_can_be_changed(robot: Robot) -> None:
    """A ball comes too near a little before the margin, also where the boxes around both do not
    overlap.
    """
    world, q = World(robot, MARGIN), np.array(names.START)
    world.put("ball", [Sphere(0.05)], standing((3.0, 0.0, 1.0)), "object")
    world.attach("ball", "left", robot.grip(q, "left").inverse() * standing((3.0, 0.0, 1.0)))
    gaps = (0.02, 0.0063, 0.0057, -0.01)
    for margin, free in ((0.006, (1, 1, 0, 0)), (0.012, (1, 0, 0, 0)), (0.006, (1, 1, 0, 0))):
        world.margin = margin
        verdicts = []
        for gap in gaps:
            world.put("wall", [Box((0.1, 0.1, 0.1))], standing((3.1 + gap, 0.0, 1.0)))
            verdicts.append(world.free(q))
        assert verdicts == list(map(bool, free)), margin


def test_a_hand_may_touch_only_what_it_is_allowed(robot: Robot) -> None:
    """A ball in the palm is a collision until the pair is allowed or the ball is held, and again
    afterwards.
    """
    world, q = World(robot), np.array(names.START)
    at = robot.grip(q, "right") * standing((0.0, 0.0, -0.03))
    world.put("ball", [Sphere(0.03)], at, "object")
    assert not world.free(q)
    assert "right_HandPalmLink" in {a for a, *_ in world.touching(q)}
    world.allow(("right_hand", "ball"))
    assert world.free(q)
    world.allow(("left_hand", "ball"))
    assert not world.free(q)
    world.attach("ball", "right", pin.SE3.Identity())
    world.allow()
    assert world.free(q)
    world.attach("ball", "left", robot.grip(q, "left").inverse() * at)
    assert not world.free(q)
    world.detach("ball", standing((3.0, 0.0, 0.0)))
    assert world.free(q)


def test_resting_things_do_not_mind_each_other(robot: Robot) -> None:
    """An object inside a box of furniture and inside another object is not a collision until a hand
    carries it.
    """
    world, q = World(robot), np.array(names.START)
    for name, kind in (("shelf", "furniture"), ("ball", "object"), ("cube", "object")):
        world.put(name, [Box((0.2, 0.2, 0.2))], standing((2.0, 0.0, 1.0)), kind)
    assert world.free(q)
    world.attach("ball", "left", robot.grip(q, "left").inverse() * standing((2.0, 0.0, 1.0)))
    assert {(a, b) for a, b, _ in world.touching(q)} == {("shelf", "ball"), ("ball", "cube")}
    world.allow(("ball", "shelf"), ("ball", "cube"))
    assert world.free(q)


def test_a_thing_in_the_hand_moves_with_it(robot: Robot, rng: np.random.Generator) -> None:
    """Its pose is the grip's pose times its place in the hand; let go without a pose it rests
    there.
    """
    world, q = World(robot), _near(robot, rng)
    T_grip_object = standing((0.01, 0.02, 0.03), yaw=0.4)
    world.put("cube", [Box((0.01, 0.01, 0.01))], standing((2.0, 0.0, 1.0)), "object")
    assert world.held("cube") is None
    world.attach("cube", "left", T_grip_object)
    world.free(q)
    assert world.held("cube").isApprox(T_grip_object)
    assert world.pose("cube").isApprox(robot.grip(q, "left") * T_grip_object, 1e-9)
    world.detach("cube")
    world.free(np.array(names.START))
    assert world.pose("cube").isApprox(robot.grip(q, "left") * T_grip_object, 1e-9)


def test_things_come_and_go(robot: Robot) -> None:
    """A thing put in the way blocks, moved away or removed it does not, and unknown names are
    refused by name.
    """
    world, q = World(robot), np.array(names.START)
    block = [Box((0.2, 0.2, 0.2))]
    world.put("block", block, robot.grip(q, "left"))
    assert not world.free(q)
    world.put("block", block, standing((3.0, 0.0, 0.0)))
    assert world.free(q)
    world.put("block", block, robot.grip(q, "left"))
    world.remove("block")
    assert world.free(q)
    with pytest.raises(UnknownThing, match="'block'") as caught:
        world.attach("block", "left", pin.SE3.Identity())
    assert caught.value.name == "block"
    assert isinstance(caught.value, VelmaError)
    with pytest.raises(NoShape):
        world.put("odd", ["a string"], standing((0.0, 0.0, 0.0)))


def test_the_head_is_part_of_the_robot(robot: Robot) -> None:
    """A ball at the left end of the camera bar is met while the head looks ahead, and no more when
    it looks aside.
    """
    world, q = World(robot), np.array(names.START)
    world.put("ball", [Sphere(0.02)], standing((0.04, 0.13, 1.69)))
    assert [name for name, *_ in world.touching(q)] == ["head_tilt_link"]
    world.head(1.5, 0.0)
    assert world.free(q)


def test_what_is_between_the_eye_and_a_point_hides_it(robot: Robot) -> None:
    """A ball on the line; not one beside it, nor one behind the point. The thing itself hides
    nothing of it.
    """
    world, q = World(robot), np.array(names.START)
    eye, point = np.array([0.2, 0.0, 1.7]), np.array([0.8, 0.0, 1.1])
    world.put("bowl", [Box((0.1, 0.1, 0.1))], standing(point))
    assert not world.hidden(q, eye, [point], "bowl")
    for at, hides in (((0.6, 0.0, 1.3), 2), ((0.6, 0.3, 1.3), 0), ((0.9, 0.0, 0.8), 0)):
        world.put("ball", [Sphere(0.05)], standing(at))
        assert world.hidden(q, eye, [point, point], "bowl") == hides, at
        assert world.hidden(q, eye, [point], "ball"), "the bowl is before a point inside it"


def test_an_arm_before_the_eye_hides_a_point(robot: Robot) -> None:
    """The point behind the hand is hidden, until the arm is elsewhere."""
    world, eye, reaching = World(robot), np.array([0.1, 0.0, 1.7]), np.array(names.START)
    reaching[names.ARM["left"]] = 0.0  # straight to the side
    palm = robot.grip(reaching, "left").act(np.array([0.0, 0.0, -0.15]))
    behind = eye + 1.2 * (palm - eye)
    assert world.hidden(reaching, eye, [behind], "")
    away = reaching.copy()
    away[names.TORSO] = 0.8
    assert not world.hidden(away, eye, [behind], "")


def test_what_hides_a_point_hides_it_from_a_ray_of_mujoco(
    robot: Robot, canonical: mujoco.MjModel, rng: np.random.Generator
) -> None:
    """Arms anywhere, also a hand's width before the eye; the head, wherever it looks, hides
    nothing.
    """
    world, data = World(robot), mujoco.MjData(canonical)
    columns = [canonical.joint(name).qposadr[0] for name in names.BODY]
    shapes = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
    shapes[int(SHAPE_GROUP)] = 1
    verdicts = []
    for _ in range(400):
        q, pan, tilt = (
            rng.uniform(names.LOWER, names.UPPER),
            *rng.uniform(names.HEAD_LOWER, names.HEAD_UPPER),
        )
        camera = robot.camera(q[names.TORSO], pan, tilt)
        point = camera.act(np.array([*rng.uniform(-0.1, 0.1, 2), rng.uniform(0.3, 0.5)]))
        data.qpos[columns] = q
        mujoco.mj_kinematics(canonical, data)
        hits = _hit(canonical, data, shapes, camera.translation, point)
        if hits is not None:
            hidden = bool(world.hidden(q, camera.translation, [point], ""))
            assert hidden == hits, (q, pan, tilt, point)
            verdicts.append(hits)
    assert 20 < sum(verdicts) < len(verdicts) - 20


def _hit(model: Any, data: Any, shapes: Any, eye: np.ndarray, point: np.ndarray) -> bool | None:
    """Whether rays meet the robot before the point; None where those beside differ: the line goes
    along an edge.
    """
    way, geom, head = point - eye, np.full(1, -1, dtype=np.int32), model.body("head_tilt_link").id
    length = float(np.linalg.norm(way))
    across = np.cross(way, [0.0, 0.0, 1.0])
    beside = (BESIDE * one / np.linalg.norm(one) for one in (across, np.cross(way, across)))
    found = []
    for side in (side * sign for side in (np.zeros(3), *beside) for sign in (1.0, -1.0)):
        far = mujoco.mj_ray(model, data, eye + side, way / length, shapes, 1, head, geom)
        on = model.body(model.geom_bodyid[geom[0]]).name if geom[0] >= 0 else ""
        if on in (*OBJECTS, "cabinet_2", "table_1", "table_2") or abs(far - length) < 2 * BESIDE:
            return None
        found.append(0.0 <= far < length)
    return found[0] if len(set(found)) == 1 else None
