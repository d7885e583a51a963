"""How a plan (an HFSM) runs: which leaf is next, how it ends, what makes it safe. Pure look-ups in the plan's tree.

A position is the path of names from the root's child to a leaf. ta keeps only that path in its memory; the plan itself
says the rest (paper, Table 6: running is the super-state defined by the HFSM).
"""

from companion.languages import hfsm

Position = tuple[str, ...]
Leaf = hfsm.ActState | hfsm.AskState | hfsm.EndState


class PlanError(ValueError):
    """A plan that leads nowhere: a state or an arc names what is not there."""

    def __init__(self, where: str, name: str, known: tuple[str, ...]) -> None:
        self.where, self.name, self.known = where, name, known
        super().__init__(
            f"plan: {where} leads to {name!r}, but its states are {', '.join(known)}; the plan must be redone"
        )


def first(machine: hfsm.Machine) -> Position:
    """The leaf that a machine begins with."""
    state = _child(machine, machine.initial, machine.name)
    return (state.name, *first(state)) if isinstance(state, hfsm.Machine) else (state.name,)


def leaf(root: hfsm.Machine, position: Position) -> Leaf:
    """The leaf at a position."""
    state: hfsm.State = root
    for name in position:
        if not isinstance(state, hfsm.Machine):
            raise PlanError(state.name, name, ())
        state = _child(state, name, state.name)
    if isinstance(state, hfsm.Machine):
        raise PlanError(state.name, state.initial, tuple(s.name for s in state.states))
    return state


def after(root: hfsm.Machine, position: Position, outcome: hfsm.Outcome) -> Position | hfsm.Outcome:
    """Where an outcome of the leaf at `position` leads: the next leaf, or how the plan ends."""
    for depth in range(len(position) - 1, -1, -1):
        machine = _machine(root, position[:depth])
        state = _child(machine, position[depth], machine.name)
        arcs = () if isinstance(state, hfsm.EndState) else state.arcs
        target = next((arc.to for arc in arcs if arc.on == outcome), "")
        if target:
            following = _child(machine, target, state.name)
            path = (*position[:depth], target)
            return (*path, *first(following)) if isinstance(following, hfsm.Machine) else path
    return outcome


def safe(root: hfsm.Machine, position: Position) -> hfsm.Machine | None:
    """What makes the plan safe when it is cancelled at `position`: of the innermost machine that says so."""
    for depth in range(len(position), -1, -1):
        state = _state(root, position[:depth])
        if isinstance(state, hfsm.Machine) and state.safe is not None:
            return state.safe
    return None


def check(root: hfsm.Machine) -> None:
    """Raise PlanError unless every initial state and every arc names a state that is there."""
    _child(root, root.initial, root.name)
    for state in root.states:
        for arc in () if isinstance(state, hfsm.EndState) else state.arcs:
            if arc.to:
                _child(root, arc.to, state.name)
        if isinstance(state, hfsm.Machine):
            check(state)
    if root.safe is not None:
        check(root.safe)


def _state(root: hfsm.Machine, position: Position) -> hfsm.State:
    state: hfsm.State = root
    for name in position:
        state = _child(state, name, state.name)  # type: ignore[arg-type]
    return state


def _machine(root: hfsm.Machine, position: Position) -> hfsm.Machine:
    state = _state(root, position)
    assert isinstance(state, hfsm.Machine)
    return state


def _child(machine: hfsm.Machine, name: str, where: str) -> hfsm.State:
    for state in machine.states:
        if state.name == name:
            return state
    raise PlanError(where, name, tuple(s.name for s in machine.states))
