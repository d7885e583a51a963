"""Messages between pl and its search process. None is a communicate, none leaves the computer.

A message names the attempt that it belongs to, so that messages of a killed process are not taken
for the next one's.
"""

import msgspec

from companion.languages import hfsm, wm


class Message(msgspec.Struct, frozen=True, tag=True):
    """A message between agent and search; `attempt` counts searches over all lives of the agent."""

    attempt: int


class Begin(Message, frozen=True):
    """Search for a plan of this network; `seed` of the random numbers."""

    network: hfsm.GroundTaskNetwork
    seed: int


class Stop(Message, frozen=True):
    """The plan is not wanted any more."""


class Answer(Message, frozen=True):
    """The answer of km."""

    answer: wm.AnyAnswer


class Ask(Message, frozen=True):
    """A query for km that the search needs answered."""

    query: wm.AnyQuery


class Found(Message, frozen=True):
    """The end of a search, as co is told it: a plan, or why there is none."""

    plan: hfsm.HierarchicalPlan | hfsm.NoPlan


class Died(msgspec.Struct, frozen=True, tag=True):
    """The child process ended by itself, and why."""

    reason: str


ToSearch = Begin | Answer
FromSearch = Ask | Found
Local = Ask | Found | Died
