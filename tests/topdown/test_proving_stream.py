"""Layer 1: the stream holds under any faults; each naive variant fails, by a shortest way, as was
known before.
"""

import pytest

from topdown.prove.engine import DEADLOCK, UNREACHED, WRONG
from topdown.prove.stream import Stream, Variant, explore_stream
from topdown.prove.verify import ActModel, explore_act
from topdown.prove.verify import Variant as Acting

V = Variant


@pytest.mark.parametrize(
    ("messages", "copies", "fifo"), [(1, 3, False), (3, 3, False), (3, 2, True)]
)
def test_the_stream_holds_under_any_number_of_faults(messages, copies, fifo):
    """Each message is worked on once, in order; none is lost; rest is in reach from everywhere."""
    found = explore_stream(messages=messages, copies=copies, fifo=fifo)
    assert found.holds, str(found.findings)


def test_sizes_are_of_the_order_that_was_known():
    """Another model of the same scheme had 9,335 states; twice as many with a third copy, eight
    times with a fourth message. Here receipts on the way are a set, and RAM that a step has done
    with is forgotten, so there are fewer.
    """
    small = explore_stream().states
    assert 2_000 < small < 9_335
    assert 1.8 < explore_stream(copies=3).states / small < 2.3
    whole = explore_stream(messages=4)
    assert whole.holds
    assert 4 < whole.states / small < 9


STORY = "issue record send send take record dies take record"
NAIVE = {
    V.RECEIPT_FIRST: (WRONG, "is lost", "issue record send take receipt receipt dies"),
    V.SEND_FIRST: (WRONG, "journal knows of no such decision", "issue send take record"),
    V.OUTBOX_IN_RAM: (WRONG, "is lost", "issue record dies"),
    V.NO_RESENDING: (UNREACHED, "", "issue record dies"),
    V.COUNTER_IN_RAM: (WRONG, "under number 1", "issue record dies issue"),
    V.LAST_IN_RAM: (WRONG, "worked on twice", STORY),
    V.MARK_THEN_EFFECT: (WRONG, "is lost", "issue record send take record dies"),
    V.EFFECT_THEN_MARK: (WRONG, "worked on twice", STORY),
    V.ANY_ORDER: (WRONG, "before", "issue record dies issue record send take record"),
}


@pytest.mark.parametrize("variant", NAIVE)
def test_each_naive_variant_fails_by_the_shortest_way(variant):
    """The first words of its steps, as one would tell the story; a set of ids fails even where
    nothing overtakes.
    """
    kind, text, story = NAIVE[variant]
    found = explore_stream(variant, fifo=variant is V.ANY_ORDER).findings
    finding = next(one for one in found if one.kind == kind and text in one.text)
    assert [step.what.split()[0] for step in finding.trace] == story.split()


NAIVE_ACTS = {
    Acting.FORGETS: ((DEADLOCK, UNREACHED), "", 2),
    Acting.BEGINS_AGAIN: ((WRONG,), "twice", 6),
    Acting.MOVES_FIRST: ((WRONG,), "twice", 5),
    Acting.ASSUMES_DONE: ((WRONG,), "not", 3),
}


def test_a_physical_act_holds_and_each_naive_variant_of_it_fails_by_the_shortest_way():
    """Any deaths of agent and loop: begun once at most, no lie, its outcome is told. Forgotten:
    nobody reports. Begun again, or before the intent stands: twice. Taken for done: a lie.
    """
    found = explore_act()
    assert found.holds
    assert found.states > 15
    for variant, (kinds, words, steps) in NAIVE_ACTS.items():
        finding = explore_act(variant).findings[0]
        assert finding.kind in kinds, variant
        assert words in finding.text, variant
        assert len(finding.trace) == steps, variant


def test_every_variant_is_known_to_fail():
    """None is left out above."""
    assert set(NAIVE) == set(Variant) - {Variant.RIGHT}
    assert set(NAIVE_ACTS) == set(Acting) - {Acting.RIGHT}


def test_states_are_told_in_words():
    """The words are those that a drawing shows beside the lifelines."""
    words = Stream().describe(Stream().start)
    assert set(words) == {"sender", "wire", "receiver"}
    assert "outbox empty" in words["sender"]
    assert ActModel().describe(ActModel().start) == {
        "agent": "idle; journal: nothing",
        "loop": "slot: empty",
    }
