"""The expressions that contents are made of (FIPA SC00037J): actions, propositions, descriptors, embedded messages.

A content language of its own with just as much structure as the acts' definitions ask for; SL (SC00008I) has the same
three sorts and more connectives. `acts.py` says which act carries which of them. Must not know: any act's meaning, any
system's vocabulary.
"""

import math
from collections.abc import Iterator
from enum import StrEnum
from typing import Annotated

import msgspec

from fipa_codec.communicate import Communicate
from fipa_codec.errors import ContentError

MAX_DEPTH = 32
"""Expressions within expressions. SC00037J's own examples have 5; estimate."""

Symbol = Annotated[str, msgspec.Meta(pattern=r"\A[!-~]+\Z", max_length=128)]
"""A name: printable ASCII without blanks; length as of the labels of a communicate."""


class Quantifier(StrEnum):
    """How many objects a descriptor denotes."""

    IOTA = "iota"
    """The one."""
    ANY = "any"
    """Some one."""
    ALL = "all"
    """The set of all."""


class _Expression(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True):
    """Part of a content."""


class Variable(_Expression, frozen=True):
    """Stands for the object that a descriptor around it denotes."""

    name: Symbol


class Action(_Expression, frozen=True):
    """`agent` does `act` (class A)."""

    agent: Symbol
    act: Symbol
    arguments: tuple["Term", ...] = ()


class Proposition(_Expression, frozen=True):
    """`predicate` holds of `terms`, or does not (class C): a statement, a condition or a reason."""

    predicate: Symbol
    terms: tuple["Term", ...] = ()
    negated: bool = False


class Descriptor(_Expression, frozen=True):
    """The, any or all objects `variable` of which a proposition holds (class D)."""

    quantifier: Quantifier
    variable: Symbol
    such_that: Proposition


class Embedded(_Expression, frozen=True):
    """A whole communicate as content (class M)."""

    message: Communicate


Term = str | int | float | bool | Variable | Action | Proposition | Descriptor | Embedded
Expression = Action | Proposition | Descriptor | Embedded


def done(action: Action) -> Proposition:
    """What an `inform-done` of the protocol drawings says."""
    return Proposition("done", (action,))


def result(action: Action, value: Term) -> Proposition:
    """What an `inform-result` says."""
    return Proposition("result", (action, value))


def denotes(descriptor: Descriptor, value: Term) -> Proposition:
    """The answer to a query-ref: the object that the descriptor denotes."""
    return Proposition("=", (descriptor, value))


def check_expression(expression: Expression) -> None:
    """ContentError where it is nested too deeply, has a number that is none, or a variable that nothing binds; also
    where a descriptor's proposition says nothing of its variable.
    """
    free = _free(expression, 0)
    if free:
        raise ContentError("content", f"variable {min(free)!r} is bound by no descriptor around it")


def _free(term: Term, depth: int) -> frozenset[str]:
    """The variables of a term that nothing inside it binds."""
    if depth > MAX_DEPTH:
        raise ContentError("content", f"is nested deeper than {MAX_DEPTH} expressions")
    if isinstance(term, float) and not math.isfinite(term):
        raise ContentError("content", f"holds {term}, numbers must be finite")
    if isinstance(term, Variable):
        return frozenset((term.name,))
    free = frozenset(name for part in _parts(term) for name in _free(part, depth + 1))
    if isinstance(term, Descriptor):
        if term.variable not in free:
            where = f"descriptor {term.quantifier} {term.variable}"
            raise ContentError("content", f"{where}: {term.such_that.predicate!r} says nothing of {term.variable!r}")
        return free - {term.variable}
    return free


def _parts(term: Term) -> Iterator[Term]:
    if isinstance(term, Action):
        yield from term.arguments
    elif isinstance(term, Proposition):
        yield from term.terms
    elif isinstance(term, Descriptor):
        yield term.such_that
