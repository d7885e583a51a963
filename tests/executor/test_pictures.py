"""Pictures for people: begun where something moved, one at a time; a child that dies or hangs is
replaced.
"""

import os
import signal
from collections.abc import Iterator

import cv2
import numpy as np
import pytest
from doubles import WITHIN_S, PostDouble, eventually
from simulated import look_at

from companion.telemetry import PICTURE_S, Picture, decoded
from services.executor import telemetry
from services.executor.device_messages import Setup
from services.executor.renderer import SHRINK
from services.executor.telemetry import AGAIN_S, LATE_S, PAUSE_S, STILL, Pictures
from velma.eyes.lens import HEIGHT, WIDTH
from velma.eyes.pictures import smaller
from velma.model.scene import load
from velma.sim.mujoco_backend import MujocoBackend, compiled
from velma.sim.photographs import HeadCamera, marked

pytestmark = [pytest.mark.process, pytest.mark.timeout(250)]

WORLD = MujocoBackend(load()).configuration().copy()


class Screen(PostDouble):
    """Takes the pictures that are published; nothing of this is for the agent."""

    def next(self) -> Picture:
        """The next picture."""
        kind, self.last = self.published.get(timeout=WITHIN_S)
        picture = decoded(self.last)
        assert kind == "telemetry"
        assert isinstance(picture, Picture)
        assert self.words.empty()
        return picture


def pixels(jpeg: bytes) -> np.ndarray:
    """The picture (height, width, 3) of a JPEG file, red green blue."""
    found = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert found is not None
    return found[..., ::-1].astype(float)


@pytest.fixture
def screen() -> Screen:
    return Screen()


@pytest.fixture
def eye(screen: Screen) -> Iterator[Pictures]:
    """Pictures of the canonical scene."""
    made = Pictures(screen, Setup())
    yield made
    made.close()


@pytest.mark.needs_opengl
def test_a_picture_is_what_the_camera_sees(screen: Screen, eye: Pictures) -> None:
    """Of that very state; some kilobytes; and while one is under way no other is begun."""
    assert eye.offer(7.5, WORLD, now=100.0)
    assert not eye.offer(7.6, WORLD + 0.1, now=100.0 + 2 * PICTURE_S)
    found = screen.next()
    assert found.sim_time_s == 7.5
    camera = HeadCamera(marked(load()), WIDTH, HEIGHT)
    for file, picture in (
        (found.jpeg, smaller(camera.picture(WORLD), SHRINK)),
        (found.room, camera.room(WORLD)),
    ):
        assert np.abs(pixels(file) - picture).mean() < 5.0
        assert len(file) < 20_000
    camera.close()


@pytest.mark.needs_opengl
def test_markers_that_are_found_in_it_are_told(screen: Screen, eye: Pictures) -> None:
    """Looking into the cabinet those of jar, bowl and cabinet, each where its thing is in the
    smaller picture.
    """
    jar = load().find("jar_1")
    assert jar is not None
    world = WORLD.copy()
    look_at(compiled(load()), world, jar.xyz)
    assert eye.offer(0.0, world, now=100.0)
    found = screen.next()
    assert {one.thing for one in found.markers} >= {"jar_1", "bowl_1", "cabinet_2"}
    corners = np.array([one.corners for one in found.markers if one.thing == "jar_1"]).reshape(
        -1, 2
    )
    height, width, _ = pixels(found.jpeg).shape
    assert np.abs(corners.mean(axis=0) - (width / 2, height / 2)).max() < 40
    assert np.ptp(corners[:4], axis=0).max() == pytest.approx(0.026 / 0.8 * 693 / SHRINK, rel=0.4)


@pytest.mark.needs_opengl
def test_only_what_moved_is_looked_at_again(screen: Screen, eye: Pictures) -> None:
    """Not twice within PICTURE_S; at rest the last picture is told again after AGAIN_S."""
    moved = WORLD.copy()
    moved[3] += 2 * STILL
    swayed = moved + 0.5 * STILL
    for after, world, begun in (
        (0.0, WORLD, True), (0.5 * PICTURE_S, moved, False), (1.1 * PICTURE_S, WORLD, False),
        (1.2 * PICTURE_S, moved, True), (2.5 * PICTURE_S, swayed, False),
        (1.3 * PICTURE_S + AGAIN_S, swayed, False),
    ):  # fmt: skip
        assert eye.offer(0.0, world, now=100.0 + after) is begun, after
        if begun:
            screen.next()
    before = screen.last
    screen.next()
    assert screen.last == before
    assert screen.published.empty()


def test_a_back_end_without_a_world_gets_no_child(eye: Pictures) -> None:
    """The mock, or a real robot."""
    assert not eye.offer(0.0, np.zeros(0), now=100.0)
    assert not eye.renderer.pid


@pytest.mark.needs_opengl
def test_a_child_that_died_is_replaced_after_a_pause(screen: Screen, eye: Pictures) -> None:
    """However it died; not at once, lest one that always dies keeps the machine busy."""
    assert eye.offer(0.0, WORLD, now=100.0)
    screen.next()
    os.kill(eye.renderer.pid, signal.SIGKILL)
    assert eventually(lambda: eye._failed)
    assert not eye.offer(1.0, WORLD + 1.0, now=110.0)
    assert not eye.offer(1.0, WORLD + 1.0, now=110.0 + 0.9 * PAUSE_S)
    assert eye.offer(1.0, WORLD, now=110.0 + 1.1 * PAUSE_S)
    assert screen.next().sim_time_s == 1.0


@pytest.mark.needs_opengl
def test_a_child_that_hangs_is_killed(screen: Screen, eye: Pictures) -> None:
    """Nobody waits for it meanwhile."""
    assert eye.offer(0.0, WORLD, now=100.0)
    screen.next()
    os.kill(pid := eye.renderer.pid, signal.SIGSTOP)
    assert eye.offer(1.0, WORLD + 1.0, now=120.0)
    assert not eye.offer(2.0, WORLD + 2.0, now=120.0 + 0.9 * LATE_S)
    assert eye.renderer.pid == pid
    assert not eye.offer(2.0, WORLD + 2.0, now=120.0 + 1.1 * LATE_S)
    assert eventually(lambda: not eye.renderer.pid)
    assert screen.published.empty()


@pytest.mark.usefixtures("no_opengl")
def test_without_opengl_no_child_is_started_again(
    eye: Pictures, capsys: pytest.CaptureFixture[str]
) -> None:
    """It ends without a picture, and another one would: that is said once, with its exception."""
    assert eye.offer(0.0, WORLD, now=100.0)
    assert eventually(lambda: eye._blind)
    assert not eye.renderer.pid
    assert not eye.offer(1.0, WORLD + 1.0, now=100.0 + 10 * PAUSE_S)
    said = capsys.readouterr().err
    assert said.startswith("no pictures of the robot: GlError: OpenGL does not draw here: ")
    assert "libEGL.so.1: file too short" in said


def test_the_agent_does_not_load_the_simulator_for_it() -> None:
    """The module that the agent's process imports knows neither MuJoCo nor the camera."""
    assert not {"mujoco", "Camera", "compiled"} & set(vars(telemetry))
