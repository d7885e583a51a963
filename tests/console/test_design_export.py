"""`roco design export`: files for spin, of any design file."""

import json
from functools import partial
from pathlib import Path

import pytest
from calling import roco

from companion.design import DESIGN
from topdown.prove.net import promela
from topdown.prove.pairs import net_of

LAMP = Path(__file__).parents[1] / "topdown" / "lamp.toml"


export = partial(roco, "design", "export")


def test_one_use_goes_to_one_file(tmp_path: Path) -> None:
    """The text is that of the net which is explored."""
    file = tmp_path / "plan.pml"
    said = export("--promela", str(file), "--use", "execute_plan", "--faults", "1", code=0)
    assert file.read_text() == promela(net_of(DESIGN, "execute_plan", 1))
    assert f"spin -a -o1 -o2 {file}" in said.stdout.replace("\n", "")


def test_a_pair_goes_to_a_folder(tmp_path: Path) -> None:
    """Both uses that are meant, each in a file of its own."""
    said = export(
        "--promela",
        str(tmp_path / "models"),
        "--pair",
        "co-ta",
        "--use",
        "generate_plan",
        "--format",
        "json",
        code=0,
    )
    written = json.loads(said.stdout)
    assert [one["use"] for one in written] == ["generate_plan", "execute_plan"]
    for one in written:
        assert Path(one["file"]).read_text() == promela(net_of(DESIGN, one["use"], 0))


def test_another_design_is_exported_whole(tmp_path: Path) -> None:
    """Nothing of the companion is needed."""
    export(str(LAMP), "--promela", str(tmp_path), "--ideal", code=0)
    assert [path.name for path in tmp_path.iterdir()] == ["switch.pml"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "nothing to write; name a file or a folder with --promela"),
        (["--promela", "x.pml", "--use", "dance"], "execute_plan"),
        (["--promela", "x.pml", "--pair", "co"], "write two agents with - between"),
        (["--promela", "x.pml", "--pair", "hi-ex"], "hi-co"),
    ],
)
def test_what_is_wrong_is_said_with_what_would_be_right(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And nothing is written."""
    monkeypatch.chdir(tmp_path)
    result = export(*words, code=2)
    assert said in result.stderr
    assert not list(tmp_path.iterdir())
