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
    for field in (
        "language",
        "encoding",
        "ontology",
        "conversation_id",
        "reply_with",
        "in_reply_to",
    ):
        message = parse(f"(inform :{field.replace('_', '-')} {text} :X-end {text})")
        assert getattr(message, field) == meaning
        assert message.user == {"X-end": meaning}


CHANGE = (
    lambda data, at, end, _: data[:at] + data[end:],  # without a part
    lambda data, at, end, _: data[:end] + data[at:],  # a part twice
    lambda data, at, end, _: data[:at] + data[end:] + data[at:end],  # a part at the end
    *[lambda data, at, _, byte: data[:at] + byte + data[at + 1 :]] * 2,  # another byte
    # a part many times, so that what is not linear shows
    lambda data, at, end, _: data[:at] + data[at:end] * 500 + data[end:],
)
BYTES = [bytes([one]) for one in b'"\\#:()9-@ T\xff\x00']
CHANGES = st.tuples(
    st.sampled_from(CHANGE), st.integers(0, 400), st.integers(0, 20), st.sampled_from(BYTES)
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
