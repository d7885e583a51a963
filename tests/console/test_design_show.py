"""`roco design show`: the companion's design as text, JSON, page and pictures; the committed
pictures are not stale.
"""

from functools import partial
from pathlib import Path

import pytest
from calling import printed, roco

from companion.design import DESIGN
from topdown.draw import book
from topdown.draw.document import Grid

ROOT = Path(__file__).parents[2]
DRAWN = ROOT / "docs" / "design"
KEPT = ("system.svg",)
OTHER = ROOT / "tests" / "topdown" / "lamp.toml"


show = partial(roco, "design", "show")


@pytest.mark.parametrize("columns", [80, 120])
def test_text_fits_the_terminal(columns: int) -> None:
    """All of the companion's design, at both widths, also at length."""
    said = show("--long", columns=columns, code=0)
    assert max(map(len, said.stdout.splitlines())) <= columns
    assert "STATE MACHINES" in said.stdout


def test_json_has_what_the_text_has() -> None:
    """The same sections, tables with their rows."""
    sections = printed("design", "show")
    assert [section["what"] for section in sections] == [
        what for what in book.What if what is not book.What.ALL
    ]
    (tree,) = printed("design", "show", "--what", "tree", "--step", "1")
    assert tree["parts"][1]["rows"] == [["C1", "ac-ec", "1", "commands to be executed"]]


@pytest.mark.parametrize(
    ("words", "sections"),
    [
        (["--step", "4"], ["steps"]),
        (["--agent", "co"], ["interfaces", "machines"]),
        (["--protocol", "act"], ["protocols"]),
        (["--what", "system", "--agent", "co"], ["system"]),
    ],
)
def test_an_option_alone_chooses_the_sections_it_is_about(
    words: list[str], sections: list[str]
) -> None:
    """A step its table, an agent its interface and machine, a protocol its diagram."""
    found = printed("design", "show", *words)
    assert [section["what"] for section in found] == sections


def test_another_design_is_shown_and_written(tmp_path: Path) -> None:
    """A file of any system; page and pictures are named when written."""
    page, folder = tmp_path / "new" / "lamp.html", tmp_path / "svg"
    said = show(str(OTHER), "--html", str(page), "--svg", str(folder), code=0)
    assert page.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert {path.name for path in folder.iterdir()} >= {
        "system.svg",
        "tree.svg",
        "machine-lamp.svg",
    }
    assert str(page) in said.stdout


def test_what_is_not_there_is_an_error_that_lists_what_is() -> None:
    """Exit code 1, words on standard error."""
    said = show("--agent", "nobody", code=1)
    assert "the design has co, " in said.stderr
    show("no/such/file.toml", code=2)


def grid(what: book.What, title: str, **choice: int) -> Grid:
    """A table of the companion's design."""
    (section,) = book.sections(DESIGN, book.Choice((what,), **choice))
    return next(part for part in section.parts if isinstance(part, Grid) and part.title == title)


def test_step_1_and_step_4_are_the_papers_tables_1_and_2() -> None:
    """Division, tasks, reallocation, new channels and what they transmit."""
    first = dict(grid(book.What.STEPS, "Step 1", step=1).rows)
    assert first["Division"] == "RoCo := <ac, ec>"
    assert (first["Channel reallocation"], first["New channels"]) == ("-", "C1 ac-ec")
    assert first["C1 transmits"] == "commands to be executed"
    fourth = dict(grid(book.What.STEPS, "Step 4", step=4).rows)
    assert fourth["Division"] == "cp := <pl, km>"
    assert (fourth["Channel reallocation"], fourth["New channels"]) == (
        "C3 co-cp ↦ C3 co-pl",
        "C4 pl-km",
    )
    assert fourth["C4 transmits"] == "knowledge needed by the planner"


def test_generate_plan_is_listed_as_the_paper_writes_it() -> None:
    """('request', 'generatePlan', [GroundTaskNetwork], HierarchicalPlan), section 5.6."""
    rows = grid(book.What.INTERFACES, "pl answers").rows
    assert rows == (
        (
            "generate_plan",
            "co",
            "request",
            "generatePlan",
            "HFSM.GroundTaskNetwork",
            "HFSM.HierarchicalPlan",
        ),
    )


def test_the_committed_pictures_are_those_of_the_design() -> None:
    """docs/design is drawn from the design file; after a change of either: scripts/figures."""
    sections = book.sections(DESIGN)
    drawn = book.figures(sections)
    stale = [name for name in KEPT if (DRAWN / name).read_text(encoding="utf-8") != drawn[name]]
    assert not stale, f"{', '.join(stale)}: draw them anew with scripts/figures"
