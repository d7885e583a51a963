"""Running a plan: outcomes lead along arcs, unanswered ones up; every plan that passes the check
ends.
"""

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.design import HFSM
from companion.languages import hfsm, rc, wm
from companion.languages.hfsm import Arc, Machine, Outcome
from services.task import plan as plans
from services.task.plan import PlanError

OUTCOMES = tuple(Outcome)
SAFE = Machine("put everything down", "put", (hfsm.ActState("put", rc.Look("k", ())),))
OTHER_SAFE = Machine("put one thing down", "put", (hfsm.ActState("put", rc.Look("k", ())),))


def act(name, **arcs):
    """A leaf that acts, with arcs by outcome."""
    return hfsm.ActState(name, rc.Look(f"p/{name}", ()), _arcs(arcs))


def machine(name, *states, safe=None, **arcs):
    """A machine that begins with its first state."""
    return Machine(name, states[0].name, states, _arcs(arcs), safe)


def _arcs(arcs):
    return tuple(Arc(Outcome(on), to) for on, to in arcs.items())


NESTED = machine(
    "pour",
    machine("take", act("move", succeeded="grasp"), act("grasp"), succeeded="place", safe=SAFE),
    machine("place", act("release", failed="again"), act("again"), succeeded="look"),
    act("look", succeeded="seen?"),
    hfsm.AskState(
        "seen?",
        wm.Holds(relation="hasExactPose", subject="bowl_1"),
        arcs=_arcs({"succeeded": "end"}),
    ),
    hfsm.EndState("end", Outcome.REPLAN),
    safe=OTHER_SAFE,
)


def test_a_plan_begins_with_its_first_leaf():
    """The initial state, and the initial state of that."""
    assert plans.first(NESTED) == ("take", "move")
    assert isinstance(plans.leaf(NESTED, ("take", "move")), hfsm.ActState)


@pytest.mark.parametrize(
    ("at", "outcome", "leads"),
    [
        (("take", "move"), Outcome.SUCCEEDED, ("take", "grasp")),
        (("take", "move"), Outcome.FAILED, Outcome.FAILED),
        (("take", "grasp"), Outcome.SUCCEEDED, ("place", "release")),
        (("take", "grasp"), Outcome.REPLAN, Outcome.REPLAN),
        (("place", "release"), Outcome.FAILED, ("place", "again")),
        (("place", "release"), Outcome.SUCCEEDED, ("look",)),
        (("place", "again"), Outcome.SUCCEEDED, ("look",)),
        (("seen?",), Outcome.REPLAN, Outcome.REPLAN),
        (("seen?",), Outcome.SUCCEEDED, ("end",)),
        (("end",), Outcome.REPLAN, Outcome.REPLAN),
    ],
)
def test_outcomes_lead_along_arcs(at, outcome, leads):
    """An outcome with an arc leads to its target's first leaf; one without is passed up, at last
    out of the plan.
    """
    assert plans.after(NESTED, at, outcome) == leads


def test_an_arc_to_nothing_passes_the_outcome_up():
    """An empty target ends the machine with the same outcome, as the language says."""
    plan = machine("p", machine("a", act("x", succeeded=""), act("y"), succeeded="b"), act("b"))
    assert plans.after(plan, ("a", "x"), Outcome.SUCCEEDED) == ("b",)


def test_the_innermost_machine_says_what_is_safe():
    """One without an opinion leaves it to the one around it."""
    assert plans.safe(NESTED, ("take", "grasp")) is SAFE
    assert plans.safe(NESTED, ("place", "release")) is OTHER_SAFE
    assert plans.safe(NESTED, ("look",)) is OTHER_SAFE
    assert plans.safe(machine("p", act("x")), ("x",)) is None


@pytest.mark.parametrize(
    ("plan", "where", "name"),
    [
        (Machine("p", "nowhere", (act("x"),)), "p", "nowhere"),
        (Machine("p", "x", ()), "p", "x"),
        (machine("p", act("x", succeeded="y")), "x", "y"),
        (machine("p", machine("a", act("x"), failed="b")), "a", "b"),
        (machine("p", machine("a", act("x", succeeded="b")), act("b")), "x", "b"),
        (machine("p", act("x"), act("y", failed="x")), "y", "x"),
        (machine("p", act("x", failed="x")), "x", "x"),
        (machine("p", act("x"), act("x")), "p", "x"),
        (machine("p", act("x"), safe=machine("s", act("y", failed="z"))), "y", "z"),
    ],
)
def test_a_plan_that_leads_nowhere_is_refused(plan, where, name):
    """The error names where it leads from and where to: what is not there, is there twice, or lies
    behind.
    """
    with pytest.raises(PlanError) as error:
        plans.check(plan)
    assert (error.value.where, error.value.name) == (where, name)
    assert repr(name) in str(error.value)


@pytest.mark.parametrize("at", [("take",), ("look", "deeper"), ("nobody",), ()])
def test_a_position_that_is_no_leaf_is_an_error(at):
    """A machine, something inside a leaf, something unknown, the whole plan."""
    with pytest.raises(PlanError):
        plans.leaf(NESTED, at)


def test_the_nested_plan_passes():
    """The example of this file is a good one."""
    plans.check(NESTED)


# --- random plans ---------------------------------------------------------------------------------


@dataclass
class Drawn:
    """Draws machines whose arcs lead to later siblings."""

    draw: st.DrawFn

    def machine(self, name, depth):
        """A machine of one to four states."""
        names = [f"{name}{k}" for k in range(self.draw(st.integers(1, 4)))]
        states = tuple(self.state(one, names[k + 1 :], depth) for k, one in enumerate(names))
        first, safe = st.sampled_from(names), st.sampled_from((None, SAFE))
        return Machine(name, self.draw(first), states, (), self.draw(safe))

    def state(self, name, later, depth):
        """A leaf or, above the lowest level, a machine."""
        kinds = ("act", "ask", "end", "machine")[: 4 if depth else 3]
        kind = self.draw(st.sampled_from(kinds))
        on = self.draw(st.sets(st.sampled_from(OUTCOMES)))
        to = st.sampled_from(("", *later))
        arcs = tuple(Arc(outcome, self.draw(to)) for outcome in sorted(on))
        match kind:
            case "act":
                return hfsm.ActState(name, rc.Look(name, ()), arcs)
            case "ask":
                return hfsm.AskState(name, wm.Holds(relation="isIn", subject="x"), arcs=arcs)
            case "end":
                return hfsm.EndState(name, self.draw(st.sampled_from(OUTCOMES)))
            case _:
                inner = self.machine(name, depth - 1)
                return Machine(name, inner.initial, inner.states, arcs, inner.safe)


@st.composite
def machines(draw):
    """Random plans, three levels deep."""
    return Drawn(draw).machine("s", 2)


def leaves(machine):
    """Return the number of leaves."""
    return sum(leaves(state) if isinstance(state, Machine) else 1 for state in machine.states)


@given(plan=machines(), data=st.data())
def test_running_always_ends(plan, data):
    """Each leaf is entered at most once, every position is one of a leaf, and an end comes,
    whatever the outcomes.
    """
    plans.check(plan)
    at = plans.first(plan)
    entered = set()
    while not isinstance(at, Outcome):
        assert at not in entered
        entered.add(at)
        leaf = plans.leaf(plan, at)
        drawn = data.draw(st.sampled_from(OUTCOMES))
        outcome = leaf.outcome if isinstance(leaf, hfsm.EndState) else drawn
        assert plans.safe(plan, at) in (None, SAFE)
        at = plans.after(plan, at, outcome)
    assert len(entered) <= leaves(plan)
    assert at == outcome


@given(plan=machines())
def test_a_plan_survives_the_wire(plan):
    """Encoded and decoded it is the same plan, so it runs the same."""
    whole = hfsm.HierarchicalPlan("p", "pour", plan, 1.0, 2)
    assert HFSM.decode(HFSM.encode(whole)) == whole
