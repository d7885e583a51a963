"""A short soak, as benchmarks/soak.py does it for long: cut and killed, all is taken once and in
order.
"""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

import soak
import soak_agents

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(240)]
EXCHANGES, STEP = 150, 25


def test_nothing_is_lost_doubled_or_misordered(tmp_path: Path) -> None:
    """A wire cut, ta, ex and the router killed while words are under way."""
    processes = soak.Processes(tmp_path, EXCHANGES)
    harm = (
        lambda: processes.cut("ex", soak.CUT_S),
        lambda: processes.kill("ta"),
        lambda: processes.kill("ex"),
        lambda: processes.kill("router"),
    )
    try:
        for number, do in enumerate(harm, 1):
            enough = number * STEP * soak.EACH
            processes.wait(lambda: processes.said() >= enough, f"harm {number}")  # noqa: B023
            do()
        processes.wait(lambda: processes.said() == EXCHANGES * soak.EACH, "the end")
    finally:
        processes.end()
    found = soak.memories(tmp_path)
    assert {name: one.taken for name, one in found.items()} == {"ta": EXCHANGES, "ex": EXCHANGES}
    assert all((one.lost, one.doubled, one.unordered) == (0, 0, 0) for one in found.values())


def test_what_comes_otherwise_than_next_is_counted() -> None:
    """Else the soak would prove nothing."""
    memory = soak.Memory(taken=4)
    assert soak_agents.taken(memory, 5) == soak.Memory(taken=5)
    assert soak_agents.taken(memory, 7) == soak.Memory(taken=7, lost=2)
    assert soak_agents.taken(memory, 4) == soak.Memory(taken=4, doubled=1)
    assert soak_agents.taken(memory, 2) == soak.Memory(taken=4, unordered=1)
