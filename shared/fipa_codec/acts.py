"""Content of the 22 communicative acts (FIPA SC00037J): for each performative the classes of its expressions.

    A  action expression     C  proposition     D  descriptor     M  embedded message

In the language `fipa-expressions` the content of a communicate is a list of such expressions, as in FIPA SL.
Independent of protocols and of any system's vocabulary.
"""

from collections.abc import Mapping

import msgspec

from fipa_codec.errors import ContentError, LocalProtocolError
from fipa_codec.expressions import Action, Descriptor, Embedded, Expression, Proposition, check_expression
from fipa_codec.languages import Kind, Language
from fipa_codec.performatives import Performative as P

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


class Content(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True):
    """The expressions of one act. `last` marks the last of several informs, for protocols that need it (brokering)."""

    expressions: tuple[Expression, ...]
    last: bool = False


def content_of(performative: P, *expressions: Expression, last: bool = False) -> Content:
    """Return the content of an outgoing act. Raise LocalProtocolError if the act does not carry these expressions."""
    content = Content(expressions, last)
    try:
        check_content(performative, content)
    except ContentError as error:
        raise LocalProtocolError(error.field, error.reason) from error
    return content


def check_content(performative: P, content: Content | None) -> None:
    """Raise ContentError (answer: not-understood) if the act does not carry these classes or an expression is invalid.

    A cancel may be without content: its conversation says what it cancels.
    """
    if content is None:
        if performative is not P.CANCEL:
            raise ContentError("content", f"is absent; {performative} carries {_words(SHAPES[performative])}")
        return
    shape, found = SHAPES[performative], content.expressions
    if len(found) != len(shape) or any(type(one) not in allowed for one, allowed in zip(found, shape, strict=False)):
        given = ", ".join(_CLASS_NAMES[type(one)] for one in found) or "nothing"
        raise ContentError("content", f"is {given}; {performative} carries {_words(shape)}")
    for one in found:
        check_expression(one)


def _words(shape: Shape) -> str:
    return ", ".join(" or ".join(_CLASS_NAMES[kind] for kind in allowed) for allowed in shape)


EXPRESSIONS = Language(
    "fipa-expressions",
    Content,
    kind=lambda content: Kind.FINAL if content.last else Kind.PLAIN,
    check=check_content,
)
"""The language of these contents; `Languages.read` checks a received content against its performative."""
