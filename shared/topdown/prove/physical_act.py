"""Layer 1, besides: one physical act between an agent and the process that moves, in micro-steps, under any deaths.

The agent records the intent, commands the loop with the act's key in a slot, records the outcome, reports it. The loop
begins what the slot says, once, and writes the phase there. After a death of the agent with an intent and no outcome
the slot decides: this key is waited for or taken, anything else is an outcome `unknown`; a new loop has an empty slot.
A command between intent and slot that is lost gives `unknown` as well: the act happens once at most, not exactly once.
"""

from collections.abc import Iterator
from enum import StrEnum
from typing import NamedTuple

from topdown.prove.engine import Exploration, Move, explore

AGENT, LOOP = "agent", "loop"


class Variant(StrEnum):
    """The scheme, and what one might have built instead."""

    RIGHT = "as designed"
    FORGETS = "the act is forgotten by a death"
    BEGINS_AGAIN = "the act is begun again after a death"
    MOVES_FIRST = "commanded before the intent is recorded"
    ASSUMES_DONE = "taken for done after a death"


class At(StrEnum):
    """The agent's next action (RAM)."""

    IDLE = "idle"
    INTENDS = "has recorded the intent"
    COMMANDED = "has commanded, and recorded nothing"
    WAITS = "waits for the loop"
    KNOWS = "has recorded the outcome"
    TOLD = "has reported"
    FORGOTTEN = "knows of no act"


class Phase(StrEnum):
    """The slot's content for this act's key."""

    EMPTY = "empty"
    WANTED = "wanted"
    RUNS = "runs"
    DONE = "done"


NOTHING, INTENT, DONE, UNKNOWN = "nothing", "intent", "done", "unknown"


class Place(NamedTuple):
    """State of the whole. `journal` is on disk; `begun`: how often the arm began; `ended`: it came to the act's end."""

    agent: At = At.IDLE
    journal: str = NOTHING
    slot: Phase = Phase.EMPTY
    begun: int = 0
    ended: bool = False


class Act:
    """The model, for engine.explore."""

    def __init__(self, variant: Variant = Variant.RIGHT) -> None:
        self.variant, self.start = variant, Place()

    def moves(self, state: Place) -> Iterator[Move]:
        """Of agent and loop, then the deaths of each."""
        yield from self._agent(state)
        yield from self._loop(state)
        yield Move(AGENT, "dies and comes back", self._restored(state), fault=True)
        if state.slot is not Phase.EMPTY:
            yield Move(LOOP, "dies and comes back", state._replace(slot=Phase.EMPTY), fault=True)

    def at_rest(self, state: Place) -> bool:
        """The outcome is told."""
        return state.agent is At.TOLD

    def wrong(self, state: Place) -> str:
        """Twice, or a lie."""
        if state.begun > 1:
            return "the act was begun twice"
        lies = state.agent is At.TOLD and state.journal == DONE and not state.ended
        return "an act is told as done that was not" if lies else ""

    def describe(self, state: Place) -> dict[str, str]:
        """For drawings."""
        return {AGENT: f"{state.agent}; journal: {state.journal}", LOOP: f"slot: {state.slot}"}

    def _agent(self, state: Place) -> Iterator[Move]:
        match state.agent:
            case At.IDLE if self.variant is Variant.MOVES_FIRST:
                yield Move(AGENT, "takes the request; act -> loop", self._commanded(state, At.COMMANDED))
            case At.IDLE:
                yield Move(AGENT, "takes the request, records the intent", _recorded(state, At.INTENDS, INTENT))
            case At.COMMANDED:
                yield Move(AGENT, "records the intent", _recorded(state, At.WAITS, INTENT))
            case At.INTENDS:
                yield Move(AGENT, "act -> loop", self._commanded(state, At.WAITS))
            case At.WAITS if state.slot is Phase.DONE:
                yield Move(AGENT, "done <- loop; records it", _recorded(state, At.KNOWS, DONE))
            case At.WAITS if state.slot is Phase.EMPTY:
                yield Move(AGENT, "finds a new loop; records unknown", _recorded(state, At.KNOWS, UNKNOWN))
            case At.KNOWS:
                yield Move(AGENT, f"reports {state.journal}", state._replace(agent=At.TOLD))

    def _commanded(self, state: Place, then: At) -> Place:
        return state._replace(agent=then, slot=Phase.WANTED)

    def _loop(self, state: Place) -> Iterator[Move]:
        if state.slot is Phase.WANTED:
            yield Move(LOOP, "begins the act", state._replace(slot=Phase.RUNS, begun=state.begun + 1))
        elif state.slot is Phase.RUNS:
            yield Move(LOOP, "ends the act", state._replace(slot=Phase.DONE, ended=True))

    def _restored(self, state: Place) -> Place:
        """Moves of the agent after a death, by its journal and the slot."""
        if state.journal == NOTHING:
            return state._replace(agent=At.IDLE)
        if state.journal != INTENT:
            return state._replace(agent=At.KNOWS if state.agent is not At.TOLD else At.TOLD)
        match self.variant:
            case Variant.FORGETS:
                return state._replace(agent=At.FORGOTTEN)
            case Variant.BEGINS_AGAIN:
                return state._replace(agent=At.INTENDS)
            case Variant.ASSUMES_DONE:
                return _recorded(state, At.KNOWS, DONE)
        return state._replace(agent=At.WAITS)


def _recorded(state: Place, then: At, word: str) -> Place:
    return state._replace(agent=then, journal=word)


def explore_act(variant: Variant = Variant.RIGHT) -> Exploration:
    """Everything that can happen to an act; where something is wrong, the shortest way there."""
    return explore(Act(variant))
