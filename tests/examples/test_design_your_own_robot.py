"""docs/design-your-own-robot.md, followed literally from an empty folder to two agents that talk
over Zenoh.
"""

import sys
from pathlib import Path

import pytest
from walked_page import Walk, blocks, normal

PAGE = Path(__file__).parents[2] / "docs" / "design-your-own-robot.md"


@pytest.mark.long
@pytest.mark.zenoh
@pytest.mark.timeout(180)
def test_the_page_does_what_it_shows(tmp_path: Path) -> None:
    """Every command works, and prints what the page shows but for times and folders; in the end the
    cabin has come.
    """
    walk = Walk(tmp_path, Path(sys.executable).parent)
    walk.walk(PAGE)
    assert len(walk.shown) >= 5
    for line, shown, printed in walk.shown:
        assert normal(printed) == normal(shown), f"line {line} of the page"
    assert any(
        "cabin -> panel  inform  Arrived(floor=1)" in printed for _, _, printed in walk.shown
    )
    assert list(tmp_path.glob("lift/runs/latest/*.pid")) == []


def test_the_page_has_the_whole_way() -> None:
    """Commands, files and outputs stand in it, and every command that prints has its output behind
    it.
    """
    kinds = [block.words[-1].partition("=")[0] for block in blocks(PAGE) if block.words]
    assert kinds.count("append") == 4
    assert kinds.count("file") == 5
    assert kinds.count("output") >= 5
    assert all(kinds[index - 1] == "run" for index, kind in enumerate(kinds) if kind == "output")


def test_normal_form_hides_times_and_folders_only() -> None:
    """Another word, or another order of what is said, is seen."""
    one = (
        "lift: router; files in runs/2026\n   2.31 s  all ready\n   5.05 s  C1  a -> b  request\n8"
        " passed in 1.2s\n"
    )
    other = (
        "lift: router; files in /x/runs/7\n  15.05 s  C1  a -> b  request\n   9.00 s  all ready\n8"
        " passed in 22.0s\n"
    )
    assert normal(one) == normal(other)
    assert normal(one) != normal(other.replace("request", "agree"))
