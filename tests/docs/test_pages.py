"""Pages of docs/ name what there is, and show figures as the code and the results have them."""

import ast
import importlib.util
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import house
import msgspec
import pytest
import writers

from velma.model.kinds import Model
from velma.model.scene import CANONICAL, load, vary
from velma.sim.mujoco_backend import MujocoBackend

ROOT = Path(__file__).parents[2]


# --- docs/architecture.md: the rooms, and who writes an agent's state -----------------------------


def test_the_picture_is_that_of_the_code() -> None:
    """After a change of the imports between rooms: scripts/figures."""
    text = house.PAGE.read_text(encoding="utf-8")
    assert text == house.page(text)


def test_every_room_of_the_code_is_in_the_picture() -> None:
    """A new room cannot be forgotten."""
    assert {room for edge in house.edges() for room in edge} == set(house.ROOMS)


def test_the_table_of_writers_is_that_of_the_code() -> None:
    """After a change of agent_runtime.core: scripts/figures."""
    text = writers.PAGE.read_text(encoding="utf-8")
    assert text == writers.page(text)


def test_every_field_has_a_writer_but_the_name_of_the_agent() -> None:
    """A way to write a field that the script does not know leaves that field without one."""
    assert {field for field, by in writers.writers().items() if not by} == {"agent"}


# --- docs/delivery.md: each promise names a test, and each test it names exists -------------------


NAMED = re.compile(r"`([\w/]+\.py)::(\w+)`")


def promises() -> list[str]:
    """Return the sentences of the lists, up to what is not promised."""
    page = (ROOT / "docs/delivery.md").read_text().partition("## Not promised")[0]
    return re.findall(r"^- (.*?)(?=\n- |\n\n|\Z)", page, re.MULTILINE | re.DOTALL)


def test_each_promise_names_its_test() -> None:
    """A promise that nothing holds is none."""
    assert len(promises()) > 15
    assert [one for one in promises() if not NAMED.search(one)] == []


def test_each_test_named_exists() -> None:
    """Under that name, in that file."""
    named = [match for one in promises() for match in NAMED.findall(one)]
    missing = [
        (file, test)
        for file, test in named
        if not (ROOT / "tests" / file).is_file()
        or f"def {test}(" not in (ROOT / "tests" / file).read_text()
    ]
    assert missing == []


# --- docs/glossary.md names what is in the code ---------------------------------------------------


ROWS = [
    [cell.strip() for cell in line.strip("|\n").split("|")]
    for line in (ROOT / "docs/glossary.md").read_text().splitlines()
    if line.startswith("| ") and not line.startswith("| word ")
]


def names(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.ClassDef):
            yield node.name


def file_of(module: str) -> Path | None:
    path = module.replace(".", "/") + ".py"
    return next(
        (folder / path for folder in (ROOT / "shared", ROOT) if (folder / path).exists()), None
    )


def test_what_the_glossary_names_is_in_the_code() -> None:
    wrong = []
    for word, _, symbol, _ in ROWS:
        module, _, name = symbol.strip("`").rpartition(".")
        file = file_of(module)
        if symbol and (file is None or name not in names(file)):
            wrong.append(f"{word}: {symbol}")
    assert len(ROWS) >= 30
    assert wrong == []


# --- docs/reliability.md: its tables are those of the results -------------------------------------


def script(name: str) -> Any:
    """Return a script of benchmarks/ as a module."""
    found = importlib.util.spec_from_file_location(name, ROOT / f"benchmarks/{name}.py")
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def lines(of: Any) -> list[dict[str, Any]]:
    """Return the results of a script."""
    return [msgspec.json.decode(line) for line in of.RESULTS.read_bytes().splitlines()]


@pytest.mark.parametrize("name", ["fault_table", "coming_back", "soak", "kill_boundaries", "fuzz"])
def test_the_tables_are_those_of_the_results(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """`python benchmarks/NAME.py --table` writes them."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    monkeypatch.syspath_prepend(ROOT / "tests/fuzz")
    monkeypatch.syspath_prepend(ROOT / "tests/fleet")
    made = script(name)
    assert f"{made.BEGIN}{made.printed(lines(made))}{made.END}" in made.PAGE.read_text(
        encoding="utf-8"
    )


def test_a_fault_is_tried_again_only_where_it_had_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cell that poured stands once, so that no lucky run takes the place of another one."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    poured = set()
    for line in lines(script("fault_table")):
        cell = (line["fault"], line["victim"], line["phase"])
        assert cell not in poured, cell
        poured |= {cell} if line["poured"] else set()


# --- docs/scenes.md: its example can be started, its tables name what there is --------------------


SCENES = (ROOT / "docs" / "scenes.md").read_text("utf-8")


@pytest.fixture
def example(tmp_path: Path) -> Path:
    """The scene of the page, as a file."""
    (found,) = re.findall(r"```toml\n(.*?)```", SCENES, re.DOTALL)
    path = tmp_path / "example.toml"
    path.write_text(found, "utf-8")
    return path


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_example_can_be_started(example: Path, seed: int) -> None:
    """As it is written and varied."""
    assert MujocoBackend(vary(load(example), seed)).observe().time == 0.0


def test_every_model_and_every_scene_of_ours_is_named() -> None:
    """In the tables of the page."""
    assert {str(model) for model in Model} <= set(re.findall(r"`(\w+)`", SCENES))
    assert {path.stem for path in CANONICAL.parent.glob("*.toml")} <= set(
        re.findall(r"`(\w+)`", SCENES)
    )
