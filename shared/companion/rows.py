"""Rows by which a task describes its act, to the agents and to the tools (part `done`).

companion.acts has the tables of all acts.
"""

from collections.abc import Callable
from typing import Any

import msgspec

from companion.languages.evidence import Check, Claim, Otherwise, Sense
from companion.languages.facts import Facts
from companion.languages.rc import Command, Done
from companion.languages.wm import AnySight

THERE = Check(Claim.THERE, "", (Sense.JOINTS,), Otherwise.FAILED)
"""Of each act."""


def held(of: str, otherwise: Otherwise = Otherwise.SAID) -> Check:
    """The check of an act after which a hand holds a thing."""
    return Check(Claim.HELD, of, (Sense.WRIST, Sense.FINGERS, Sense.EYES), otherwise)


class ActRow(msgspec.Struct, frozen=True):
    """What the agents must know of an act.

    `checks`: what must be true after it. `rest_s`: its duration beside its first motion [s,
    simulated], an estimate for time-outs alone. `handles`: it handles an object, which may wait for
    the operator.

    For an act that was done: `fulfilled` tells whether it did what it is for, `outcome_facts` what
    was seen or felt in it, and `sights` what km is told first, beside what an outcome of any act
    tells. `remembered`: these facts are said at the end of the plan, though other acts follow.
    """

    act: type[Command]
    checks: tuple[Check, ...]
    rest_s: float = 2.0
    handles: bool = False
    fulfilled: Callable[[Any, Done], bool] = lambda command, done: True
    outcome_facts: Callable[[Any, Done], Facts] = lambda command, done: ()
    remembered: bool = False
    sights: Callable[[Any, Done], tuple[AnySight, ...]] = lambda command, done: ()


class ShownRow(msgspec.Struct, frozen=True):
    """How the tools show an act.

    `word` and `colour` (#rrggbb) name it in figures. `says`: what the robot does meanwhile.
    `event`: the name of what has happened when it is done, and `of` which fields of the command; ""
    for no event. `points_on`: the field with the thing in whose frame its field `approach` stands;
    "" where it has none.
    """

    act: type[Command]
    word: str
    colour: str
    says: str
    event: str = ""
    of: tuple[str, ...] = ()
    points_on: str = ""
