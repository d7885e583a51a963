"""An agent dies at the boundary of a message; the task ends as if it had not. All: benchmarks/kill_boundaries.py."""

import boundaries
import pytest
from boundaries import Ending, Side

EACH = 41
"""Every so-manieth message; another offset for each agent and side. A prime, so that all phases are hit."""


@pytest.fixture(scope="module")
def usual() -> Ending:
    """The run without a death."""
    return boundaries.run()


@pytest.mark.parametrize("side", list(Side))
@pytest.mark.parametrize("victim", boundaries.VICTIMS)
def test_a_death_at_a_message_changes_no_end(victim: str, side: Side, usual: Ending) -> None:
    """The same world at km, things where they stood, the same last word; no act twice, poured once."""
    offset = 1 + 6 * boundaries.VICTIMS.index(victim) + 3 * list(Side).index(side)
    for number in range(offset, boundaries.messages() + 1, EACH):
        found = boundaries.run(victim, number, side)
        assert found.world == usual.world, number
        assert (found.stands, found.word, found.poured) == (usual.stands, usual.word, 1), number
        assert not found.doubled, number


def test_the_death_happens(usual: Ending) -> None:
    """Of ex in an act: it is not known how it ended, so more is commanded; of co nothing is."""
    more = [len(boundaries.run("ex", number, Side.AFTER).acts) for number in range(20, 100, 8)]
    assert max(more) > len(usual.acts)
    assert boundaries.run("co", 50, Side.AFTER).acts == usual.acts
