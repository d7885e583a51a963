"""JOB: tasks of companions that are put out to tender among robots (contract net, FIPA SC00029H)."""

import msgspec
from companion.design import AnyCommand
from companion.languages.facts import Facts
from fipa_codec.languages import Language


class Sentence(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """Something said in JOB."""


class Call(Sentence, frozen=True):
    """Who can do this, and how soon?"""

    number: int
    task: AnyCommand


class Offer(Sentence, frozen=True):
    """The robot is free, and would do it in `rest` [s, simulated] by its plan; `suspend`: until it had left it safely,
    `resume`: until it was back where it left it (companion.languages.hfsm.ScheduleParameters).
    """

    number: int
    rest: float
    suspend: float
    resume: float


class NotFree(Sentence, frozen=True):
    """The robot cannot do it now, and why."""

    number: int
    why: Facts


class Done(Sentence, frozen=True):
    """The robot says that it is done."""

    number: int


class NotDone(Sentence, frozen=True):
    """It is not, or nobody knows, and why."""

    number: int
    why: Facts


Content = Call | Offer | NotFree | Done | NotDone
LANGUAGE = Language("JOB", Content)
