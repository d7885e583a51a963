"""Signals of a run: which are found by their time, and how many are decoded for it."""

from collections import Counter
from pathlib import Path

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from companion.telemetry import RobotState, TrueState
from companion.tools.report import report
from companion.tools.system import SYSTEM
from companion.tools.telemetry import DECODERS, Clock, every
from operate.recording.history import Signals
from operate.recording.records import House
from operate.recording.run import Run

KINDS = ("telemetry", "truth", "ping")
POUR = Path(__file__).parents[2] / "histories" / "pour_seed_7"
times = st.integers(0, 9).map(float)


def decoded(data: bytes) -> str:
    """The text; of "?" nothing."""
    if data == b"?":
        raise msgspec.DecodeError
    return data.decode()


@given(
    st.lists(st.tuples(times, st.sampled_from(KINDS), st.booleans())),
    times,
    st.sampled_from(KINDS[:2]),
)
def test_signals_are_found_by_their_time(
    some: list[tuple[float, str, bool]], at: float, kind: str
) -> None:
    """Those of a kind up to a time, newest first, and those after it, oldest first; what cannot be
    read is never among them, nor what the system does not know.
    """
    some.sort(key=lambda one: one[0])
    houses = [
        House(kind, "ex", "", when, str(number).encode() if good else b"?")
        for number, (when, kind, good) in enumerate(some)
    ]
    signals = Signals(houses, dict.fromkeys(KINDS[:2], decoded))
    good = [one for one in houses if one.data != b"?" and one.kind in KINDS[:2]]
    wanted = [(one.received, one.data.decode()) for one in good if one.kind == kind]
    assert list(signals) == [(one.received, one.data.decode()) for one in good]
    assert list(signals.until(at, kind)) == [one for one in wanted[::-1] if one[0] <= at]
    assert list(signals.after(at, kind)) == [one for one in wanted if one[0] > at]


def test_a_report_decodes_few_signals_and_none_twice() -> None:
    """Of true states one for each task and the newest one; of the robot's two for each event, and
    for each act's begin and end.
    """
    past, counted = Run(POUR, SYSTEM).history, Counter[tuple[str, bytes]]()

    def counting(kind: str):
        def decode(data: bytes) -> object:
            counted[kind, data] += 1
            return DECODERS[kind](data)

        return decode

    signals = Signals(past.signals.houses, {kind: counting(kind) for kind in DECODERS})
    told = report.build(msgspec.structs.replace(past, signals=signals))
    assert told == report.build(past)
    most = {"truth": 4, "telemetry": 2 * (len(told.events) + 40)}
    for kind, count in Counter(kind for kind, _ in counted).items():
        assert 0 < count <= most[kind]
    assert sum(one.kind == "truth" for one in past.signals.houses) > 100 * most["truth"] / 4
    assert len(past.signals.houses) == len({(one.kind, one.data) for one in past.signals.houses})
    assert set(counted.values()) == {1}


def test_the_clock_goes_evenly_between_two_signals() -> None:
    """At a signal it shows that one's time, between two a time between theirs."""
    past = Run(POUR, SYSTEM).history
    clock, states = Clock(past), every(past, RobotState)
    assert every(past, TrueState)
    for (at, one), (later, following) in zip(states[:-1:50], states[1::50], strict=False):
        assert clock.sim(at) == one.sim_time_s
        middle = clock.sim((at + later) / 2)
        assert middle is not None
        assert one.sim_time_s <= middle <= following.sim_time_s
    assert clock.sim(states[0][0] - 1.1) is None
    assert clock.sim(states[0][0] - 0.9) == states[0][1].sim_time_s


def test_without_words_a_run_is_the_same_otherwise() -> None:
    """Its report is the same; its records and verdicts have no words."""
    worded, plain = Run(POUR, SYSTEM), Run(POUR, SYSTEM, words=False)
    assert report.build(plain.history) == report.build(worded.history)
    assert any(one.text for one in worded.judged)
    assert not any(one.text for one in plain.judged)
    bare = [msgspec.structs.replace(one, text="") for one in worded.judged]
    assert list(plain.judged) == bare
