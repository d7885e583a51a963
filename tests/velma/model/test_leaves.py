"""Leaves of cabinets: they hang at their hinges however far they are open, and go where their
cabinet goes.
"""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from companion.models import MODELS
from velma.errors import SceneError
from velma.kinematics.frames import standing
from velma.model import scene
from velma.model.kinds import DOORS, Model, objects
from velma.model.scene import NOWHERE, Scene, SceneObject

PATH = scene.CANONICAL.with_stem("doors")
CLOSED = scene.load(PATH)
angles = st.floats(*scene.limits(Model.DOOR_LEFT))
models = st.sampled_from(DOORS)


def hung(model: Model, angle: float, yaw: float = 0.0) -> Scene:
    """A cabinet with one leaf."""
    cabinet = SceneObject("cabinet_1", Model.CABINET_DOOR, (1.0, 0.3, 1.1), yaw=yaw)
    leaf = SceneObject("door_1", model, of="cabinet_1", open=angle)
    return scene.checked(scene.hung(Scene("one", (cabinet, leaf))))


def in_cabinet(whole: Scene, name: str = "door_1") -> pin.SE3:
    """Pose of a leaf in the frame of the cabinet at which it hangs."""
    leaf = whole.find(name)
    assert leaf is not None
    assert leaf.of is not None
    cabinet = whole.find(leaf.of)
    assert cabinet is not None
    return standing(cabinet.xyz, cabinet.yaw).inverse() * standing(leaf.xyz, leaf.yaw)


def handle(model: Model, pose: pin.SE3) -> np.ndarray:
    """The place of the handle."""
    return np.asarray(pose.act(np.array(objects()[model]["parts"]["handle"]["xyz"])))


@settings(max_examples=60, deadline=None)
@given(model=models, angle=angles, yaw=st.floats(-3.0, 3.0))
def test_a_leaf_turns_about_its_hinge_out_of_the_cabinet(
    model: Model, angle: float, yaw: float
) -> None:
    """Its origin stays; its handle is as far from it as closed, and the farther outwards the
    farther it is open.
    """
    pose, closed = in_cabinet(hung(model, angle, yaw)), in_cabinet(hung(model, 0.0, yaw))
    assert pose.translation == pytest.approx(closed.translation)
    at, before = handle(model, pose), handle(model, closed)
    assert math.dist(at, pose.translation) == pytest.approx(math.dist(before, closed.translation))
    assert (at[0] - before[0]) * angle >= 0.0
    assert at[2] == pytest.approx(before[2])


def test_closed_leaves_cover_what_is_behind_them() -> None:
    """From the bottom shelf to the roof and from side to side; they do not meet, nor reach beyond
    the front edges.
    """
    boards = objects()["cabinet"]["parts"]
    edges = []
    for name, model in (("door_1", Model.DOOR_LEFT), ("door_2", Model.DOOR_RIGHT)):
        panel = objects()[model]["parts"]["panel"]
        middle = in_cabinet(CLOSED, name).act(np.array(panel["xyz"]))
        half = np.array(panel["box"]) / 2
        for board, way in (("top", 1), ("bottom", -1)):
            edge = boards[board]["xyz"][2] - boards[board]["box"][2] / 2
            assert middle[2] + way * half[2] == pytest.approx(edge)
        assert middle[0] + half[0] < boards["top"]["box"][0] / 2
        edges += [middle[1] - half[1], middle[1] + half[1]]
    inner = boards["right_side"]["xyz"][1] - boards["right_side"]["box"][1] / 2
    assert 0.0 < edges[2] - edges[1] < 0.005
    assert inner - edges[3] == pytest.approx(edges[0] + inner)
    assert 0.0 < inner - edges[3] < 0.005


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(1, 2**31))
def test_leaves_go_with_their_cabinet(seed: int) -> None:
    """A seed moves the cabinet; its leaves hang at it as before."""
    varied = scene.vary(CLOSED, seed)
    assert varied.find("cabinet_2") != CLOSED.find("cabinet_2")
    for name in ("door_1", "door_2"):
        before, after = (in_cabinet(one, name).homogeneous for one in (CLOSED, varied))
        assert after == pytest.approx(before)
    assert scene.checked(varied) is varied


@pytest.mark.parametrize("model", DOORS)
def test_km_knows_the_leaf_that_is_simulated(model: Model) -> None:
    """The same boards at the same places, and the mass."""
    known, parts = MODELS[model], objects()[model]["parts"].values()
    assert [(s.size, s.at.xyz) for s in known.shapes] == [
        (tuple(p["box"]), tuple(p["xyz"])) for p in parts
    ]  # type: ignore[union-attr]
    assert known.mass == objects()[model]["mass"]
    assert not known.moveable


MISTAKES = (
    ('of = "cabinet_2"', 'of = "cabinet_3"', 14, "id of a cabinet with doors"),
    ('of = "cabinet_2"', 'of = "table_1"', 14, "id of a cabinet with doors"),
    ('of = "cabinet_2"', 'of = "cabinet_2"\nopen = 2', 15, "radians from"),
    ('of = "cabinet_2"', 'of = "cabinet_2"\nopen = nan', 15, "radians from"),
    ('of = "cabinet_2"', 'of = "cabinet_2"\nxyz = [0, 0, 1]', 12, "follow from `of`"),
    ('of = "cabinet_2"', "", 12, r"`of`, one of \['cabinet_2'\]"),
    ('inside = "cabinet_2"', 'of = "cabinet_2"', 38, "only a leaf"),
    ('inside = "cabinet_2"', "open = 0.3", 38, "only a leaf"),
    ("xyz = [0.851, 0.369, 1.281]", "", 34, "metres and radians"),
)


def test_a_leaf_that_cannot_hang_is_refused(tmp_path) -> None:
    """With file and line, and what would be right."""
    path = tmp_path / "mine.toml"
    for before, after, line, words in MISTAKES:
        path.write_text(PATH.read_text().replace(before, after, 1))
        with pytest.raises(SceneError, match=rf"mine\.toml:{line}\b.*{words}"):
            scene.load(path)


def test_a_leaf_is_hung_once() -> None:
    """What hangs already stays, bit by bit."""
    assert scene.hung(CLOSED) == CLOSED
    loose = [replace(t, xyz=NOWHERE, yaw=0.0) if t.of else t for t in CLOSED.things]
    assert scene.hung(replace(CLOSED, things=tuple(loose))) == CLOSED
