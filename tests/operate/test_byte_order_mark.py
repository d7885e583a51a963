"""TOML with a byte order mark is read; some editors write one."""

import codecs
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from console.faults import verbs
from operate.system import here
from topdown.model import loading
from velma.model import scene

ROOT = Path(__file__).parents[2]


@pytest.fixture
def marked(tmp_path: Path) -> Callable[[str], Path]:
    """Copies a file with a byte order mark before it."""

    def copy(file: str) -> Path:
        (tmp_path / Path(file).name).write_bytes(codecs.BOM_UTF8 + (ROOT / file).read_bytes())
        return tmp_path / Path(file).name

    return copy


@pytest.mark.parametrize(
    ("load", "file"),
    [
        (loading.load, "examples/depot/depot/design.toml"),
        (verbs.load, "examples/depot/faults.toml"),
        (scene.load, "velma/model/scenes/env2.toml"),
    ],
)
def test_a_byte_order_mark_says_nothing(
    load: Callable[[Path], object], file: str, marked: Callable[[str], Path]
) -> None:
    """A design, a scenario of faults, a scene."""
    assert load(marked(file)) == load(ROOT / file)


def test_a_byte_order_mark_does_not_hide_a_project(tmp_path: Path) -> None:
    """Its pyproject.toml named no system then, and another one was taken."""
    shutil.copytree(ROOT / "examples/depot", tmp_path / "depot")
    file = tmp_path / "depot/pyproject.toml"
    file.write_bytes(codecs.BOM_UTF8 + file.read_bytes())
    assert here(tmp_path / "depot").name == here(ROOT / "examples/depot").name == "depot"
