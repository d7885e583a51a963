"""Every leaf requirement leads to groups, agents, channels and to what shows it; what nothing shows
is told.
"""

from spoiling import design, run, said

from fipa_codec.performatives import Performative as P
from topdown.check.requirements import Shown, descendants, leaves, trace


def test_leaves_are_what_no_other_refines() -> None:
    """R1 and R3 have others below them."""
    assert [leaf.id for leaf in leaves(design())] == ["R2", "R4"]


def test_a_requirement_leads_to_its_agents_and_channels() -> None:
    """R2 divides front in desk and nav and makes C2; R4 divides nothing and adds to C4."""
    orders, places = trace(design())
    assert (orders.steps, orders.groups, orders.agents, orders.channels) == (
        (2,),
        ("desk", "nav"),
        ("desk", "nav"),
        ("C2",),
    )
    assert (places.steps, set(places.groups), places.channels) == ((4,), {"nav", "atlas"}, ("C4",))


def test_a_group_became_what_its_halves_became() -> None:
    """The root became everything."""
    assert set(descendants(design(), "all")) == {"desk", "nav", "base", "atlas"}
    assert descendants(design(), "back") == ("base", "atlas")


def test_without_a_recording_evidence_is_named_only() -> None:
    """Nothing is looked for, nothing is called missing."""
    assert {one.shown for leaf in trace(design()) for one in leaf.evidence} == {Shown.NAMED}


def test_a_run_shows_what_is_in_it() -> None:
    """The order's end is in the run; no new place was told, and the test is there."""
    orders, places = trace(design(), run(), lambda path, name: path.endswith("test_tracing.py"))
    assert [(one.shown, one.count) for one in orders.evidence] == [(Shown.SEEN, 1), (Shown.SEEN, 1)]
    assert [one.shown for one in places.evidence] == [Shown.MISSING, Shown.SEEN]
    told = said(9.0, "atlas>nav", "tell", P.CONFIRM, 50, "t1")
    _, places = trace(design(), run(told), lambda path, name: True)
    assert places.evidence[0].shown is Shown.SEEN


def test_a_leaf_that_nothing_shows_is_bare() -> None:
    """None named, or none there."""
    bare = design(('evidence = ["event:order done", "message:order inform WAY.Arrived"]\n', ""))
    assert [leaf.bare for leaf in trace(bare)] == [True, False]
    assert [leaf.bare for leaf in trace(design(), type(run())(), lambda path, name: False)] == [
        True,
        True,
    ]
