"""Faults of simulated senses and things: what was asked for is disturbed, nothing else, and it
ends.
"""

import copy
import time
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from velma.model import scene
from velma.names import ARM, BODY, HEAD, SIDES
from velma.sim import disturbances
from velma.sim.backend import State, no_command
from velma.sim.disturbances import Disturbance, Kind, Of, Orders
from velma.sim.disturbed_world import PUSH_N
from velma.sim.mujoco_backend import MujocoBackend
from velma.sim.photographs import Photographs
from velma.sim.truth import TruthReader

pytestmark = pytest.mark.timeout(120)
CALM, LONG = 250, 700  # cycles until things rest, at first and after they were disturbed
ELBOW = BODY[ARM["right"][3]]


def one(of: Of, kind: Kind, on: str = "", *by: float) -> Disturbance:
    return Disturbance(f"{of} {kind} {on}", of, kind, on, by)


def hold(backend: MujocoBackend, cycles: int) -> None:
    """Let time pass while the drives hold the weight of the arms."""
    command = no_command()
    for _ in range(cycles):
        command.head[:] = backend.observe().head
        backend.step(command)


@cache
def _rested(name: str) -> MujocoBackend:
    backend = MujocoBackend(scene.load(scene.CANONICAL.with_stem(name)))
    hold(backend, CALM)
    return backend


def resting(name: str = "canonical") -> tuple[MujocoBackend, TruthReader]:
    """A world of a scene in which everything rests, and its truth."""
    backend = copy.deepcopy(_rested(name))
    return backend, TruthReader(backend)


def thing(robot: MujocoBackend, kind: Kind, on: str, *by: float) -> None:
    """Let this befall a thing."""
    assert robot.disturb((one(Of.THING, kind, on, *by),))


def readings(state: State) -> dict[str, np.ndarray]:
    """A copy of all that is read, by side where there is one."""
    assert state.wrist is not None
    sided = {f"{name} {side}": getattr(state, name)[row].copy() for row, side in enumerate(SIDES)
             for name in ("wrist", "proximal", "distal", "spread")}  # fmt: skip
    return {**sided, **{name: getattr(state, name).copy() for name in ("q", "v", "head")}}


@pytest.fixture(scope="module")
def still() -> MujocoBackend:
    return resting()[0]


@pytest.fixture
def robot(still):
    yield still
    still.disturb(())


SPOILED: dict[Disturbance, set[str]] = {
    one(Of.WRIST, Kind.ZERO, "left"): {"wrist left"},
    one(Of.WRIST, Kind.NAN): {"wrist right", "wrist left"},
    one(Of.WRIST, Kind.BIAS, "right"): {"wrist right"},
    one(Of.ENCODER, Kind.BIAS, ELBOW): {"q"},
    one(Of.ENCODER, Kind.BIAS, HEAD[0]): {"head"},
    one(Of.GRIP, Kind.ZERO, "right"): {"proximal right", "distal right"},
}


def test_only_the_asked_reading_is_spoiled_and_heals(robot):
    """The true state does not change, and after its end the readings are again as they were."""
    robot.data.qpos[robot._proximal] = 0.3  # open hands read zero
    before, world = readings(robot.observe()), robot.data.qpos.copy()
    for fault, ill in SPOILED.items():
        assert not robot.disturb((fault,)), "nothing in the world changed"
        spoiled = readings(robot.observe())
        changed = {name for name in before if not np.array_equal(before[name], spoiled[name])}
        assert changed == ill, fault
        assert np.array_equal(robot.data.qpos, world), fault
        robot.disturb(())
        healed = readings(robot.observe())
        assert all(np.array_equal(before[name], healed[name]) for name in before), fault
    robot.data.qpos[robot._proximal] = 0.0


def test_sizes_of_a_bias(robot):
    """As ordered, or that of the row; of a wrist on each axis, torques at a lever of 5 cm."""
    before = readings(robot.observe())
    robot.disturb((one(Of.ENCODER, Kind.BIAS, ELBOW, -0.2), one(Of.WRIST, Kind.BIAS, "left")))
    now, elbow = readings(robot.observe()), BODY.index(ELBOW)
    off = now["q"] - before["q"]
    assert off[elbow] == pytest.approx(-0.2)
    assert np.flatnonzero(off).tolist() == [elbow]
    assert np.allclose(now["wrist left"] - before["wrist left"], [3.0] * 3 + [0.15] * 3)


@pytest.mark.parametrize(("of", "on"), [(Of.WRIST, "left"), (Of.ENCODER, ELBOW), (Of.GRIP, "left")])
def test_a_stuck_reading_stays_as_it_was_first_read(of, on):
    """While the robot moves; the speed of a stuck joint is zero."""
    robot, _ = resting()
    robot.disturb((one(of, Kind.STUCK, on),))
    first, command = readings(robot.observe()), no_command()
    command.tau[:] = 0.5
    command.proximal[:] = command.distal[:] = 0.4
    for _ in range(100):
        robot.step(command)
    now = readings(robot.observe())
    joint = BODY.index(ELBOW)
    same = {Of.WRIST: ["wrist left"], Of.GRIP: ["proximal left", "distal left"], Of.ENCODER: []}[of]
    assert all(np.array_equal(first[name], now[name]) for name in same)
    stuck = bool(now["q"][joint] == first["q"][joint]), bool(now["v"][joint] == 0.0)
    assert stuck == (of is Of.ENCODER,) * 2
    assert not np.array_equal(first["wrist right"], now["wrist right"])
    assert not np.array_equal(first["proximal right"], now["proximal right"])


# --- things ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["jar_1", "bowl_1"])
def test_what_is_pushed_slides_and_stands(name):
    """By the vector to 1 cm, upright, its grains with it; and nothing pushes any more."""
    robot, truth = resting()
    before = truth.read()
    thing(robot, Kind.PUSHED, name, -0.03, 0.02, 0.0)
    hold(robot, LONG)
    after = truth.read()
    by = np.subtract(after.at[name], before.at[name])
    assert by == pytest.approx([-0.03, 0.02, 0.0], abs=0.01)
    assert after.tilt_deg[name] < 2.0
    assert after.grains_in["jar_1"] == after.grains
    assert not robot.data.xfrc_applied.any()
    assert robot.data.ntree_awake == 1, "everything rests"


def test_a_push_is_stopped_by_what_stands_in_the_way():
    """The bowl is pushed by half a metre into the side of its cabinet: no harder than a hand does,
    and not through.
    """
    robot, truth = resting()
    thing(robot, Kind.PUSHED, "bowl_1", 0.0, 0.5, 0.0)
    rotation, cabinet = truth.pose("cabinet_2")
    for _ in range(LONG):
        hold(robot, 1)
        force = robot.data.xfrc_applied[robot.model.body("bowl_1").id, :3]
        assert np.linalg.norm(force) <= PUSH_N + 1e-9
        local = rotation.T @ (truth.pose("bowl_1")[1] - cabinet)
        assert abs(local[1]) < 0.2925 - 0.055


@pytest.mark.parametrize(("place", "name"), [("canonical", "jar_1"), ("box", "box_1")])
def test_what_is_tipped_falls(place, name):
    robot, truth = resting(place)
    thing(robot, Kind.TIPPED, name)
    turned = 0.0
    for _ in range(LONG):
        hold(robot, 1)
        turned = max(turned, truth.tilt_deg(name))
    assert turned > 60.0
    assert not robot.data.xfrc_applied.any()


def test_a_bowl_on_a_table_is_tipped_off_its_base():
    """It is wide and low: the torque has to last until it is past its rim."""
    robot, truth = resting("env2")
    bowl = robot.model.joint("bowl_1").qposadr[0]
    robot.data.qpos[bowl : bowl + 3] = 0.75, 0.7, 0.761
    hold(robot, CALM)
    thing(robot, Kind.TIPPED, "bowl_1", 0.0, 1.0, 0.0)
    hold(robot, 2 * LONG)
    assert truth.tilt_deg("bowl_1") > 45.0


def test_what_is_removed_stands_out_of_sight_with_its_content_and_comes_back():
    robot, truth = resting()
    before, gone = truth.read(), one(Of.THING, Kind.REMOVED, "jar_1")
    robot.disturb((gone,))
    hold(robot, LONG)
    away = truth.read()
    assert away.at["jar_1"][0] < -1.5
    assert (away.at["jar_1"][2], away.tilt_deg["jar_1"]) == pytest.approx((0.1, 0.0), abs=0.01)
    assert away.grains_in["jar_1"] == away.grains
    robot.disturb((gone,))
    assert truth.read().at["jar_1"] == away.at["jar_1"], "it is taken once"
    robot.disturb(())
    hold(robot, LONG)
    back = truth.read()
    assert back.at["jar_1"] == pytest.approx(before.at["jar_1"], abs=0.003)
    assert back.grains_in["jar_1"] == back.grains


def test_what_a_person_pulls_at_and_nobody_holds_is_carried_off():
    """It does not fall: it is at the person's hand, then out of sight, upright, with its
    content.
    """
    robot, truth = resting()
    before = truth.read()
    thing(robot, Kind.PULLED, "jar_1", -10.0, 0.0, 0.0)
    heights = []
    while (at := truth.pose("jar_1")[1])[0] > 0.0:
        heights.append(at[2])
        hold(robot, 1)
        assert robot.data.time < 10.0
    assert min(heights) > before.at["jar_1"][2] - 0.03
    hold(robot, LONG)
    after = truth.read()
    assert (after.at["jar_1"][2], after.tilt_deg["jar_1"]) == pytest.approx((0.1, 0.0), abs=0.01)
    assert after.grains_in["jar_1"] == after.grains
    assert not robot.data.xfrc_applied.any()


def downwards(kind: Kind, by: float) -> tuple[MujocoBackend, list[float]]:
    """The forces on a jar that is pulled or knocked at against its shelf, cycle by cycle."""
    robot, _ = resting()
    thing(robot, kind, "jar_1", 0.0, 0.0, -by)
    body, forces = robot.model.body("jar_1").id, []
    for _ in range(LONG):
        hold(robot, 1)
        forces.append(-robot.data.xfrc_applied[body, 2])
    return robot, forces


def test_a_pull_that_nothing_gives_way_to_grows_to_its_size_and_ends_with_its_order():
    robot, pulls = downwards(Kind.PULLED, 10.0)
    assert pulls[-1] == pytest.approx(10.0, abs=0.5)
    assert max(np.diff(pulls)) < 0.5, "it grows"
    robot.disturb(())
    assert not robot.data.xfrc_applied.any()


def test_a_knock_is_short():
    robot, forces = downwards(Kind.KNOCKED, 20.0)
    assert 0.0 < np.count_nonzero(forces) * robot.period_s < 0.2
    assert max(forces) == pytest.approx(20.0, abs=0.1)


def test_what_is_added_stands_where_it_was_put():
    robot, truth = resting("box")
    thing(robot, Kind.ADDED, "box_1", 0.7, -0.8, 0.831)
    hold(robot, LONG)
    assert truth.read().at["box_1"] == pytest.approx((0.7, -0.8, 0.831), abs=0.005)


def test_furniture_is_moved_with_what_stands_in_it_and_for_what_touches_it():
    """The cabinet takes jar and bowl along, and stands elsewhere for contacts, too: nothing falls
    or jumps.
    """
    robot, truth = resting()
    before = truth.read()
    thing(robot, Kind.MOVED, "cabinet_2", 0.0, 0.05, 0.0)
    hold(robot, 2 * LONG)
    after = truth.read()
    for name in ("cabinet_2", "jar_1", "bowl_1"):
        by = np.subtract(after.poses[name][0], before.poses[name][0])
        assert by == pytest.approx([0, 0.05, 0], abs=0.003)
    board, (turn, at) = robot.model.geom("cabinet_2_middle_shelf").id, truth.pose("cabinet_2")
    inside = turn @ robot.model.geom_pos[board]
    assert robot.data.geom_xpos[board] - at == pytest.approx(inside, abs=1e-6)
    assert after.grains_in["jar_1"] == after.grains


def test_a_joint_that_sticks_does_not_follow_its_drive():
    robot, _ = resting()
    robot.disturb((one(Of.JOINT, Kind.STICKS, ELBOW),))
    hold(robot, 5)
    before, command = robot.observe().q.copy(), no_command()
    command.tau[:] = 10.0
    for _ in range(100):
        robot.step(command)
    moved = np.abs(robot.observe().q - before)
    assert moved[BODY.index(ELBOW)] < 0.01 < moved[ARM["left"][3]]


def test_a_sense_and_a_thing_of_another_name_are_left_alone():
    """A fault of a thing that the scene does not have, or of furniture that is fast, changes
    nothing.
    """
    robot, _ = resting()
    before = robot.data.qpos.copy()
    robot.disturb((one(Of.THING, Kind.PUSHED, "cup_1"), one(Of.THING, Kind.TIPPED, "table_1")))
    hold(robot, 100)
    assert np.abs(robot.data.qpos - before).max() < 1e-4


# --- pictures -------------------------------------------------------------------------------------


@pytest.fixture
def camera(tmp_path, monkeypatch):
    monkeypatch.setenv(disturbances.VARIABLE, str(tmp_path / "disturbances.json"))
    monkeypatch.setattr(disturbances, "LOOK_S", 0.0)
    camera = Photographs(scene.load())
    yield camera
    camera.close()


@pytest.mark.needs_opengl
def test_pictures_of_a_faulty_camera(camera, tmp_path):
    """Black, mirrored, dark, frozen; and well again as soon as nothing stands in the file."""
    qpos = resting()[0].data.qpos.copy()
    file = tmp_path / "disturbances.json"
    well = camera.take(qpos, 1)

    def with_(kind: Kind) -> np.ndarray:
        disturbances.write(file, (one(Of.CAMERA, kind),))
        return camera.take(qpos, 1)

    assert not with_(Kind.BLACK).any()
    assert np.array_equal(with_(Kind.MIRRORED), well[:, ::-1])
    assert with_(Kind.DIMMED).mean() == pytest.approx(0.12 * well.mean(), rel=0.1)
    file.unlink()
    assert np.array_equal(camera.take(qpos, 1), well)
    disturbances.write(file, (one(Of.CAMERA, Kind.FROZEN),))
    qpos[resting()[0]._head[0]] += 0.5
    assert np.array_equal(camera.take(qpos, 2), well)
    file.unlink()
    assert not np.array_equal(camera.take(qpos, 3), well)


@pytest.mark.needs_opengl
def test_the_camera_sees_furniture_where_it_was_moved_to(camera, tmp_path):
    qpos = resting()[0].data.qpos.copy()
    before, _ = camera.both(qpos, 1)
    disturbances.write(tmp_path / "disturbances.json", (one(Of.THING, Kind.MOVED, "cabinet_2"),))
    moved, _ = camera.both(qpos, 1)
    (tmp_path / "disturbances.json").unlink()
    assert not np.array_equal(moved, before)
    assert np.array_equal(camera.both(qpos, 1)[0], before)


# --- orders ---------------------------------------------------------------------------------------

ZERO = one(Of.WRIST, Kind.ZERO)


def test_orders_begin_and_end_with_the_file(tmp_path: Path) -> None:
    """Each change is told once; a file that cannot be read is none."""
    file = tmp_path / "disturbances.json"
    orders = Orders(file)
    assert (orders.look(), orders.going_on) == (False, ())
    disturbances.write(file, (ZERO,))
    assert (orders.look(), orders.going_on) == (True, (ZERO,))
    assert not orders.look()
    file.write_bytes(b"[{")
    assert (orders.look(), orders.going_on) == (True, ())
    disturbances.write(file, (ZERO,))
    assert orders.look()
    file.unlink()
    assert (orders.look(), orders.going_on) == (True, ())
    past = Disturbance("a", Of.WRIST, Kind.ZERO, until=time.time() - 1.0)
    disturbances.write(file, (past, ZERO))
    assert (orders.look(), orders.going_on) == (True, (ZERO,)), "it ends at its time by itself"
    assert not Orders(None).changed(), "without a file nobody looks"


def test_a_backend_takes_what_stands_in_the_file(tmp_path, monkeypatch):
    """It needs the name in the environment when it is made."""
    monkeypatch.setenv(disturbances.VARIABLE, str(tmp_path / "disturbances.json"))
    monkeypatch.setattr(disturbances, "LOOK_S", 0.0)
    robot = MujocoBackend(scene.load())
    assert not robot.disturbed()
    disturbances.write(tmp_path / "disturbances.json", (ZERO, one(Of.THING, Kind.PUSHED, "bowl_1")))
    assert robot.disturbed(), "the world was changed"
    wrist = robot.observe().wrist
    assert wrist is not None
    assert not wrist.any()
    assert not robot.disturbed(), "once"


WRONG = (
    (one(Of.WRIST, Kind.ZERO), ""),
    (one(Of.WRIST, Kind.BLACK), "wrist cannot be black; it can be zero, stuck, nan, bias"),
    (one(Of.WRIST, Kind.ZERO, "up"), "no wrist at 'up'; there are right, left"),
    (one(Of.ENCODER, Kind.BIAS), "no encoder at ''; there are torso_0_joint"),
    (one(Of.CAMERA, Kind.BLACK, "left"), "no camera at 'left'; camera has no parts, name none"),
    (one(Of.ENCODER, Kind.BIAS, ELBOW, 50.0), "encoder bias by 50; at most 3 (rad)"),
    (one(Of.WRIST, Kind.BIAS, "", np.nan), "wrist bias by nan; at most 100 (N on each axis)"),
    (one(Of.GRIP, Kind.ZERO, "left", 1.0), "grip zero has no size"),
    (one(Of.THING, Kind.PUSHED, "jar_1", 0.1), "thing pushed by 1 numbers; it takes 3 (m)"),
)


def test_what_is_wrong_with_a_disturbance_is_told():
    for fault, words in WRONG:
        found = disturbances.wrong(fault)
        assert found.startswith(words), fault
        assert bool(found) == bool(words), fault
