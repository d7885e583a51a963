"""The order of a step, in real processes: one that dies before any line of it has promised nothing
that is not kept.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

DYING = Path(__file__).with_name("dying_shell.py")


@pytest.fixture(scope="module")
def deaths(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """A death before each line that the steps of two requests run through, each with the life after
    it.
    """
    command = [sys.executable, str(DYING), str(tmp_path_factory.mktemp("deaths"))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=280, check=False)
    assert done.returncode == 0, done.stderr
    found: list[dict[str, Any]] = json.loads(done.stdout)
    return found


@pytest.mark.process
@pytest.mark.timeout(300)
def test_what_left_the_agent_was_on_the_disk(deaths: list[dict[str, Any]]) -> None:
    """A receipt covers only what is journalled as taken; what is said, is journalled as issued."""
    assert len(deaths) > 100
    assert {"_happen", "_carry_out", "append"} <= {one["line"].split(":")[1] for one in deaths[:-1]}
    for one in deaths:
        journal = one["died"]["journal"]
        for entry in one["died"]["left"]:
            assert entry[1] <= journal["taken" if entry[0] == "receipt" else "issued"], one


@pytest.mark.process
@pytest.mark.timeout(300)
def test_after_each_death_nothing_is_lost_and_nothing_done_twice(
    deaths: list[dict[str, Any]],
) -> None:
    """Each request is worked on once; each answer is said, always the same under its number; each
    is receipted.
    """
    for one in deaths:
        assert one["again"] == 0, one
        assert one["journal"]["worked"] == 2, one
        said = {tuple(entry[1:]) for entry in one["left"] if entry[0] == "said"}
        assert {(act, talk) for _, act, talk in said} >= {
            ("agree", "asker-1-1"),
            ("agree", "asker-1-2"),
        }, one
        assert len({number for number, _, _ in said}) == len(said), one
        assert max(entry[1] for entry in one["left"] if entry[0] == "receipt") == 2, one


def test_the_order_was_seen_in_the_middle(deaths: list[dict[str, Any]]) -> None:
    """There are deaths with a record and no receipt, and with a receipt and no answer: else nothing
    was tried.
    """
    seen = {(one["died"]["journal"]["taken"], len(one["died"]["left"])) for one in deaths}
    assert {(0, 0), (1, 0), (1, 1), (1, 2), (2, 2), (2, 3), (2, 4)} <= seen
