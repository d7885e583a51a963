"""Each of the 22 acts accepts the content classes of SC00037J, and no others."""

import itertools
import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fipa_codec.acts import (
    EXPRESSIONS,
    MAX_DEPTH,
    SHAPES,
    Action,
    Content,
    Descriptor,
    Embedded,
    Proposition,
    Quantifier,
    Variable,
    check_content,
    content_of,
    denotes,
    done,
    result,
)
from fipa_codec.communicate import Communicate, decode, encode
from fipa_codec.errors import ContentError, LocalProtocolError
from fipa_codec.languages import Kind, Languages
from fipa_codec.performatives import Performative as P

LANGUAGES = Languages([EXPRESSIONS])

# The letters of SC00037J, transcribed independently of SHAPES.
CLASSES = """
    accept-proposal AC    agree AC          cancel A         cfp AD            confirm C
    disconfirm C          failure AC        inform C         inform-if C       inform-ref D
    propagate DMC         propose AC        proxy DMC        query-if C        query-ref D
    refuse AC             reject-proposal ACC                request A         request-when AC
    request-whenever AC   subscribe D       not-understood A|MC
"""
LETTERS = {Action: "A", Proposition: "C", Descriptor: "D", Embedded: "M"}

GRASP = Action("ta", "grasp", ("jar",))
FREE = Proposition("free", ("gripper",))
HANDS = Descriptor(Quantifier.ALL, "x", Proposition("hand", (Variable("x"),)))
ASKED = Communicate(
    performative=P.QUERY_REF,
    content=EXPRESSIONS.encode(content_of(P.QUERY_REF, HANDS)),
    sender="co",
)
SAMPLES = {Action: GRASP, Proposition: FREE, Descriptor: HANDS, Embedded: Embedded(ASKED)}


def test_shapes_are_those_of_the_standard():
    """All 22 acts, each with its letters."""
    words = CLASSES.split()
    expected = dict(zip(words[::2], words[1::2], strict=True))
    mine = {
        str(act): "".join("|".join(LETTERS[kind] for kind in place) for place in SHAPES[act])
        for act in P
    }
    assert mine == expected


symbols = st.text(
    st.characters(codec="ascii", min_codepoint=33, max_codepoint=126), min_size=1, max_size=8
)
scalars = st.one_of(
    st.text(max_size=8), st.integers(-(2**63), 2**64 - 1), st.floats(allow_nan=False), st.booleans()
)
finite = scalars.filter(lambda value: not isinstance(value, float) or math.isfinite(value))
messages = st.builds(
    Embedded, st.builds(Communicate, performative=st.sampled_from(P), sender=st.just("ta"))
)


def closed(terms):
    """Return a strategy of closed expressions with parts of `terms`."""
    lists = st.lists(terms, max_size=3).map(tuple)
    propositions = st.builds(Proposition, symbols, lists, st.booleans())
    return st.one_of(st.builds(Action, symbols, symbols, lists), propositions, descriptors(lists))


def descriptors(lists):
    """Return a strategy of descriptors with lists of closed terms."""
    return st.builds(
        lambda quantifier, name, predicate, terms: Descriptor(
            quantifier, name, Proposition(predicate, (Variable(name), *terms))
        ),
        st.sampled_from(Quantifier),
        symbols,
        symbols,
        lists,
    )


terms = st.recursive(st.one_of(finite, messages), closed, max_leaves=8)
lists = st.lists(terms, max_size=3).map(tuple)
BY_CLASS = {
    Action: st.builds(Action, symbols, symbols, lists),
    Proposition: st.builds(Proposition, symbols, lists, st.booleans()),
    Descriptor: descriptors(lists),
    Embedded: messages,
}


@given(st.sampled_from(P), st.data())
def test_content_of_every_act_is_preserved(act, data):
    """Encoded, sent as a communicate, decoded and checked: the content is equal."""
    places = [data.draw(st.sampled_from(place)) for place in SHAPES[act]]
    expressions = [data.draw(BY_CLASS[kind]) for kind in places]
    content = content_of(act, *expressions, last=data.draw(st.booleans()))
    read, kind = LANGUAGES.read(decode(encode(saying(act, content))))
    assert read == content
    assert kind is (Kind.FINAL if content.last else Kind.PLAIN)


def saying(act, content):
    """Return a message with this content."""
    raw = EXPRESSIONS.encode(content)
    return Communicate(performative=act, content=raw, language=EXPRESSIONS.name)


@pytest.mark.parametrize("act", P)
def test_all_other_classes_are_rejected(act):
    """Every list of up to three other classes: a local error if sent, a remote error if
    received.
    """
    own = set(itertools.product(*SHAPES[act]))
    for kinds in (kinds for n in range(4) for kinds in itertools.product(SAMPLES, repeat=n)):
        expressions = tuple(SAMPLES[kind] for kind in kinds)
        if kinds in own:
            check_content(act, content_of(act, *expressions))
            continue
        with pytest.raises(LocalProtocolError, match=f"{act} carries"):
            content_of(act, *expressions)
        with pytest.raises(LocalProtocolError, match=f"{act} carries"):
            EXPRESSIONS.encode(Content(expressions), act)
        with pytest.raises(ContentError, match=f"{act} carries") as caught:
            LANGUAGES.read(saying(act, Content(expressions)))
        assert caught.value.performative is P.NOT_UNDERSTOOD


def test_only_a_cancel_may_come_without_content():
    """Its conversation says what it cancels (the cancel of the paper is empty)."""
    for act in P:
        message = Communicate(performative=act, language=EXPRESSIONS.name)
        if act is P.CANCEL:
            assert LANGUAGES.read(message) == (None, Kind.PLAIN)
        else:
            with pytest.raises(ContentError, match="is absent"):
                LANGUAGES.read(message)


X = Variable("x")
INVALID = {
    "not bound by an enclosing descriptor": Proposition("hand", (X,)),
    "'y' is not bound": denotes(HANDS, Variable("y")),
    "does not use": Proposition("is", (Descriptor(Quantifier.IOTA, "x", FREE),)),
    "does not use 'x'": Proposition("is", (Descriptor(Quantifier.ANY, "x", denotes(HANDS, 1)),)),
    "finite": Proposition("weighs", (math.nan,)),
    "is not finite|finite": Proposition("weighs", (-math.inf,)),
}


@pytest.mark.parametrize("words", INVALID)
def test_invalid_expressions_are_rejected(words):
    """Free variables, descriptors without their variable, numbers that are not finite."""
    with pytest.raises(ContentError, match=words):
        check_content(P.INFORM, Content((INVALID[words],)))


def test_depth_is_bounded():
    """Any depth of nesting is accepted or a typed error."""
    nested = FREE
    for _ in range(MAX_DEPTH):
        nested = Proposition("not", (nested,))
    with pytest.raises(ContentError, match="nested deeper"):
        check_content(P.INFORM, Content((Proposition("not", (nested,)),)))
    with pytest.raises(ContentError):
        EXPRESSIONS.decode(b"\x82\xa4type\xa7Content\xabexpressions" + b"\x91" * 100_000)


def test_uses_of_inform_are_propositions():
    """inform-done, inform-result and the answer to a query-ref are uses of one act."""
    uses = done(GRASP), result(GRASP, 3), denotes(HANDS, "left"), Proposition("open", negated=True)
    for proposition in uses:
        check_content(P.INFORM, content_of(P.INFORM, proposition))


@given(st.binary(max_size=200))
def test_any_bytes_are_content_or_a_content_error(data):
    """Arbitrary bytes cause no other exception."""
    try:
        content = EXPRESSIONS.decode(data)
        EXPRESSIONS.check(P.INFORM, content)
    except ContentError:
        return
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(content), type=Content) == content
