"""Messages between pl and its search process. None is a communicate, none leaves the computer.

A message names the attempt it belongs to: what a killed process had said before is not taken for part of the next one.
"""

import msgspec

from companion.languages import hfsm, wm


class Message(msgspec.Struct, frozen=True, tag=True):
    """A message between agent and search; `attempt` counts searches over all lives of the agent."""

    attempt: int


class Begin(Message, frozen=True):
    """Search a plan for this network; `seed` of the random numbers."""

    network: hfsm.GroundTaskNetwork
    seed: int


class Stop(Message, frozen=True):
    """Stop: the plan is not wanted any more."""


class Answer(Message, frozen=True):
    """The answer of km."""

    answer: wm.AnyAnswer


class Ask(Message, frozen=True):
    """A query for km that the search needs answered."""

    query: wm.AnyQuery


class Found(Message, frozen=True):
    """What the search found, as co is told it: a plan, or why there is none."""

    plan: hfsm.HierarchicalPlan | hfsm.NoPlan


class Died(msgspec.Struct, frozen=True, tag=True):
    """The child ended by itself, and why."""

    reason: str


ToSearch = Begin | Answer
FromSearch = Ask | Found
Local = Ask | Found | Died
