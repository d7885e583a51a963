"""Counterexamples are drawn: nothing of a trace is left out, and it fits."""

from hypothesis import given
from hypothesis import strategies as st

from topdown.prove.engine import Finding, Step, as_text
from topdown.prove.stream import Variant, explore_stream

LOST = explore_stream(Variant.RECEIPT_FIRST).findings[0]


def finding(*steps):
    """Three agents in a row; each step: (who, what, new state)."""
    state = {"hi": "idle", "co": "idle", "ta": "idle"}
    start, trace = dict(state), []
    for who, what, new in steps:
        state = state | ({who: new} if who in state else {})
        trace.append(Step(who, what, state))
    return Finding("wrong", "something", tuple(trace), start)


names = st.sampled_from(["hi", "co", "ta"])
states = st.sampled_from(["idle", "busy", "waiting for the report of the plan that is under way"])
words = st.sampled_from(["request", "inform[final]", "execute_the_whole_plan inform[progress]"])
whats = st.one_of(
    st.builds("{} -> {}".format, words, names),
    st.builds("{} <- {}".format, words, names),
    st.builds("{} <- {}; {} -> {}".format, words, names, words, names),
    st.just("dies and is restored"),
)
steps = st.lists(st.tuples(names | st.just("wire"), whats, states), max_size=8)


@given(steps, st.integers(80, 140))
def test_text_numbers_every_step_and_fits(trace, width):
    """This holds for any trace."""
    text = as_text(finding(*trace), width)
    lines = text.splitlines()
    assert [line[:3].strip() for line in lines[2:] if line[:3].strip().isdigit()] == [
        str(number) for number in range(1, len(trace) + 1)
    ]
    assert max(map(len, lines)) <= width


def test_half_arrows_leave_their_sender_and_arrive_at_their_receiver():
    """To the right and to the left, over an agent in between with the name of the one who is
    meant.
    """
    drawn = as_text(
        finding(
            ("hi", "request -> co", "asked"),
            ("co", "request <- hi", "busy"),
            ("ta", "inform -> hi", "idle"),
            ("wire", "loses inform of ta", ""),
        )
    )
    assert "o--request-->" in drawn
    assert "--request-->o" in drawn
    assert "<--inform to hi--o" in drawn
    assert "* loses inform of ta" in drawn
    assert drawn.count("[busy]") == 1


def test_a_real_counterexample_tells_its_story():
    """The lost message: every step and the states of both sides."""
    drawn = as_text(LOST)
    steps = ("issue 1", "record", "send 1", "take 1", "receipt 1", "dies and is restored")
    assert not [word for word in ("message 1 is lost", *steps) if word not in drawn]
    assert drawn.index("send 1") < drawn.index("take 1") < drawn.index("dies and is restored")
