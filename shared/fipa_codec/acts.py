"""Content of the 22 communicative acts (FIPA SC00037J): for each performative the classes of its
expressions.

    A  action expression     C  proposition     D  descriptor     M  embedded message

In the language `fipa-expressions` the content of a communicate is a list of such expressions, as in
FIPA SL. Independent of protocols and of any system's vocabulary.
"""

import math
from collections.abc import Iterator, Mapping
from enum import StrEnum
from typing import Annotated

import msgspec

from fipa_codec.communicate import Communicate
from fipa_codec.errors import ContentError, LocalProtocolError
from fipa_codec.languages import Kind, Language
from fipa_codec.performatives import Performative as P

# --- Expressions of contents (FIPA SC00037J): actions, propositions, descriptors, embedded messages
# They have the structure that the definitions of the acts need; FIPA SL (SC00008I) has the same
# three sorts and more connectives. The tables below say which act carries which. Independent of the
# meaning of acts and of any system's vocabulary.


MAX_DEPTH = 32
"""Depth limit of nested expressions. Estimate; the examples of SC00037J have 5."""

Symbol = Annotated[str, msgspec.Meta(pattern=r"\A[!-~]+\Z", max_length=128)]
"""A name: printable ASCII without blanks, at most as long as a label of a communicate."""


class Quantifier(StrEnum):
    """Number of objects that a descriptor denotes."""

    IOTA = "iota"
    """The only one."""
    ANY = "any"
    """Any one of them."""
    ALL = "all"
    """The set of all of them."""


class _Expression(
    msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True
):
    """Base class: a tagged Struct."""


class Variable(_Expression, frozen=True):
    """The object that the enclosing descriptor with this variable denotes."""

    name: Symbol


class Action(_Expression, frozen=True):
    """An action expression (class A): `agent` performs `act`."""

    agent: Symbol
    act: Symbol
    arguments: tuple["Term", ...] = ()


class Proposition(_Expression, frozen=True):
    """A proposition (class C): `predicate` holds of `terms`, or not. A statement, a condition or a
    reason.
    """

    predicate: Symbol
    terms: tuple["Term", ...] = ()
    negated: bool = False


class Descriptor(_Expression, frozen=True):
    """A descriptor (class D): the object or objects `variable` for which the proposition
    `such_that` holds.
    """

    quantifier: Quantifier
    variable: Symbol
    such_that: Proposition


class Embedded(_Expression, frozen=True):
    """An embedded message (class M): a whole communicate as content."""

    message: Communicate


Term = str | int | float | bool | Variable | Action | Proposition | Descriptor | Embedded
"""An argument of an action or a proposition."""
Expression = Action | Proposition | Descriptor | Embedded
"""An element of a content."""


def done(action: Action) -> Proposition:
    """The content of an `inform-done` of FIPA's protocol diagrams."""
    return Proposition("done", (action,))


def result(action: Action, value: Term) -> Proposition:
    """The content of an `inform-result` of FIPA's protocol diagrams."""
    return Proposition("result", (action, value))


def denotes(descriptor: Descriptor, value: Term) -> Proposition:
    """The answer to a query-ref: the object that the descriptor denotes."""
    return Proposition("=", (descriptor, value))


def check_expression(expression: Expression) -> None:
    """Raise ContentError if the expression is invalid.

    That is: it is nested too deeply, has a number that is not finite or an unbound variable, or the
    proposition of a descriptor does not use its variable.
    """
    free = _free(expression, 0)
    if free:
        raise ContentError(
            "content", f"variable {min(free)!r} is not bound by an enclosing descriptor"
        )


def _free(term: Term, depth: int) -> frozenset[str]:
    """The free variables of a term."""
    if depth > MAX_DEPTH:
        raise ContentError("content", f"is nested deeper than {MAX_DEPTH} expressions")
    if isinstance(term, float) and not math.isfinite(term):
        raise ContentError("content", f"contains {term}, numbers must be finite")
    if isinstance(term, Variable):
        return frozenset((term.name,))
    free = frozenset(name for part in _parts(term) for name in _free(part, depth + 1))
    if isinstance(term, Descriptor):
        if term.variable not in free:
            where = f"descriptor {term.quantifier} {term.variable}"
            raise ContentError(
                "content", f"{where}: {term.such_that.predicate!r} does not use {term.variable!r}"
            )
        return free - {term.variable}
    return free


def _parts(term: Term) -> Iterator[Term]:
    if isinstance(term, Action):
        yield from term.arguments
    elif isinstance(term, Proposition):
        yield from term.terms
    elif isinstance(term, Descriptor):
        yield term.such_that


# --- Content of the 22 communicative acts (FIPA SC00037J) -----------------------------------------


Shape = tuple[tuple[type, ...], ...]
"""For each position in the content, the classes allowed there."""

A, C, D, M = (Action,), (Proposition,), (Descriptor,), (Embedded,)

SHAPES: Mapping[P, Shape] = {
    P.ACCEPT_PROPOSAL: (A, C),
    P.AGREE: (A, C),
    P.CANCEL: (A,),
    P.CFP: (A, D),
    P.CONFIRM: (C,),
    P.DISCONFIRM: (C,),
    P.FAILURE: (A, C),
    P.INFORM: (C,),
    P.INFORM_IF: (C,),
    P.INFORM_REF: (D,),
    P.NOT_UNDERSTOOD: ((*A, *M), C),
    P.PROPAGATE: (D, M, C),
    P.PROPOSE: (A, C),
    P.PROXY: (D, M, C),
    P.QUERY_IF: (C,),
    P.QUERY_REF: (D,),
    P.REFUSE: (A, C),
    P.REJECT_PROPOSAL: (A, C, C),
    P.REQUEST: (A,),
    P.REQUEST_WHEN: (A, C),
    P.REQUEST_WHENEVER: (A, C),
    P.SUBSCRIBE: (D,),
}
"""Content classes by performative.

inform-if and inform-ref are macro acts; theirs is the content to plan (SC00037J).
"""

_CLASS_NAMES: Mapping[type, str] = {
    Action: "an action expression",
    Proposition: "a proposition",
    Descriptor: "a descriptor",
    Embedded: "an embedded message",
}


class Content(
    msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True
):
    """The expressions of one act. `last` marks the last of several informs, for protocols that need
    it (brokering).
    """

    expressions: tuple[Expression, ...]
    last: bool = False


def content_of(performative: P, *expressions: Expression, last: bool = False) -> Content:
    """The content of an outgoing act. Raise LocalProtocolError if the act does not carry these
    expressions.
    """
    content = Content(expressions, last)
    try:
        check_content(performative, content)
    except ContentError as error:
        raise LocalProtocolError(error.field, error.reason) from error
    return content


def check_content(performative: P, content: Content | None) -> None:
    """Raise ContentError (answer: not-understood) if the act does not carry these classes or an
    expression is invalid.

    A cancel may be without content: its conversation says what it cancels.
    """
    if content is None:
        if performative is not P.CANCEL:
            raise ContentError(
                "content", f"is absent; {performative} carries {_shape_text(SHAPES[performative])}"
            )
        return
    shape, found = SHAPES[performative], content.expressions
    if len(found) != len(shape) or any(
        type(one) not in allowed for one, allowed in zip(found, shape, strict=False)
    ):
        given = ", ".join(_CLASS_NAMES[type(one)] for one in found) or "nothing"
        raise ContentError("content", f"is {given}; {performative} carries {_shape_text(shape)}")
    for one in found:
        check_expression(one)


def _shape_text(shape: Shape) -> str:
    return ", ".join(" or ".join(_CLASS_NAMES[kind] for kind in allowed) for allowed in shape)


EXPRESSIONS = Language(
    "fipa-expressions",
    Content,
    kind=lambda content: Kind.FINAL if content.last else Kind.PLAIN,
    check=check_content,
)
"""The language of these contents; `Languages.read` checks a received content against its
performative.
"""
