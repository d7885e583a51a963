"""Pictures for people: begun where something moved, one at a time; a child that dies or hangs is
replaced.
"""

import os
import signal
from collections import Counter
from collections.abc import Callable, Iterator

import cv2
import msgspec
import numpy as np
import pytest
from doubles import WITHIN_S, PostDouble, eventually
from hypothesis import given
from hypothesis import strategies as st
from simulated import look_at

from companion.telemetry import (
    PICTURE_S,
    RATE_HZ,
    WATCHED_S,
    Camera,
    Frame,
    Picture,
    Watch,
    decoded,
)
from services.executor import telemetry
from services.executor.device_messages import Setup
from services.executor.renderer import SHRINK
from services.executor.telemetry import (
    AGAIN_S,
    LATE_S,
    LOST_S,
    PAUSE_S,
    STILL,
    Frames,
    Pictures,
)
from velma.eyes.lens import HEIGHT, WIDTH
from velma.eyes.pictures import smaller
from velma.model.scene import load
from velma.sim.mujoco_backend import MujocoBackend, compiled
from velma.sim.photographs import FRAME_HEIGHT, FRAME_WIDTH, HeadCamera, marked

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

    def frames(self) -> list[Frame]:
        """The frames that were told since."""
        said = [self.published.get_nowait() for _ in range(self.published.qsize())]
        assert {kind for kind, _ in said} <= {"frame"}
        return [msgspec.msgpack.decode(data, type=Frame) for _, data in said]

    def watch(self, *large: Camera, had: dict[Camera, int] | None = None) -> None:
        """The page says that people watch."""
        self.heard["watch"](msgspec.msgpack.encode(Watch(large, had or {})))


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


# --- Frames for who watches -----------------------------------------------------------------------

TICK_S = 1.0 / RATE_HZ
ROOM, HEAD = Camera.ROOM, Camera.HEAD


def seconds(
    frames: Frames, begin: float, lasts_s: float, speed: float, asked: Callable[[float], None]
) -> Counter[Camera]:
    """How often a camera is drawn while a joint turns by `speed` [rad/s]; each drawing is there at
    the next tick. `asked`: called each second.
    """
    drawn: Counter[Camera] = Counter()
    world = np.zeros(20)
    for tick in range(round(lasts_s * RATE_HZ)):
        now = begin + tick * TICK_S
        world[3] += speed * TICK_S
        if tick % RATE_HZ == 0:
            asked(now)
        frames.watched(now)
        frames.look(world, now)
        if (camera := frames.due(world, now)) is not None:
            drawn[camera] += 1
            frames.take(camera, b"drawn", world.copy(), now, now + 0.5 * TICK_S)
    return drawn


@given(large=st.sets(st.sampled_from(Camera), min_size=1), speed=st.floats(0.1, 2.0))
def test_what_is_watched_is_drawn_several_times_a_second_while_it_moves(
    large: set[Camera], speed: float
) -> None:
    """Three to five times, each picture that is large, and the other one not at all."""
    screen = Screen()
    frames = Frames(screen)
    drawn = seconds(frames, 100.0, 10.0, speed, lambda _: screen.watch(*large))
    assert set(drawn) == large
    assert all(30 <= times <= 50 for times in drawn.values()), drawn
    assert Counter(frame.camera for frame in screen.frames()) == drawn


@given(speed=st.floats(0.0, 2.0))
def test_without_a_watcher_nothing_is_drawn_for_one(speed: float) -> None:
    """Nor when the last word of a page is older than WATCHED_S, nor for a page where nothing is
    large; a word that cannot be read is none.
    """
    screen = Screen()
    frames = Frames(screen)
    assert not seconds(frames, 100.0, 5.0, speed, lambda _: None)
    assert not seconds(frames, 110.0, 5.0, speed, lambda _: screen.heard["watch"](b"\xc1"))
    assert not seconds(frames, 120.0, 5.0, speed, lambda _: screen.watch())
    seconds(frames, 130.0, 1.0, speed, lambda _: screen.watch(ROOM))
    assert not seconds(frames, 130.0 + 1.1 * WATCHED_S, 5.0, speed, lambda _: None)
    screen.frames()
    assert not seconds(frames, 150.0, 5.0, speed, lambda _: None)
    assert not screen.frames()


def test_at_rest_a_few_bytes_say_that_the_picture_is_still_true() -> None:
    """Once a second, and no picture is drawn or told again; a page that lost it gets it again."""
    screen = Screen()
    frames = Frames(screen)
    had: dict[Camera, int] = {}

    def asked(_: float) -> None:
        screen.watch(ROOM, had=had)

    assert seconds(frames, 100.0, 1.0, 0.0, asked) == {ROOM: 1}
    (told,) = screen.frames()
    had[ROOM] = told.number
    assert not seconds(frames, 101.0, 10.0, 0.0, asked)
    still = screen.frames()
    assert 9 <= len(still) <= 11
    assert {(one.number, one.jpeg, one.age_s) for one in still} == {(told.number, b"", 0.0)}
    had[ROOM] = 0
    assert not seconds(frames, 111.0, 1.0 + LOST_S, 0.0, asked)
    assert any(one.jpeg == told.jpeg and one.number == told.number for one in screen.frames())


def test_what_has_moved_since_is_not_said_to_be_true() -> None:
    """Where no frame can be made, the last one grows old."""
    screen = Screen()
    frames = Frames(screen)
    seconds(frames, 100.0, 1.0, 0.0, lambda _: screen.watch(ROOM))
    (told,) = screen.frames()
    for after in range(1, 5):
        screen.watch(ROOM, had={ROOM: told.number})
        assert frames.watched(101.0 + after)
        frames.look(np.ones(20), 101.0 + after)
    assert not screen.frames()


@pytest.mark.needs_opengl
def test_a_frame_is_the_room_at_that_very_state_in_full_size(screen: Screen, eye: Pictures) -> None:
    """Of the camera that is large; of the other one, what telemetry has. How old it is when it is
    told is said.
    """
    turned = WORLD.copy()
    turned[3] += 0.2
    screen.watch(ROOM)
    now, drawn = 100.0, []
    for world in (WORLD, turned):
        screen.watch(ROOM)
        assert eye.offer(0.0, world, now=now)  # a picture for telemetry, and a frame
        assert eventually(lambda: not (eye._picture or eye._frame))
        # on a slow machine the page's word was old by then: what was not told is told now
        now += WITHIN_S
        screen.watch(ROOM)
        eye.offer(0.0, world, now=now)
        assert eventually(lambda: not (eye._picture or eye._frame))
        now += PICTURE_S
        said = [screen.published.get_nowait() for _ in range(screen.published.qsize())]
        drawn.append(
            [msgspec.msgpack.decode(data, type=Frame) for kind, data in said if kind == "frame"]
        )
    camera = HeadCamera(marked(load()), WIDTH, HEIGHT)
    for world, told in zip((WORLD, turned), drawn, strict=True):
        files = {one.camera: one for one in told if one.jpeg}
        assert set(files) == {ROOM, HEAD}
        for frame, picture in (
            (files[ROOM], camera.room(world, FRAME_WIDTH, FRAME_HEIGHT)),
            (files[HEAD], smaller(camera.picture(world), SHRINK)),
        ):
            assert np.abs(pixels(frame.jpeg) - picture).mean() < 5.0
            assert 0.0 <= frame.age_s < WITHIN_S
    camera.close()


def test_a_back_end_without_a_world_gets_no_child(screen: Screen, eye: Pictures) -> None:
    """The mock, or a real robot; nor where somebody watches."""
    screen.watch(ROOM)
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
    assert not {"mujoco", "HeadCamera", "compiled"} & set(vars(telemetry))
