"""Agents and channels as a graph: a node each, agents with their state, channels alight while they carry traffic.

Edges of Rerun have neither colour nor label, so a channel is a node between two agents.
"""

import math

import rerun as rr

from operate.pictures.colours import FRESH, GREY, RED, between, channel
from operate.pictures.happenings import Happening
from operate.pictures.sheet import Colour, Sheet, nodes
from operate.pictures.traffic import BIN_S, Bins
from operate.recording.history import Entered
from operate.recording.records import Spoken
from topdown.model.design import Design

GRAPH = "graph"
WIDE, HIGH = 165.0, 90.0
"""Half axes of the ellipse agents stand on, in points of the viewer; estimate: labels do not meet."""
DIM: Colour = (110, 118, 130)
"""A channel at rest, on light and on dark."""
FADE = 0.55
"""Share of a channel's light that is left after a bin; estimate: dark a second after its last word."""
FULL = 4.0
"""So many communicates in a bin are full light."""


class Graph:
    """Draws the graph at each change of a state or of a light."""

    def __init__(self, sheet: Sheet, design: Design) -> None:
        self._sheet, self._design, self._bins = sheet, design, Bins()
        self._light: dict[str, float] = dict.fromkeys(design.channels, 0.0)
        self._states: dict[str, tuple[str, bool]] = {}
        self._drawn: tuple[list[str], list[Colour]] | None = None
        places = positions(design)
        edges = [(agent, name) for name, one in design.channels.items() for agent in one.ends]
        radii = [9.0 if name in design.agents else 6.0 for name in places]
        look = rr.GraphNodes(list(places), positions=list(places.values()), radii=radii, show_labels=True)
        sheet.static(GRAPH, look)
        sheet.static(GRAPH, rr.GraphEdges(edges))

    def take(self, happening: Happening) -> None:
        """Count a communicate, or note a state."""
        match happening.what:
            case Spoken(channel=name):
                self._bins.add(name, 1.0)
            case Entered(agent=agent, state=state, alive=alive):
                self._states[agent] = (state, alive)

    def pass_time(self, at: float) -> None:
        """Let lights fade and draw what changed."""
        for start, sums in self._bins.close(at):
            for name in self._light:
                lit = self._light[name] * FADE + sums.get(name, 0.0)
                self._light[name] = lit if lit > 0.05 else 0.0
            now = self._now(sums)
            if now != self._drawn:
                self._drawn = now
                self._sheet.add(GRAPH, nodes, start, now)

    def _now(self, sums: dict[str, float]) -> tuple[list[str], list[Colour]]:
        labels, colours = [], []
        for agent in self._design.agents:
            state, alive = self._states.get(agent, ("", True))
            labels.append(f"{agent}: {state}" if alive and state else agent if alive else f"{agent}: gone")
            colours.append(FRESH if alive and state else GREY if alive else RED)
        for name, light in self._light.items():
            rate = sums.get(name, 0.0) / BIN_S
            labels.append(f"{name} {rate:.0f}/s" if rate else name)
            colours.append(between(DIM, channel(name), min(1.0, light / FULL) ** 0.5))
        return labels, colours


def positions(design: Design) -> dict[str, tuple[float, float]]:
    """Agents on an ellipse, neighbours by channels side by side; each channel in the middle of its two."""
    around = ring(design)
    turn = 2 * math.pi / len(around)
    places = {a: (-WIDE * math.cos(turn * k), -HIGH * math.sin(turn * k)) for k, a in enumerate(around)}
    ordered = {agent: places[agent] for agent in design.agents}
    for name, one in design.channels.items():
        (ax, ay), (bx, by) = (places[agent] for agent in one.ends)
        ordered[name] = ((ax + bx) / 2, (ay + by) / 2)
    return ordered


def ring(design: Design) -> list[str]:
    """Return the agents so that channels lead from one to the next, where they do; the least connected first."""
    beside = {
        a: [b for one in design.channels.values() if a in one.ends for b in one.ends if b != a] for a in design.agents
    }
    found: list[str] = []
    waiting = sorted(beside, key=lambda agent: len(beside[agent]))
    while waiting:
        near = [agent for agent in waiting if found and agent in beside[found[-1]]]
        found.append(min(near, key=lambda agent: len(beside[agent])) if near else waiting[0])
        waiting.remove(found[-1])
    return found
