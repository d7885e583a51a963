"""The JSON schema takes the designs that are read, and refuses those that are not."""

import tomllib
from pathlib import Path

import jsonschema
import pytest

from topdown.model import loading
from topdown.model.elements import FORMAT
from topdown.model.errors import DesignError
from topdown.model.schema import DRAFT, schema

ROOT = Path(__file__).resolve().parents[2]
DESIGNS = [
    path
    for folder in ("shared", "examples", "tests/topdown")
    for path in sorted((ROOT / folder).rglob("*.toml"))
    if "system" in tomllib.loads(path.read_text())
]
VALIDATOR = jsonschema.Draft7Validator(schema())
LAMP = (ROOT / "tests/topdown/lamp.toml").read_text()


def test_the_schema_is_one() -> None:
    """Of the draft that it names."""
    assert schema()["$schema"] == DRAFT
    VALIDATOR.check_schema(schema())


@pytest.mark.parametrize("path", DESIGNS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_design_of_the_repository_is_valid_and_of_this_format(path: Path) -> None:
    """That of the scaffold, too."""
    written = tomllib.loads(path.read_text())
    assert [error.message for error in VALIDATOR.iter_errors(written)] == []
    assert loading.load(path).format == FORMAT


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("format = 2", "format = 3"),
        ("participant =", "participent ="),
        ("durable = true", 'durable = "yes"'),
        ('performative = "inform"', 'performative = "shout"'),
        ('into = ["hand", "lamp"]', 'into = ["hand", "lamp", "cord"]'),
        ('"on", ["L.On"], ["L.Lit"]]', '"on", ["L.On"]]'),
        ('[system]\nname = "lamp"', "[system]"),
    ],
)
def test_a_wrong_file_is_refused_by_both(old: str, new: str) -> None:
    """What the editor marks is what the tools refuse."""
    assert old in LAMP
    text = LAMP.replace(old, new, 1)
    assert not VALIDATOR.is_valid(tomllib.loads(text))
    with pytest.raises(DesignError):
        loading.read(text)
