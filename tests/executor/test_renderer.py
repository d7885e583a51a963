"""One process renders for the robot and for people: looks first, started when needed, ended after a
while without.
"""

from collections.abc import Iterator
from queue import Queue

import numpy as np
import pytest
from doubles import WITHIN_S, eventually

from companion.telemetry import Picture
from services.executor import renderer
from services.executor.renderer import Blind, Renderer, Saw, See, Show
from services.executor.renderer_process import Renderer as Child
from velma.kinematics.robot import Robot
from velma.model.scene import load
from velma.sim.mujoco_backend import MujocoBackend

pytestmark = [pytest.mark.process, pytest.mark.needs_opengl, pytest.mark.timeout(250)]

SCENE = load()
WORLD = MujocoBackend(SCENE).configuration().tobytes()
EYE = Robot().camera(0.0, 0.0, 0.5)
PLACE = tuple(EYE.rotation.ravel().tolist()), tuple(EYE.translation.tolist())


def see(number: int) -> See:
    """A look."""
    return See(number, WORLD, *PLACE)


class Line:
    """The link of the child: what it is told comes at the moment that a test chooses."""

    def __init__(self) -> None:
        self.said: list[object] = []
        # after so many questions whether something waits
        self.comes: list[tuple[int, See | Show]] = []
        self.asked = 0

    def send(self, word: object) -> None:
        self.said.append(word)

    def waiting(self) -> bool:
        self.asked += 1
        return bool(self.comes) and self.comes[0][0] == self.asked

    def recv(self, kind: object) -> See | Show:
        return self.comes.pop(0)[1]


def test_a_look_that_is_asked_for_amid_a_picture_comes_first() -> None:
    """At whichever part of the picture; and the picture is what it would have been."""
    line = Line()
    child = Child(SCENE, line)  # type: ignore[arg-type]
    child.take(Show(1.0, WORLD))
    (alone,) = line.said
    assert isinstance(alone, Picture)
    parts = line.asked
    for part in range(1, parts + 1):
        line.said.clear()
        line.asked, child._shown = 0, 0
        line.comes = [(part, see(part))]
        child.take(Show(1.0, WORLD))
        saw, picture = line.said
        assert isinstance(saw, Saw)
        assert isinstance(picture, Picture)
        assert (picture.jpeg, picture.room) == (alone.jpeg, alone.room)
    child._camera.close()


@pytest.fixture
def answers() -> "Queue[Saw | Blind]":
    return Queue()


@pytest.fixture
def made() -> Iterator[Renderer]:
    one = Renderer(lambda: SCENE)
    yield one
    one.close()


def test_it_runs_from_the_first_look_until_it_has_rested(
    made: Renderer, answers: "Queue[Saw | Blind]", monkeypatch: pytest.MonkeyPatch
) -> None:
    """Then no process is left; the next look has a new one, and sees the same."""
    monkeypatch.setattr(renderer, "REST_S", 0.5)
    assert not made.pid
    seen = []
    for _ in range(2):
        made.look(see(1), answers.put)
        saw = answers.get(timeout=WITHIN_S)
        assert isinstance(saw, Saw)
        seen.append(saw)
        assert eventually(lambda: not made.pid)
    assert seen[0] == seen[1]


def test_the_first_look_of_a_skill_process_is_compared_with_none(
    made: Renderer, answers: "Queue[Saw | Blind]"
) -> None:
    """Each begins to count at one: the same picture again is no frozen camera."""
    for _ in range(2):
        made.look(see(1), answers.put)
        saw = answers.get(timeout=WITHIN_S)
        assert isinstance(saw, Saw)
        assert saw.wrong == ""
    made.look(see(1), answers.put)
    assert np.isclose(answers.get(timeout=WITHIN_S).off, 0.0)  # type: ignore[union-attr]
