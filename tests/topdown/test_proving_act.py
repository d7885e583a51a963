"""A physical act under any deaths of agent and loop: begun once at most, never told as done when it
was not.
"""

import pytest

from topdown.prove.engine import DEADLOCK, UNREACHED, WRONG
from topdown.prove.verify import Act, Variant, explore_act


def test_the_act_holds_under_any_number_of_deaths() -> None:
    """Once at most, no lie, and its outcome is always told."""
    found = explore_act()
    assert found.holds
    assert found.states > 15


@pytest.mark.parametrize(
    ("variant", "kinds", "words", "steps"),
    [
        (Variant.FORGETS, (DEADLOCK, UNREACHED), "", 2),
        (Variant.BEGINS_AGAIN, (WRONG,), "twice", 6),
        (Variant.MOVES_FIRST, (WRONG,), "twice", 5),
        (Variant.ASSUMES_DONE, (WRONG,), "not", 3),
    ],
)
def test_each_naive_variant_fails_by_the_shortest_way(
    variant: Variant, kinds: tuple[str, ...], words: str, steps: int
) -> None:
    """Forgotten: nobody reports. Begun again, or before the intent stands: twice. Taken for done: a
    lie.
    """
    finding = explore_act(variant).findings[0]
    assert finding.kind in kinds
    assert words in finding.text
    assert len(finding.trace) == steps


def test_every_variant_is_explored() -> None:
    """None is right by accident."""
    assert all(explore_act(variant).findings for variant in Variant if variant is not Variant.RIGHT)
    assert Act().describe(Act().start) == {"agent": "idle; journal: nothing", "loop": "slot: empty"}
