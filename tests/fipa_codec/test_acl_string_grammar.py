"""Every legal text of SC00070I's grammar is read to what it means; a changed one is read, or
refused, at once.
"""

import time

import pytest
from grammar import EXPRESSION, messages
from hypothesis import given
from hypothesis import strategies as st

from fipa_codec.acl_string import AclMessage, AclSyntaxError, parse, render

BOUND_S = 1.0
"""CPU time of one text of some hundred bytes. Estimate: thousands of times what it takes."""


pytestmark = pytest.mark.timeout(180)
"""To find one takes a second, to make it small a minute."""


@given(messages())
def test_a_legal_text_is_read_to_what_it_means(drawn):
    """Each spelling of words, strings, numbers, times and identifiers; white space, case and order
    as they come.

    What was read can be printed, and is then read to the same.
    """
    text, meaning = drawn
    assert parse(text) == parse(text.encode()) == meaning
    assert parse(render(meaning)) == meaning


@given(EXPRESSION)
def test_a_legal_expression_is_read_everywhere(drawn):
    """In each parameter that has one, and in a user-defined one."""
    text, meaning = drawn
    for name in (
        "language",
        "encoding",
        "ontology",
        "conversation-id",
        "reply-with",
        "in-reply-to",
    ):
        message = parse(f"(inform :{name} {text} :X-end {text})")
        assert getattr(message, name.replace("-", "_")) == meaning
        assert message.user == {"X-end": meaning}


def cut(data, at, end, _):
    """Without a part."""
    return data[:at] + data[end:]


def doubled(data, at, end, _):
    """A part twice."""
    return data[:end] + data[at:]


def moved(data, at, end, _):
    """A part at the end."""
    return data[:at] + data[end:] + data[at:end]


def overwritten(data, at, _, byte):
    """Another byte."""
    return data[:at] + byte + data[at + 1 :]


def grown(data, at, end, _):
    """A part many times, so that what is not linear shows."""
    return data[:at] + data[at:end] * 500 + data[end:]


CHANGES = st.tuples(
    st.sampled_from([cut, doubled, moved, overwritten, overwritten, grown]),
    st.integers(0, 400),
    st.integers(0, 20),
    st.sampled_from(
        [b'"', b"\\", b"#", b":", b"(", b")", b"9", b"-", b"@", b" ", b"T", b"\xff", b"\x00"]
    ),
)


@given(messages(), st.lists(CHANGES, min_size=1, max_size=4))
def test_a_changed_text_is_read_or_refused_at_once(drawn, changes):
    """A text that is read can be printed; a refused one raises the typed error, with its place in
    the text.
    """
    data = drawn[0].encode()
    for change, at, length, byte in changes:
        at %= len(data) or 1
        data = change(data, at, at + length, byte)
    began = time.thread_time()
    try:
        outcome = parse(data)
    except AclSyntaxError as error:
        outcome = error
    assert time.thread_time() - began < BOUND_S
    if isinstance(outcome, AclMessage):
        assert parse(render(outcome)) == outcome
    else:
        assert 0 <= outcome.offset <= len(data)
        assert outcome.expected
