"""Scenes: read, refused with a reason, varied by seed, drawn."""

import math

import msgspec
import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from velma.errors import SceneError
from velma.model import scene
from velma.model.scene import Model, Scene, Spread, Thing
from velma.model.scene_xml import objects, scene_xml

CANONICAL = scene.load()


def inside(whole, thing):
    """A thing's position in the frame of the cabinet it stands in, (2,)."""
    around = whole.find(thing.inside)
    c, s = math.cos(-around.yaw), math.sin(-around.yaw)
    return np.array([[c, -s], [s, c]]) @ (np.array(thing.xyz[:2]) - around.xyz[:2])


def without(whole, name):
    return msgspec.structs.replace(whole, things=tuple(t for t in whole.things if t.id != name))


def test_the_canonical_scene_has_the_things_the_task_names():
    """Ids are the agents' words."""
    assert {thing.id for thing in CANONICAL.things} == {"jar_1", "bowl_1", "cabinet_2", "table_1", "table_2"}
    assert CANONICAL.content.grains == 30


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_variation_stays_in_its_spread(seed):
    """Cabinet within 4 cm and 6 degrees, jar and bowl within their ranges in the cabinet; heights stay."""
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


@pytest.mark.parametrize("path", sorted(scene.CANONICAL.parent.glob("*.toml")), ids=lambda path: path.stem)
def test_every_scene_of_ours_loads_compiles_and_varies(path):
    """The files beside the canonical one are scenes too."""
    whole = scene.vary(scene.load(path), 2)
    assert mujoco.MjModel.from_xml_string(scene_xml(whole)).nq >= 33


def test_the_jar_out_of_reach_stands_on_its_table_and_is_out_of_reach():
    """0.2 m further than upper arm, forearm, wrist and hand reach from the nearest place of a shoulder."""
    whole = scene.load(scene.CANONICAL.parent / "jar_out_of_reach.toml")
    jar, table = whole.find("jar_1"), whole.find("table_1")
    c, s = math.cos(-table.yaw), math.sin(-table.yaw)
    local = np.array([[c, -s], [s, c]]) @ np.subtract(jar.xyz, table.xyz)[:2]
    assert np.abs(local).max() < 0.913 / 2 - 0.04
    assert math.hypot(math.hypot(*jar.xyz[:2]) - 0.27, 1.36 - jar.xyz[2]) > 0.40 + 0.39 + 0.078 + 0.24 + 0.2


def test_a_seed_is_a_scene():
    """The same seed gives the same scene and noise, another seed another one."""
    assert scene.vary(CANONICAL, 5) == scene.vary(CANONICAL, 5)
    assert scene.vary(CANONICAL, 5).things != scene.vary(CANONICAL, 6).things
    assert scene.vary(CANONICAL, 5).noise.seed == 5


def test_leaving_a_thing_out_does_not_move_the_others():
    """Each thing draws from its own stream."""
    bowl = scene.vary(CANONICAL, 3).find("bowl_1")
    assert scene.vary(without(CANONICAL, "jar_1"), 3).find("bowl_1") == bowl


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"things": (*CANONICAL.things, CANONICAL.things[0])}, "one thing for each id"),
        ({"things": (Thing("jar_1", Model.JAR, (0, 0, 1), inside="shed_1"),)}, "id of a cabinet"),
        ({"things": (Thing("jar_1", Model.JAR, (0, math.nan, 1)),)}, "metres and radians"),
        ({"content": scene.Content(inside="bowl_1")}, "not of a bowl"),
        ({"content": scene.Content(grains=500)}, "from 0 to 60"),
        ({"noise": scene.Noise(position=3.0)}, "from 0 to 0.1"),
    ],
)
def test_a_scene_that_cannot_be_is_refused_with_what_would_be_right(change, words):
    """The error names field, finding and expectation."""
    with pytest.raises(SceneError, match=words) as caught:
        scene.checked(msgspec.structs.replace(CANONICAL, **change))
    assert caught.value.field
    assert caught.value.expected


@pytest.mark.parametrize(
    "text", ["name = 3", "nome = 'x'", "= [", "name='x'\n[[thing]]\nid='a'\nmodel='cup'\nxyz=[0,0,0]"]
)
def test_a_file_that_is_no_scene_is_refused(tmp_path, text):
    """Whatever stands in the file, the error is ours and names it."""
    path = tmp_path / "scene.toml"
    path.write_text(text)
    with pytest.raises(SceneError, match=r"scene\.toml"):
        scene.load(path)


def test_a_missing_file_is_refused(tmp_path):
    """With the name of an example."""
    with pytest.raises(SceneError, match=r"canonical\.toml"):
        scene.load(tmp_path / "none.toml")


@pytest.mark.parametrize("missing", ["jar_1", "bowl_1", "cabinet_2", None])
def test_any_thing_may_be_missing(missing):
    """The model compiles without jar, bowl or cabinet; without the jar there is no content either."""
    things = tuple(
        msgspec.structs.replace(t, inside=None) if missing == "cabinet_2" else t
        for t in CANONICAL.things
        if t.id != missing
    )
    model = mujoco.MjModel.from_xml_string(scene_xml(scene.checked(msgspec.structs.replace(CANONICAL, things=things))))
    names = {model.body(k).name for k in range(model.nbody)}
    assert missing not in names
    assert ("grain_0" in names) == (missing != "jar_1")


def test_nothing_touches_in_the_scene_as_it_is_drawn():
    """Grains, vessels and robot start free of each other; the jar is let down a millimetre."""
    for seed in range(5):
        model = mujoco.MjModel.from_xml_string(scene_xml(scene.vary(CANONICAL, seed)))
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        pairs = [{model.geom(int(g)).name for g in pair} for pair in data.contact.geom[: data.ncon]]
        assert [p for p in pairs if any("arm" in g or "Hand" in g for g in p)] == []
        assert data.ncon == 0


def test_grains_lie_in_the_jar():
    """All of them, and the most that a scene may ask for too."""
    for grains in (1, 30, scene.MOST_GRAINS):
        whole = Scene("jar", (Thing("jar_1", Model.JAR, (0, 0, 1)),), scene.Content(grains=grains))
        model = mujoco.MjModel.from_xml_string(scene_xml(whole))
        at = np.array([model.body(f"grain_{k}").pos for k in range(grains)]) - (0, 0, 1)
        jar, grain = objects()["jar"], objects()["grain"]["radius"]
        assert (np.hypot(at[:, 0], at[:, 1]) + grain <= jar["radius"] - jar["wall"] + 1e-9).all()
        assert (np.abs(at[:, 2]) + grain <= jar["height"] / 2).all()


def test_looks_of_vessels_follow_their_numbers():
    """The surface one sees is where the hand meets the wall."""
    model = mujoco.MjModel.from_xml_string(scene_xml(CANONICAL))
    for body, key, height in (("jar_1_jar_glass", "radius", "height"), ("bowl_1_bowl_glaze", "rim_radius", "height")):
        mesh = model.mesh(model.geom(body).dataid[0])
        start, count = mesh.vertadr[0], mesh.vertnum[0]
        # The compiler turns a mesh into its own principal axes and places it back by the geom.
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.geom(body).quat)
        points = model.mesh_vert[start : start + count] @ turn.reshape(3, 3).T + model.geom(body).pos
        numbers = objects()[body.split("_")[0]]
        assert np.hypot(points[:, 0], points[:, 1]).max() == pytest.approx(numbers[key], abs=1e-3)
        assert np.ptp(points[:, 2]) == pytest.approx(numbers[height], abs=1e-3)
        assert not model.geom(body).contype[0]
