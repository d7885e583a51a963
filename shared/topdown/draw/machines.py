"""State machines of the agents' control subsystems (the paper's Figure 11): states with behaviours,
arcs with conditions.

States stand in layers from the initial one down, in the order of the file; an arc to the next layer
goes straight, those further down run at the right, those back up at the left, each in a track of
its own.
"""

import msgspec

from topdown.draw.canvas import Box, Canvas, Point, tracks, width_of
from topdown.draw.document import Figure, Grid, Section, listed, rulings
from topdown.model.design import Design
from topdown.model.elements import Agent, Arc, State

ROW = 24.0  # between two arcs at a side [px]
GAP = 40.0  # between two states [px]
TRACK = 16.0


def section(design: Design, agent: str | None) -> Section:
    """A figure and its tables for each agent, or for one."""
    agents = design.file.agent if agent is None else (design.agent(agent),)
    parts = tuple(part for entry in agents for part in _parts(entry))
    lead = (
        "A state's behaviour is repeated until its terminal or error condition holds; then the"
        " first arc whose condition holds is taken. An arc without a condition is taken when no"
        " other is."
    )
    return Section("machines", "State machines", lead, parts)


def _parts(agent: Agent) -> tuple[Grid | Figure, ...]:
    if not agent.state:
        return (Grid(f"{agent.name}: no state machine in the design", ("state",), ()),)
    caption = f"{agent.name}: {agent.text}" if agent.text else agent.name
    longest = max(len(state.name) for state in agent.state)
    labels = ((arc, label_of(agent, arc)) for arc in agent.arc)
    told = ((arc, f" {label} " if label else "") for arc, label in labels)
    arcs = "\n".join(f"{a.source.rjust(longest)} ──{label}──▶ {a.target}" for a, label in told)
    notes = rulings((agent.name, agent.ruling))
    figure = Figure(f"machine-{agent.name}", caption, draw(agent), arcs, agent, notes)
    rows = (*([_events(agent)] if agent.row else []), *([_choices(agent)] if agent.choice else []))
    return (figure, _states(agent), _sense(agent), *rows)


def _states(agent: Agent) -> Grid:
    """The states with their behaviours, as in the paper's Tables 3 to 6."""
    rows = []
    for state in agent.state:
        initial = " (initial)" if state.name == agent.initial else ""
        what = (state.behaviour, state.terminal, state.error or "-")
        rows.append((f"{state.name}{initial}", *what))
    notes = rulings(*((f"{arc.source} to {arc.target}", arc.ruling) for arc in agent.arc))
    head = ("state", "behaviour", "until", "or error")
    return Grid(f"{agent.name}: states", head, tuple(rows), notes)


def _sense(agent: Agent) -> Grid:
    """The purpose of the states, and the protocols in which they act."""
    rows = tuple((state.name, listed(state.talks), state.text) for state in agent.state)
    notes = rulings(*((state.name, state.ruling) for state in agent.state))
    head = ("state", "talks in", "what it does")
    return Grid(f"{agent.name}: what is done there", head, rows, notes)


def _events(agent: Agent) -> Grid:
    """The agent's conversational behaviour: its rows."""
    rows = []
    for row in agent.row:
        then = [f"then {row.then}"] if row.then else []
        says = "; ".join([*row.say, *(f"perhaps {said}" for said in row.may), *then])
        when = "; ".join(row.when) or "-"
        rows.append((listed(row.in_), row.on, when, says or "-", row.to or "the same"))
    head = ("in", "at", "if then", "says", "waits next in")
    return Grid(f"{agent.name}: what it says at which event", head, tuple(rows), detail=True)


def _choices(agent: Agent) -> Grid:
    """The ways to go on that rows share."""
    rows = []
    for choice, way in ((c, way) for c in agent.choice for way in c.ways):
        when, says = "; ".join(way.when) or "-", "; ".join(way.say) or "-"
        rows.append((choice.name, when, says, way.to or "as the row says"))
    notes = tuple(f"{choice.name}: {choice.text}" for choice in agent.choice if choice.text)
    head = ("then", "one of: if then", "says", "waits next in")
    return Grid(f"{agent.name}: ways to go on", head, tuple(rows), notes, detail=True)


def label_of(agent: Agent, arc: Arc) -> str:
    """The label of an arc: its place among the state's arcs if there are several, and its
    condition.
    """
    beside = [other for other in agent.arc if other.source == arc.source]
    if len(beside) == 1:
        return arc.when
    return f"{beside.index(arc) + 1} {arc.when or 'otherwise'}"


def draw(agent: Agent) -> Canvas:
    """The machine as a drawing."""
    return _Drawing(agent).canvas


class Side(msgspec.Struct):
    """The arcs at one side of the column: those down at the right (`sign` 1), those up at the left
    (-1).
    """

    sign: int
    arcs: list[Arc]


class _Drawing:
    def __init__(self, agent: Agent) -> None:
        self.agent = agent
        self.canvas = Canvas(f"The state machine of {agent.name}")
        initial = [state for state in agent.state if state.name == agent.initial]
        self.states = [*initial, *(state for state in agent.state if state.name != agent.initial)]
        self.rank = {state.name: number for number, state in enumerate(self.states)}
        known = [arc for arc in agent.arc if arc.source in self.rank and arc.target in self.rank]
        near = (arc for arc in reversed(known) if self._steps(arc) == 1)
        self.straight = list({(arc.source, arc.target): arc for arc in near}.values())
        straight = {id(arc) for arc in self.straight}  # two arcs may be equal
        down = [arc for arc in known if self._steps(arc) >= 0 and id(arc) not in straight]
        self.sides = (Side(1, down), Side(-1, [arc for arc in known if self._steps(arc) < 0]))
        lines = [line for s in self.states for line in ((s.name, "strong"), *self._lines(s))]
        self.width = max(150.0, *(width_of(*line) + 32 for line in lines))
        self.boxes: dict[str, Box] = {}
        y = 0.0
        for state in self.states:
            ends = max(len(self._ends(state, side)) for side in self.sides)
            height = max(30 + 16.0 * len(self._lines(state)), ROW * ends + 12)
            self.boxes[state.name] = Box(0, y, self.width, height)
            y += height + GAP
        for side in self.sides:
            self._side(side)
        for arc in self.straight:
            x, top = self.width / 2, self.boxes[arc.source].bottom
            self.canvas.arrow([(x, top), (x, self.boxes[arc.target].y)])
            if label := label_of(self.agent, arc):
                self.canvas.words((x + 7, top + 17), label, "small")
        for state in self.states:
            self._state(state)
        if initial:
            x = self.width / 2
            self.canvas.dot((x, -36))
            self.canvas.arrow([(x, -31), (x, 0)])

    def _lines(self, state: State) -> list[tuple[str, str]]:
        lines = [(state.behaviour, ""), (f"until {state.terminal}", "small quiet")]
        return [*lines, (f"or error {state.error}", "small alert")] if state.error else lines

    def _state(self, state: State) -> None:
        box = self.boxes[state.name]
        lines = self._lines(state)
        self.canvas.box(box, "box", 12)
        x, y = box.middle[0], box.middle[1] + 4.5 - 8 * len(lines)
        self.canvas.words((x, y), state.name, "strong", "middle")
        for number, (words, css) in enumerate(lines, start=1):
            self.canvas.words((x, y + 16 * number), words, css, "middle")

    def _ends(self, state: State, side: Side) -> list[tuple[Arc, bool]]:
        """Ends of arcs at one side of a state from top to bottom, (arc, leaves); in this order the
        fewest cross.
        """
        loops = [arc for arc in side.arcs if arc.source == arc.target == state.name]
        out = [arc for arc in side.arcs if arc.source == state.name != arc.target]
        into = [arc for arc in side.arcs if arc.target == state.name != arc.source]
        first, then = (into, out) if side.sign > 0 else (out, into)
        looping = [(arc, leaves) for arc in loops for leaves in (True, False)]
        near = sorted(first, key=lambda arc: abs(self._steps(arc)))
        far = sorted(then, key=lambda arc: -abs(self._steps(arc)))
        return [*looping, *((arc, arc.source == state.name) for arc in near + far)]

    def _port(self, name: str, side: Side, arc: Arc, leaves: bool) -> Point:
        box = self.boxes[name]
        ends = self._ends(self.states[self.rank[name]], side)
        place = next(i for i, (other, way) in enumerate(ends) if other is arc and way is leaves)
        y = box.middle[1] + ROW * (place - (len(ends) - 1) / 2) + 5
        return (box.right if side.sign > 0 else box.x), y

    def _side(self, side: Side) -> None:
        starts = [self._port(arc.source, side, arc, True) for arc in side.arcs]
        tips = [self._port(arc.target, side, arc, False) for arc in side.arcs]
        labels = [label_of(self.agent, arc) for arc in side.arcs]
        zone = max((width_of(label, "small") for label in labels), default=0.0) + 26
        found = tracks([(a[1], b[1]) for a, b in zip(starts, tips, strict=True)])
        for start, end, label, track in zip(starts, tips, labels, found, strict=True):
            x = start[0] + side.sign * (zone + TRACK * track)
            self.canvas.arrow([start, (x, start[1]), (x, end[1]), end])
            anchor = "start" if side.sign > 0 else "end"
            self.canvas.words((start[0] + side.sign * 8, start[1] - 4), label, "small", anchor)

    def _steps(self, arc: Arc) -> int:
        """The number of layers that an arc leads down."""
        return self.rank[arc.target] - self.rank[arc.source]
