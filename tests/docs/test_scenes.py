"""The page about scenes: its example can be started, its tables name what there is."""

import re
from pathlib import Path

import pytest

from velma.model.kinds import Model
from velma.model.scene import CANONICAL, load, vary
from velma.sim.mujoco_backend import MujocoBackend

PAGE = (Path(__file__).parents[2] / "docs" / "scenes.md").read_text("utf-8")


@pytest.fixture
def example(tmp_path: Path) -> Path:
    """The scene of the page, as a file."""
    (found,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    path = tmp_path / "example.toml"
    path.write_text(found, "utf-8")
    return path


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_example_can_be_started(example: Path, seed: int) -> None:
    """As it is written and varied."""
    assert MujocoBackend(vary(load(example), seed)).observe().time == 0.0


def test_every_model_and_every_scene_of_ours_is_named() -> None:
    """In the tables of the page."""
    assert {str(model) for model in Model} <= set(re.findall(r"`(\w+)`", PAGE))
    assert {path.stem for path in CANONICAL.parent.glob("*.toml")} <= set(
        re.findall(r"`(\w+)`", PAGE)
    )
