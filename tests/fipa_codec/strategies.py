"""What the fields of communicates may be."""

import msgspec
from hypothesis import strategies as st

from fipa_codec.communicate import Communicate
from fipa_codec.performatives import Performative

WORDS = st.from_regex(r"\A[A-Za-z][A-Za-z0-9_.@-]{0,20}\Z")
LABELS = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=40)
TIMES = st.floats(allow_nan=False, allow_infinity=False)


def maybe(strategy, absent=""):
    """Return a strategy for an optional field."""
    return st.just(absent) | strategy


def values(texts, keys, floats=TIMES):
    """Return a strategy for what MessagePack can hold."""
    scalars = st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | floats | texts
    return st.recursive(
        scalars | st.binary(max_size=8),
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=4),
        max_leaves=8,
    )


def communicates(contents, **other):
    """Return a strategy for any communicate; `other`: fields by other strategies."""
    words = dict.fromkeys(("language", "ontology", "protocol", "sender", "receiver"), maybe(WORDS))
    names = ("reply_with", "in_reply_to", "conversation", "id")
    fields = words | dict.fromkeys(names, maybe(LABELS)) | {"reply_by": maybe(TIMES, None)}
    fields |= {"content": maybe(contents, msgspec.UNSET), "sent": TIMES}
    acts = st.sampled_from(Performative)
    return st.builds(Communicate, performative=acts, **fields | other)
