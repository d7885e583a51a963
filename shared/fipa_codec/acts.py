"""Which act carries which content (FIPA SC00037J): each of the 22 performatives with the classes of its expressions.

    A  action expression     C  proposition     D  descriptor     M  embedded message

The content of a communicate in the language `fipa-expressions` is a list of such expressions, as an SL content is.
Must not know: protocols, any system's vocabulary.
"""

from collections.abc import Mapping

import msgspec

from fipa_codec.errors import ContentError, LocalProtocolError
from fipa_codec.expressions import Action, Descriptor, Embedded, Expression, Proposition, check_expression
from fipa_codec.languages import Kind, Language
from fipa_codec.performatives import Performative as P

Shape = tuple[tuple[type, ...], ...]
"""For each place the classes that may stand there."""

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
"""inform-if and inform-ref are macro acts: their content is what they would say, should one plan them (SC00037J)."""

_CALLED: Mapping[type, str] = {
    Action: "an action expression",
    Proposition: "a proposition",
    Descriptor: "a descriptor",
    Embedded: "an embedded message",
}


class Content(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True):
    """The expressions of one act. `last`: the last of several informs, where a protocol tells it apart (brokering)."""

    expressions: tuple[Expression, ...]
    last: bool = False


def speak(performative: P, *expressions: Expression, last: bool = False) -> Content:
    """The content of an act of ours. LocalProtocolError where the act does not carry these expressions."""
    content = Content(expressions, last)
    try:
        check_content(performative, content)
    except ContentError as error:
        raise LocalProtocolError(error.field, error.reason) from error
    return content


def check_content(performative: P, content: Content | None) -> None:
    """ContentError (answer: not-understood) where the act does not carry these classes, or an expression is unsound.

    A cancel may come without content: its conversation says what it cancels.
    """
    if content is None:
        if performative is not P.CANCEL:
            raise ContentError("content", f"is absent; {performative} carries {_words(SHAPES[performative])}")
        return
    shape, found = SHAPES[performative], content.expressions
    if len(found) != len(shape) or any(type(one) not in place for one, place in zip(found, shape, strict=False)):
        given = ", ".join(_CALLED[type(one)] for one in found) or "nothing"
        raise ContentError("content", f"is {given}; {performative} carries {_words(shape)}")
    for one in found:
        check_expression(one)


def _words(shape: Shape) -> str:
    return ", ".join(" or ".join(_CALLED[kind] for kind in place) for place in shape)


EXPRESSIONS = Language(
    "fipa-expressions",
    Content,
    kind=lambda content: Kind.FINAL if content.last else Kind.PLAIN,
    check=check_content,
)
"""The language; `Languages.read` checks what comes in by the act that carries it."""
