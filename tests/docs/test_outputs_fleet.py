"""The outputs that need a running fleet: one fleet, all pages, in the order the blocks say."""

from pathlib import Path

import pytest
import shown

EVERY = [block for page in shown.PAGES for block in shown.blocks(page)]


@pytest.mark.long
@pytest.mark.zenoh
@pytest.mark.timeout(900)
def test_pages_show_what_a_running_fleet_prints(tmp_path: Path) -> None:
    """`scripts/outputs --fleet` rewrites them."""
    shown.place(tmp_path, recorded=False)
    wrong = []
    try:
        for block in shown.in_order(EVERY):
            wrong += shown.differences(block, *shown.run(block, tmp_path))
    finally:
        shown.bash("roco down", tmp_path)
    assert not wrong, "\n".join(one.words for one in wrong)


def test_the_fleet_comes_up_first_and_goes_down_last() -> None:
    """By the numbers of the blocks."""
    commands = [one.command for block in shown.in_order(EVERY) for one in block.shown]
    assert "roco up" in commands[0]
    assert "roco down" in commands[-1]
