"""`roco design new`, as its user meets it."""

import json
from functools import partial
from pathlib import Path

from calling import printed, roco

from topdown.scaffold import smallest

new = partial(roco, "design", "new")


def test_a_folder_is_enough(tmp_path: Path) -> None:
    """The smallest system gets the folder's name, and every file is told."""
    done = new(tmp_path / "shop", code=0)
    assert "26 files written" in done.stdout
    assert (tmp_path / "shop" / "shop" / "doer" / "behaviours.py").exists()


def test_from_a_design_file_what_was_changed_is_kept_and_told(tmp_path: Path) -> None:
    """With the names that are still to be written."""
    new(tmp_path, "--name", "shop")
    design, mine = tmp_path / "shop" / "design.toml", tmp_path / "shop" / "doer" / "memory.py"
    mine.write_text("# mine\n")
    design.write_text(design.read_text().replace('behaviour = "do"', 'behaviour = "work"'))
    done = new(tmp_path, "--from", design, code=0)
    assert "kept shop/doer/memory.py, which you changed; nothing of yours mentions" in done.stdout
    assert mine.read_text() == "# mine\n"
    assert "def work(" in (tmp_path / "shop" / "doer" / "behaviours.py").read_text()


def test_for_programs_it_is_json(tmp_path: Path) -> None:
    """All lists, none shortened."""
    told = printed("design", "new", tmp_path / "shop")
    assert set(told) == {"folder", "written", "same", "kept", "left"}
    assert len(told["written"]) == 26


def test_what_cannot_be_is_said_and_exits_with_1(tmp_path: Path) -> None:
    """On standard error, with what would be right; nothing is written."""
    (tmp_path / "design.toml").write_text(smallest("two words"))
    done = new(tmp_path / "shop", "--from", tmp_path / "design.toml", code=1)
    assert "letters, digits and _" in done.stderr
    assert not (tmp_path / "shop").exists()
    told = new(tmp_path / "shop", "--from", tmp_path / "design.toml", "--format", "json")
    assert "letters" in json.loads(told.stderr)["error"]
