"""Execution of a plan (an HFSM): the next leaf, the end, the machine that makes it safe. Pure
functions of the plan.

A position is the path of names from a child of the root to a leaf; ta remembers nothing else of a
running plan (paper, Table 6: running is the super-state defined by the HFSM). A plan that passed
`check` ends: its arcs lead to later states only, so no leaf is entered twice.
"""

from companion.languages import hfsm

Position = tuple[str, ...]
Leaf = hfsm.ActState | hfsm.AskState | hfsm.EndState


class PlanError(ValueError):
    """A plan with a wrong arc: `where` (a state or machine) leads to `name`, which is not in
    `known`.
    """

    def __init__(self, where: str, name: str, known: tuple[str, ...]) -> None:
        self.where, self.name, self.known = where, name, known
        states = ", ".join(known) or "nothing"
        super().__init__(
            f"plan: {where} leads to {name!r}, but can lead to {states}; the task fails"
        )


def first(machine: hfsm.Machine) -> Position:
    """The position of the first leaf of a machine."""
    state = _child(machine, machine.initial, machine.name)
    return (state.name, *first(state)) if isinstance(state, hfsm.Machine) else (state.name,)


def leaf(root: hfsm.Machine, position: Position) -> Leaf:
    """The leaf at a position. Raises PlanError if there is none."""
    state = state_at(root, position)
    if isinstance(state, hfsm.Machine):
        raise PlanError("/".join((root.name, *position)), "a leaf", _names(state.states))
    return state


def after(root: hfsm.Machine, position: Position, outcome: hfsm.Outcome) -> Position | hfsm.Outcome:
    """Where an outcome of the leaf at `position` leads: the next position, or the outcome of the
    plan.

    A state without an arc for the outcome passes it up to its machine (hfsm.Machine).
    """
    for depth in range(len(position) - 1, -1, -1):
        machine = state_at(root, position[:depth])
        assert isinstance(machine, hfsm.Machine), f"position {position[:depth]} names a leaf"
        state = _child(machine, position[depth], machine.name)
        target = next((arc.to for arc in _arcs(state) if arc.on == outcome), "")
        if target:
            following = _child(machine, target, state.name)
            path = (*position[:depth], target)
            return (*path, *first(following)) if isinstance(following, hfsm.Machine) else path
    return outcome


def safe(root: hfsm.Machine, position: Position) -> hfsm.Machine | None:
    """The machine that makes the plan safe if cancelled at `position`: the innermost one given."""
    for depth in range(len(position), -1, -1):
        state = state_at(root, position[:depth])
        if isinstance(state, hfsm.Machine) and state.safe is not None:
            return state.safe
    return None


def check(root: hfsm.Machine) -> None:
    """Raise PlanError unless sibling names are unique, initial states exist, and every arc leads to
    a later state.
    """
    names = _names(root.states)
    _child(root, root.initial, root.name)
    for number, state in enumerate(root.states, start=1):
        if state.name in names[number:]:
            once = f"one state of that name only, not {names.count(state.name)}"
            raise PlanError(root.name, state.name, (once,))
        for arc in _arcs(state):
            if arc.to and arc.to not in names[number:]:
                raise PlanError(state.name, arc.to, names[number:])
        if isinstance(state, hfsm.Machine):
            check(state)
    if root.safe is not None:
        check(root.safe)


def _arcs(state: hfsm.State) -> tuple[hfsm.Arc, ...]:
    return () if isinstance(state, hfsm.EndState) else state.arcs


def _names(states: tuple[hfsm.State, ...]) -> tuple[str, ...]:
    return tuple(state.name for state in states)


def state_at(root: hfsm.Machine, position: Position) -> hfsm.State:
    """The state at a position; the root at (). Raises PlanError if there is none."""
    state: hfsm.State = root
    for name in position:
        if not isinstance(state, hfsm.Machine):
            raise PlanError(state.name, name, ())
        state = _child(state, name, state.name)
    return state


def _child(machine: hfsm.Machine, name: str, where: str) -> hfsm.State:
    for state in machine.states:
        if state.name == name:
            return state
    raise PlanError(where, name, _names(machine.states))
