"""Eyes by pixels: what their child sees is near the truth, by the measured joints; a child that
dies is replaced.
"""

import contextlib
import os
import signal
from collections.abc import Iterator

import numpy as np
import pytest
from msgspec.structs import replace
from simulated import look_at, placed

from agent_runtime.core.errors import WorkerError
from companion.eyes import VARIABLE, Eyes, eyes
from companion.look_around import POINTS
from companion.skills.situation import Eye, Neck, Sight
from services.executor import renderer
from services.executor.receptor import OwnPixelReceptor, Receptor
from services.executor.simulation import receptor
from velma.model.scene import Scene, load, vary
from velma.sim.mujoco_backend import MujocoBackend

pytestmark = [pytest.mark.process, pytest.mark.timeout(180)]

SCENE = vary(load(), 3)
BACKEND = MujocoBackend(SCENE)
Point = tuple[float, float, float]


def turned(point: Point) -> tuple[np.ndarray, Neck]:
    """The state with the head on a point, and its joints."""
    qpos = BACKEND.configuration().copy()
    return qpos, look_at(BACKEND.model, qpos, point)


def place(name: str) -> np.ndarray:
    """Where a thing is."""
    data = placed(BACKEND.model, BACKEND.configuration())
    return np.asarray(data.body(name).xpos.copy())


def off(sights: list[Sight], name: str) -> float:
    """How far from there it is seen [m]."""
    sight = next(one for one in sights if one.name == name)
    return float(np.linalg.norm(sight.T_world_object.translation - place(name)))


@pytest.fixture(scope="module")
def eye() -> Iterator[Eye]:
    """Eyes for the scene."""
    with contextlib.closing(receptor(SCENE, Eyes.PIXELS)) as made:
        yield made


@pytest.fixture
def own() -> Iterator[OwnPixelReceptor]:
    """Eyes of which a test may spoil the child."""
    with contextlib.closing(OwnPixelReceptor(SCENE)) as made:
        yield made


@pytest.mark.needs_opengl
def test_the_survey_shows_all_things_near_the_truth(eye: Eye) -> None:
    """The three gazes together; millimetres, not the noise of the eyes by rays, which is not
    theirs. The true place is within four of the told deviations, which are millimetres, too.
    """
    seen: dict[str, float] = {}
    for point in POINTS:
        for sight in eye.look(*turned(point)):
            told, seen[sight.name] = sight.uncertainty, off([sight], sight.name)
            assert told is not None
            assert seen[sight.name] < 4 * told.deviation < 0.04
    assert set(seen) == {thing.id for thing in SCENE.things}
    assert max(seen.values()) < 0.006


@pytest.mark.needs_opengl
def test_the_camera_is_where_the_joints_say(eye: Eye) -> None:
    """A neck that measures a hundredth of a radian too much puts the bowl a centimetre aside: truth
    does not help.
    """
    world, (torso, pan, tilt) = turned(tuple(place("bowl_1")))
    exact = off(eye.look(world, (torso, pan, tilt)), "bowl_1")
    wrong = off(eye.look(world, (torso, pan + 0.01, tilt)), "bowl_1")
    distance = float(np.linalg.norm(place("bowl_1")[:2]))
    assert exact < 0.002
    assert wrong == pytest.approx(0.01 * distance, rel=0.2)


@pytest.mark.needs_opengl
def test_each_look_has_its_own_noise(eye: Eye) -> None:
    """Twice the same state: not the same pose to the last digit, and near each other."""
    world, neck = turned(tuple(place("jar_1")))
    one, other = (
        {s.name: s for s in eye.look(world, neck)}["jar_1"].T_world_object for _ in range(2)
    )
    assert 0.0 < np.linalg.norm(one.translation - other.translation) < 0.006


@pytest.mark.needs_opengl
def test_a_child_that_died_is_replaced_within_the_look(own: OwnPixelReceptor) -> None:
    """The look gives what it would have given; the next one, too."""
    world, neck = turned(tuple(place("jar_1")))
    assert off(own.look(world, neck), "jar_1") < 0.006
    os.kill(own.renderer.pid, signal.SIGKILL)
    assert off(own.look(world, neck), "jar_1") < 0.006


def test_a_child_that_gives_no_answer_ends_in_an_error(
    own: OwnPixelReceptor, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not in waiting for ever."""
    monkeypatch.setattr(renderer, "WITHIN_S", 0.2)
    monkeypatch.setattr(renderer, "ENTRY", "agent_runtime.io.worker:no_such_function")
    with pytest.raises(WorkerError, match="does not see"):
        own.look(*turned(POINTS[0]))


@pytest.mark.usefixtures("no_opengl")
def test_without_opengl_the_look_says_so(own: OwnPixelReceptor) -> None:
    """By the exception of the child that could not draw."""
    with pytest.raises(WorkerError, match=r"GlError: .*libEGL\.so\.1: file too short"):
        own.look(*turned(POINTS[0]))


@pytest.mark.needs_opengl
def test_a_camera_that_is_not_where_the_robot_thinks_errs() -> None:
    """The scene's calibration error, by a degree: things are seen centimetres aside, all to the
    same side.
    """
    noise = replace(SCENE.noise, camera_turn=0.0175)
    askew: Scene = replace(SCENE, noise=noise)
    with contextlib.closing(OwnPixelReceptor(askew)) as made:
        found = made.look(*turned(tuple(place("jar_1"))))
    assert 0.003 < off(found, "jar_1") < 0.05


def test_eyes_are_chosen_by_name() -> None:
    """Where nothing is said, by pixels if something can be drawn; what cannot be had is told, as is
    a wrong name.
    """
    assert eyes("", lambda: "") == (Eyes.PIXELS, "")
    assert eyes("", lambda: "no libEGL") == (Eyes.RAYS, "no libEGL")
    assert eyes("pixels", lambda: "") == (Eyes.PIXELS, "")
    assert eyes("rays", pytest.fail) == (Eyes.RAYS, "")
    with pytest.raises(ValueError, match="no libEGL"):
        eyes("pixels", lambda: "no libEGL")
    with pytest.raises(ValueError, match=f"{VARIABLE}=lidar: there are eyes rays, pixels"):
        eyes("lidar", lambda: "")
    assert isinstance(receptor(SCENE, Eyes.RAYS), Receptor)
