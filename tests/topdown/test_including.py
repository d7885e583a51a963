"""Included systems: what may be wrong with an include is found with file and line; who includes a
system must stand whatever that says, and when it says nothing more.
"""

import re
from pathlib import Path

import pytest
from small import HEAD, STUCK, agent, less, row, use

from topdown.check import check
from topdown.draw.document import Figure
from topdown.draw.system import system_section
from topdown.model.design import Design, load
from topdown.model.findings import Kind
from topdown.prove.engine import WRONG, explore
from topdown.prove.fleet import ANY, Faults, Fleet

SAYS = "agree refuse inform failure"
SWITCH = use("switch", "request", {"hand": "request cancel", "lamp": SAYS})
ORDER = use("switch", "request", {"hand": "request", "lamp": "agree inform failure"})
GUEST = """
[[guest]]
name = "caller"
by = ["hand"]
each_minute = 1
use = [{ name = "light", channel = "G1", agent = "lamp", like = "switch" }]
"""
HOUSE = HEAD + SWITCH + agent("hand", "idle", ()) + agent("lamp", "idle", ()) + GUEST
INCLUDE = """
[[include]]
name = "house"
file = "house.toml"
guest = [{ agent = "lamp", guest = "caller" }]
"""
HAND = (
    '{ in = ["idle"], on = "person wish", say = ["switch request"], to = "waiting" }',
    '{ in = ["waiting"], on = "switch agree" }',
    '{ in = ["waiting"], on = "switch inform", to = "idle" }',
    '{ in = ["waiting"], on = "switch failure", to = "idle" }',
)
ENDS = ("inform", "failure", "refuse")
LAMP = (
    row("idle", "switch request", say="switch agree, house.light request", to="busy"),
    row("busy", "house.light agree"),
    row("busy", "house.light inform[progress]"),
    row("busy", "house.light inform", say="switch inform", to="idle"),
    row("busy", "house.light failure", say="switch failure", to="idle"),
    row("busy", "house.light refuse", say="switch failure", to="idle"),
    row("busy", "late house.light", say="switch failure", to="idle"),
    row("busy", "restart", say="switch failure", to="idle"),
)
"""Has the house switch a light."""
TALKS = ("switch", "switch, house.light")


def written(
    folder: Path, lamp: tuple[str, ...] = LAMP, include: str = INCLUDE, house: str = HOUSE
) -> Design:
    """The design in a folder with the one that it includes."""
    (folder / "house.toml").write_text(house)
    whole = (
        HEAD.replace('"lamp"\nroot', '"flat"\nroot')
        + ORDER
        + agent("hand", "idle waiting", HAND, talks=("switch", "switch"))
        + agent("lamp", "idle busy", lamp, ARCS, talks=TALKS)
        + include
    )
    (folder / "flat.toml").write_text(whole)
    return load(folder / "flat.toml")


ARCS = """
[[agent.arc]]
source = "idle"
target = "busy"

[[agent.arc]]
source = "busy"
target = "idle"
"""


def kinds(design: Design, most: int = ANY) -> set[str]:
    """The kinds of the first findings of its exploration."""
    return {one.kind for one in explore(Fleet(design, Faults(most))).findings}


def found(design: Design, *wanted: Kind) -> list[str]:
    """What the check finds of these kinds, with lines."""
    return [f"{one.line}: {one}" for one in check(design) if one.kind in wanted]


INCLUDING = (Kind.NO_INCLUDE, Kind.TWICE, Kind.UNDEFINED)


def test_the_uses_of_the_guest_are_those_of_the_included_design(tmp_path: Path) -> None:
    """By the name of the include, the agent as initiator; none of them is a rule, a right or a
    protocol here.
    """
    made = written(tmp_path)
    (one,) = made.included_uses.values()
    assert (one.name, one.initiator, one.participant) == ("house.light", "lamp", "house")
    assert {(m.sender, str(m.performative)) for m in one.message} == {
        *(("lamp", act) for act in ("request", "cancel")),
        *(("house", act) for act in SAYS.split()),
    }
    assert not any("house" in key for key in made.rules)
    assert "house.light" not in made.protocols
    assert not found(made, *INCLUDING)


def test_the_figure_has_an_included_system_as_one_box(tmp_path: Path) -> None:
    """With the use by which the agent talks with it."""
    (figure,) = system_section(written(tmp_path), 100).parts
    assert isinstance(figure, Figure)
    assert "[house] included system" in figure.text
    assert "request: lamp → house" in figure.text


@pytest.mark.parametrize("most", [0, 1, ANY])
def test_who_thinks_of_all_that_an_included_system_may_do_holds(tmp_path: Path, most: int) -> None:
    """Whatever it says, if it says nothing more, and whoever dies."""
    model = Fleet(written(tmp_path), Faults(most))
    assert explore(model).holds
    assert model.not_silent() == ()
    assert not any("lamp 7" in note for note in model.unused())
    assert explore(Fleet(written(tmp_path), Faults(0, boot=True))).holds


@pytest.mark.parametrize("words", [*(f"house.light {end}" for end in ENDS), "late", "restart"])
def test_a_row_that_is_missing_is_found(tmp_path: Path, words: str) -> None:
    """Each end may come; so may none, which only the row for the end of the wait answers. The
    guest's own death is a fault.
    """
    rows = less(LAMP, f'"{words}"' if words.startswith("house") else words)
    assert kinds(written(tmp_path, rows)) & {*STUCK, WRONG}
    assert bool(kinds(written(tmp_path, rows), 0)) is (words != "restart")


@pytest.mark.parametrize(
    ("old", "new", "kind", "says"),
    [
        ("house.toml", "home.toml", Kind.NO_INCLUDE, "is no file"),
        ("house.toml", "/dev/zero", Kind.NO_INCLUDE, "is no file"),
        ("house.toml", "nobody:house.toml", Kind.NO_INCLUDE, "no package 'nobody'"),
        ("house.toml", "flat.toml", Kind.NO_INCLUDE, "a circle"),
        ('"lamp", guest', '"lump", guest', Kind.UNDEFINED, "agent here 'lump'"),
        ('"caller"', '"baker"', Kind.UNDEFINED, "guest of lamp 'baker'"),
        ('name = "house"', 'name = "hand"', Kind.TWICE, "the name of an agent"),
        ('[{ agent = "lamp"', '[{ agent = "hand"', Kind.UNUSED, "no state of hand talks"),
        ('"caller" }', '"caller" }, { agent = "lamp", guest = "caller" }', Kind.TWICE, "already"),
    ],
)
def test_what_is_wrong_with_an_include_is_found(
    tmp_path: Path, old: str, new: str, kind: Kind, says: str
) -> None:
    """By its kind, with the line of the include."""
    made = written(tmp_path, include=INCLUDE.replace(old, new))
    line = made.text[: made.text.index("[[include]]")].count("\n") + 1
    told = found(made, kind)
    assert any(says in one for one in told), (told, check(made))
    assert kind is not Kind.NO_INCLUDE or len(check(made)) == 1
    lines = {int(one.partition(":")[0]) for one in told if says in one}
    assert lines <= set(range(line, line + 4)), told


def test_an_included_design_that_cannot_be_read_is_named_with_its_line(tmp_path: Path) -> None:
    """The file and the line of the included design, not only those of the include."""
    broken = HOUSE.replace("each_minute = 1", 'each_minute = "often"')
    (told,) = found(written(tmp_path, house=broken), Kind.NO_INCLUDE)
    line = broken[: broken.index("each_minute")].count("\n") + 1
    assert re.search(rf"house\.toml:{line}: guest\[0\]\.each_minute", told), told


def test_a_circle_over_two_files_is_found(tmp_path: Path) -> None:
    """Also where the included design includes the first one."""
    back = INCLUDE.replace("house.toml", "flat.toml").replace('"house"', '"flat"')
    (told,) = found(written(tmp_path, house=HOUSE + back), Kind.NO_INCLUDE)
    assert "flat.toml" in told
    assert "circle" in told


def test_a_language_of_another_meaning_is_found(tmp_path: Path) -> None:
    """One name, other classes."""
    other = HOUSE.replace('[[language]]\nname = "L"', '[[language]]\nname = "L"\nclasses = ["On"]')
    (told,) = found(written(tmp_path, house=other), Kind.TWICE)
    assert "language L has other classes there" in told
