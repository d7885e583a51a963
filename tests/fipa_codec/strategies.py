"""What the fields of communicates may be."""

from hypothesis import strategies as st

WORDS = st.from_regex(r"\A[A-Za-z][A-Za-z0-9_.@-]{0,20}\Z")
LABELS = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=40)
TIMES = st.floats(allow_nan=False, allow_infinity=False)


def maybe(strategy, absent=""):
    """Return a strategy for an optional field."""
    return st.just(absent) | strategy
