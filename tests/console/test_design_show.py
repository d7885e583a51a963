"""`roco design show`: the companion's design as text, JSON, page and pictures; the committed
pictures are not stale.
"""

import json
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from calling import printed, roco

from companion.design import DESIGN
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.protocols import FIPA, PAPER
from fipa_codec.tables import START, Protocol, Role, Row, Table, Way, known
from topdown.draw import book
from topdown.draw.document import Grid
from topdown.scaffold import smallest

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


# --- `roco design new`, as its user meets it. -----------------------------------------------------


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


# --- `roco protocol`: the tables of every protocol, as they are registered or as the design has
# them.


def names() -> list[str]:
    """Of all protocols, those that another test's system has registered too."""
    return sorted({one.name for one in known()} | set(DESIGN.own_tables))


protocol = partial(roco, "protocol", columns=200)


def of(name: str) -> Protocol:
    """The protocol itself."""
    return DESIGN.own_tables.get(name) or next(one for one in known() if one.name == name)


def table(side: dict[str, Any]) -> Table:
    """A table again, of what was printed of it."""
    rows = [
        Row(row["state"], Way(row["way"]), Performative(row["act"]), Kind(row["kind"]), row["to"])
        for row in side["rows"]
    ]
    return Table(rows, ended=side["ended"], urgent=side["urgent"], resting=side["resting"])


def test_json_is_the_whole_protocol() -> None:
    """Made again of what is printed, it is the same."""
    for name in names():
        shown = printed("protocol", name)
        again = Protocol(
            shown["about"]["name"],
            initiator=table(shown["roles"][Role.INITIATOR]),
            participant=table(shown["roles"][Role.PARTICIPANT]),
            aliases=tuple(shown["about"]["aliases"]),
            confirmed=map(Performative, shown["confirmed"]),
            rounds=map(Performative, shown["rounds"]),
        )
        assert again.same_as(of(name)), name


def halves() -> Iterator[tuple[list[str], str, Role]]:
    """The lines of each role of each protocol."""
    for name in names():
        said = protocol(name).stdout.replace("\nparticipant\n", "\ninitiator\n")
        _, *both = (half.splitlines() for half in said.split("\ninitiator\n"))
        for lines, role in zip(both, Role, strict=True):
            yield lines, name, role


def test_text_has_every_row_and_every_mark() -> None:
    """Under the table of its role; a state stands in the first of its rows only."""
    for lines, name, role in halves():
        found, state = set(), ""
        for words in map(str.split, lines[2:]):  # below the head
            state = words[0] if len(words) == 4 else state
            if {"says", "hears"} & set(words[:2]):
                found.add((state, *words[-3:]))
        expected = of(name).tables[role]
        verbs = {Way.SEND: "says", Way.RECEIVE: "hears"}
        assert found == {(row.state, verbs[row.way], row.word, row.to) for row in expected}
        for mark in ("ended", "urgent", "resting"):
            states = ", ".join(sorted(getattr(expected, mark)))
            assert [line for line in lines if line.startswith(f"{mark:<9}{states}: ")] or not states


def test_the_list_names_each_once_with_whose_rules_it_has() -> None:
    """A protocol common to FIPA and the paper is listed once; the design's own protocols are listed
    as the design's.
    """
    listed = printed("protocol")
    assert sorted(one["name"] for one in listed) == names()

    def of_origin(words: str) -> set[str]:
        return {one["name"] for one in listed if one["origin"].startswith(words)}

    assert of_origin("FIPA") - of_origin("FIPA and") == {p.name for p in set(FIPA) - set(PAPER)}
    assert of_origin("the paper") == {p.name for p in set(PAPER) - set(FIPA)}
    assert of_origin("the design") == set(DESIGN.own_tables)


def test_states_are_those_that_guards_may_name() -> None:
    """Of both roles of every protocol, or of one: while the conversation is open, and when it is
    over.
    """
    listed = printed("protocol", "--states")
    assert sorted({one["protocol"] for one in listed}) == names()
    for one in listed:
        table = of(one["protocol"]).tables[Role(one["role"])]
        assert set(one["over"]) == table.ended
        assert {*one["open"], *one["over"], START} == {*table.states, START}
        assert set(one["open"]).isdisjoint({*one["over"], START})
    assert {one["protocol"] for one in printed("protocol", "cfp", "--states")} == {"cfp"}
    assert protocol("cfp", "--states", "--svg", "cfp.svg").exit_code == 2


def test_an_alias_means_the_same() -> None:
    """FIPA's token, where both profiles have one protocol."""
    assert protocol("fipa-contract-net").stdout == protocol("cfp").stdout


def test_the_drawing_is_an_svg_with_every_opening(tmp_path: Path) -> None:
    """Its name above, the roles, and the acts that open it."""
    file = tmp_path / "made" / "exchange.svg"
    for name in names():
        protocol(name, "--svg", str(file), code=0)
        texts = " ".join(ElementTree.fromstring(file.read_text()).itertext()).split()
        assert {name, "initiator", "participant", *of(name).openings} <= set(texts)


def test_an_unknown_name_is_told_the_known_ones(tmp_path: Path) -> None:
    """Exit code 2, as for any name that is not there; the same for a file that cannot be
    written.
    """
    said = protocol("auction")
    assert (said.exit_code, said.stdout) == (2, "")
    assert all(name in said.stderr for name in names())
    (tmp_path / "folder").mkdir()
    protocol("cfp", "--svg", str(tmp_path / "folder"), code=2)
