"""Scenes: read, refused with a reason, varied by seed, drawn."""

import math

import msgspec
import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from velma.errors import SceneError
from velma.model import scene
from velma.model.kinds import Model, objects
from velma.model.scene import Scene, SceneObject, Spread
from velma.sim.mujoco_backend import MujocoBackend, compiled

CANONICAL = scene.load()
BOXES = (*CANONICAL.things, *(SceneObject(f"box_{k}", Model.BOX1, (0, 0, 1)) for k in range(1, 22)))
SCENES = sorted(scene.CANONICAL.parent.glob("*.toml"))


def inside(whole, thing):
    """A thing's position in the frame of the cabinet it stands in, (2,)."""
    around = whole.find(thing.inside)
    c, s = math.cos(-around.yaw), math.sin(-around.yaw)
    return np.array([[c, -s], [s, c]]) @ (np.array(thing.xyz[:2]) - around.xyz[:2])


def without(whole, name):
    return msgspec.structs.replace(whole, things=tuple(t for t in whole.things if t.id != name))


def test_the_canonical_scene_has_the_things_the_task_names():
    """Ids are the agents' words."""
    ids = sorted(thing.id for thing in CANONICAL.things)
    assert ids == ["bowl_1", "cabinet_2", "jar_1", "table_1", "table_2"]
    assert CANONICAL.content.grains == 30


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_variation_stays_in_its_spread(seed):
    """Cabinet within 4 cm and 6 degrees, jar and bowl within their ranges in the cabinet; heights
    stay.
    """
    varied, spread = scene.vary(CANONICAL, seed), Spread()
    before, after = CANONICAL.find("cabinet_2"), varied.find("cabinet_2")
    assert np.abs(np.subtract(after.xyz, before.xyz)[:2]).max() <= spread.cabinet
    assert abs(after.yaw - before.yaw) <= spread.cabinet_yaw
    for name, depth, width in (
        ("jar_1", spread.jar_depth, spread.jar_width),
        ("bowl_1", spread.bowl_depth, spread.bowl_width),
    ):
        shift = inside(varied, varied.find(name)) - inside(CANONICAL, CANONICAL.find(name))
        assert depth[0] - 1e-9 <= shift[0] <= depth[1] + 1e-9
        assert width[0] - 1e-9 <= shift[1] <= width[1] + 1e-9
        assert varied.find(name).xyz[2] == pytest.approx(CANONICAL.find(name).xyz[2])
    assert varied.find("table_1") == CANONICAL.find("table_1")
    assert scene.checked(varied) is varied


def test_the_jar_out_of_reach_stands_on_its_table_and_is_out_of_reach():
    """0.2 m further than upper arm, forearm, wrist and hand reach from the nearest place of a
    shoulder.
    """
    whole = scene.load(scene.CANONICAL.parent / "jar_out_of_reach.toml")
    jar, table = whole.find("jar_1"), whole.find("table_1")
    c, s = math.cos(-table.yaw), math.sin(-table.yaw)
    local = np.array([[c, -s], [s, c]]) @ np.subtract(jar.xyz, table.xyz)[:2]
    assert np.abs(local).max() < 0.913 / 2 - 0.04
    away = math.hypot(math.hypot(*jar.xyz[:2]) - 0.27, 1.36 - jar.xyz[2])
    assert away > 0.40 + 0.39 + 0.078 + 0.24 + 0.2


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_a_seed_is_a_scene_without_overlap(path):
    """Of every scene of ours: its things start free of each other and of the robot. The same seed
    gives the same scene and noise; seed 0 is the scene as it is written.
    """
    whole, seen = scene.load(path), []
    for seed in range(12):
        varied = scene.vary(whole, seed)
        assert varied == scene.vary(whole, seed)
        assert varied.things not in seen
        assert varied == whole if seed == 0 else varied.noise.seed == seed
        assert MujocoBackend(varied).model.nq >= 33
        seen.append(varied.things)


def test_a_thing_in_a_cabinet_moves_with_it():
    """A box that no seed moves by itself keeps its place and angle in the cabinet."""
    before = scene.load(scene.CANONICAL.parent / "env2.toml")
    after = scene.vary(before, 3)
    (box, cabinet), (box_3, cabinet_3) = (
        [one.find(name) for name in ("box_1", "cabinet_2")] for one in (before, after)
    )
    assert cabinet_3 != cabinet
    assert inside(after, box_3) == pytest.approx(inside(before, box))
    assert box_3.yaw - cabinet_3.yaw == pytest.approx(box.yaw - cabinet.yaw)


@settings(max_examples=30, deadline=None)
@given(angles=st.tuples(*[st.floats(-3.0, 3.0)] * 3))
def test_a_thing_may_lie_or_lean(angles):
    """Its axes are those of Rz(yaw) Ry(pitch) Rx(roll)."""
    yaw, pitch, roll = angles
    jar = SceneObject("jar_1", Model.JAR, (0, 0, 1), yaw=yaw, pitch=pitch, roll=roll)
    model = compiled(Scene("jar", (jar,)))
    turned = np.zeros(9)
    mujoco.mju_quat2Mat(turned, model.body("jar_1").quat)
    assert turned.reshape(3, 3) == pytest.approx(pin.rpy.rpyToMatrix(roll, pitch, yaw), abs=1e-9)


OVERLAPS = (
    (SceneObject("jar_2", Model.JAR, (0.85, 0.37, 1.29)), "thing jar_2|thing jar_1"),
    (SceneObject("box_9", Model.BOX3, (0.0, 0.0, 1.0)), "inside the robot"),
    (SceneObject("box_9", Model.BOX3, (2.0, 2.0, 0.0)), "inside the floor"),
    (SceneObject("jar_9", Model.LID, (1.087, 0.434, 0.76)), "inside table_2"),
)


def test_things_that_overlap_are_refused():
    """Named with the depth and what they are in."""
    for moved, words in OVERLAPS:
        whole = msgspec.structs.replace(CANONICAL, things=(*CANONICAL.things, moved))
        with pytest.raises(SceneError, match=words):
            MujocoBackend(whole)


MISTAKES = (
    ('model = "jar"', 'model = "cup"', 25),
    ("grains = 30", "grains = 300", 39),
    ("grains = 30", 'grains = 30\nspin = "fast"', 40),
    ("grains = 30", "grains = 30\nspin = 1", 40),
    ("position = 0.004", 'position = "no"', 42),
    ('id = "bowl_1"', 'id = "bowl"', 31),
    ('inside = "cabinet_2"', 'inside = "shed_1"', 28),
)


def test_the_error_names_file_and_line(tmp_path):
    """Of what is wrong: an editor can jump there."""
    path = tmp_path / "mine.toml"
    for before, after, line in MISTAKES:
        path.write_text(scene.CANONICAL.read_text().replace(before, after, 1))
        with pytest.raises(SceneError, match=rf"mine\.toml:{line}\b"):
            scene.load(path)


def test_leaving_a_thing_out_does_not_move_the_others():
    """Each thing draws from its own stream."""
    bowl = scene.vary(CANONICAL, 3).find("bowl_1")
    assert scene.vary(without(CANONICAL, "jar_1"), 3).find("bowl_1") == bowl


IMPOSSIBLE = (
    ({"things": (*CANONICAL.things, CANONICAL.things[0])}, "one thing for each id"),
    ({"things": (SceneObject("jar_1", Model.JAR, (0, 0, 1), inside="shed_1"),)}, "id of a cabinet"),
    ({"things": (SceneObject("jar_1", Model.JAR, (0, math.nan, 1)),)}, "metres and radians"),
    ({"things": (SceneObject("left_arm_7_link", Model.JAR, (0, 0, 1)),)}, "as jar_1"),
    ({"things": (SceneObject("grain_3", Model.JAR, (0, 0, 1)),)}, "not grain_1"),
    ({"things": (SceneObject("jar_1", Model.JAR, (0, 0, 1), on="cabinet_2"),)}, "id of a table"),
    ({"content": scene.Content(inside="bowl_1")}, r"id of a jar .* one of \['jar_1'\]"),
    ({"content": scene.Content(inside="jar_7")}, r"one of \['jar_1'\]"),
    ({"things": (SceneObject("jar_1", Model.JAR, (0, 0, 1), roll=1.0),)}, "upright"),
    ({"spread": Spread(cabinet=math.nan)}, "smaller number first"),
    ({"spread": Spread(jar_depth=(0.1, -0.1))}, "smaller number first"),
    ({"content": scene.Content(grains=500)}, "from 0 to 60"),
    ({"content": scene.Content(friction=30.0)}, "from 0 to 3"),
    ({"noise": scene.Noise(position=3.0)}, "from 0 to 0.1"),
    ({"things": BOXES}, "thing box_21 .* at most 250 markers in all: .* the 25 things before it"),
)


def test_a_scene_that_cannot_be_is_refused_with_what_would_be_right():
    """The error names field, finding and expectation."""
    for change, words in IMPOSSIBLE:
        with pytest.raises(SceneError, match=words) as caught:
            scene.checked(msgspec.structs.replace(CANONICAL, **change))
        assert caught.value.field, words
        assert caught.value.expected, words
    many = msgspec.structs.replace(CANONICAL, things=BOXES[:-1])
    assert scene.checked(many) is many, "as many things as there are markers for"


def test_a_file_that_is_no_scene_is_refused(tmp_path):
    """The error is ours and names the file, whatever stands in it; a missing one with an
    example.
    """
    path = tmp_path / "scene.toml"
    cup = "name='x'\n[[thing]]\nid='a'\nmodel='cup'\nxyz=[0,0,0]"
    for text in ("name = 3", "nome = 'x'", "= [", cup):
        path.write_text(text)
        with pytest.raises(SceneError, match=r"scene\.toml"):
            scene.load(path)
    with pytest.raises(SceneError, match=r"canonical\.toml"):
        scene.load(tmp_path / "none.toml")


@pytest.mark.parametrize("missing", ["jar_1", "bowl_1", "cabinet_2", None])
def test_any_thing_may_be_missing(missing):
    """The model compiles without jar, bowl or cabinet."""
    things = tuple(
        msgspec.structs.replace(t, inside=None) if missing == "cabinet_2" else t
        for t in CANONICAL.things
        if t.id != missing
    )
    content = None if missing == "jar_1" else CANONICAL.content
    whole = msgspec.structs.replace(CANONICAL, things=things, content=content)
    model = compiled(whole)
    names = {model.body(k).name for k in range(model.nbody)}
    assert missing not in names
    assert ("grain_0" in names) == (missing != "jar_1")


def test_nothing_touches_in_the_scene_as_it_is_drawn():
    """Grains, vessels and robot start free of each other; the jar is let down a millimetre."""
    for seed in range(5):
        model = compiled(scene.vary(CANONICAL, seed))
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        pairs = [{model.geom(int(g)).name for g in pair} for pair in data.contact.geom[: data.ncon]]
        assert [p for p in pairs if any("arm" in g or "Hand" in g for g in p)] == []
        assert data.ncon == 0


def test_grains_lie_in_the_jar():
    """All of them, and the most that a scene may ask for too."""
    jar, grain = objects()["jar"], objects()["grain"]["radius"]
    stands = (SceneObject("jar_1", Model.JAR, (0, 0, 1)),)
    for grains in (1, 30, scene.MOST_GRAINS):
        model = compiled(Scene("jar", stands, scene.Content(grains=grains)))
        at = np.array([model.body(f"grain_{k}").pos for k in range(grains)]) - (0, 0, 1)
        assert (np.hypot(at[:, 0], at[:, 1]) + grain <= jar["radius"] - jar["wall"] + 1e-9).all()
        assert (np.abs(at[:, 2]) + grain <= jar["height"] / 2).all()


def test_looks_of_vessels_follow_their_numbers():
    """The surface one sees is where the hand meets the wall."""
    model = compiled(CANONICAL)
    for body, key, height in (
        ("jar_1_jar_glass", "radius", "height"),
        ("bowl_1_bowl_glaze", "rim_radius", "height"),
    ):
        mesh = model.mesh(model.geom(body).dataid[0])
        start, count = mesh.vertadr[0], mesh.vertnum[0]
        # The compiler turns a mesh into its own principal axes and places it back by the geom.
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.geom(body).quat)
        points = (
            model.mesh_vert[start : start + count] @ turn.reshape(3, 3).T + model.geom(body).pos
        )
        numbers = objects()[body.split("_")[0]]
        assert np.hypot(points[:, 0], points[:, 1]).max() == pytest.approx(numbers[key], abs=1e-3)
        assert np.ptp(points[:, 2]) == pytest.approx(numbers[height], abs=1e-3)
        assert not model.geom(body).contype[0]


def test_grains_rub_on_the_inside_of_the_jar_as_the_scene_says() -> None:
    """Its outside, which hands hold, is as it was; without a word both are as measured."""
    for friction in (None, 1.2):
        model = compiled(
            msgspec.structs.replace(CANONICAL, content=scene.Content(friction=friction))
        )
        parts = ("bottom", "inner_0", "inner_11")
        inside = {float(model.geom(f"jar_1_{name}").friction[0]) for name in parts}
        assert inside == {0.3 if friction is None else friction}
        assert float(model.geom("jar_1_side").friction[0]) == 0.6
