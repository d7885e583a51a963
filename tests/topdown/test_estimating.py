"""Estimates follow from the typical figures, and are right beside a run that has them."""

import pytest
from spoiling import Change, design, run

from topdown.check.estimate import UseEstimate, estimate, measure, recorded_as_estimate
from topdown.check.recorded import Observed

AGREE = '"base", performative = "agree", language = "WAY", bytes = 100'


def by_use(*changes: Change) -> dict[str, UseEstimate]:
    """The estimate of each use."""
    return {one.use: one for one in estimate(design(*changes)).uses}


def test_conversations_multiply_down_the_uses() -> None:
    """2 orders, 3 drives and 10 questions in each; a place is told for each drive, though the
    conversation is one for each order. The most is what budgets allow.
    """
    found = by_use()
    counts = {name: one.conversations for name, one in found.items()}
    assert counts == {"order": 2, "drive": 6, "ask": 20, "tell_place": 2}
    ask = found["ask"].load
    assert (ask.communicates, ask.bytes) == (40, 20 * (100 + 500))
    assert ask.most_bytes == 20 * (200 + 900)
    assert found["tell_place"].load.bytes == 6 * (400 + 50)


def test_time_adds_up_but_for_what_goes_on_alongside() -> None:
    """An order: 3 drives of 8 s, 10 questions of 0.05 s; telling goes on beside it."""
    found = estimate(design())
    assert found.seconds == pytest.approx(2 * (3 * 8.0 + 10 * 0.05))
    waited_for = ("typical_latency_s = 0.05\nalongside = true", "typical_s = 1")
    assert estimate(design(waited_for)).seconds == pytest.approx(found.seconds + 2 * 1 * 1.0)
    beside = (waited_for[0], "typical_s = 1\nalongside = true")
    assert estimate(design(beside)).seconds == pytest.approx(found.seconds)


def test_bandwidth_is_bytes_over_the_time_it_goes_on() -> None:
    """Of all channels C4 carries most: 20 questions of 600 bytes and 6 places of 450 in 49 s."""
    found = estimate(design())
    assert found.channels["C4"].mean_bit_s == pytest.approx(8 * (12000 + 2700) / 49)
    assert (found.narrowest, found.slowest) == ("C4", "drive")


def test_an_answer_that_is_the_result_takes_as_long_as_the_conversation() -> None:
    """Of a drive the inform is the answer; an order is answered at once by its agree."""
    found = by_use()
    assert (found["drive"].latency_s, found["ask"].latency_s) == (8.0, 0.05)


def test_uses_without_figures_are_named_and_counted_once() -> None:
    """One conversation within each order. `per = 0` is a figure."""
    assert estimate(design(("per = 10\n", ""))).missing == ("ask",)
    assert by_use(("per = 10\n", ""))["ask"].conversations == 2
    assert estimate(design(("per = 10\n", "per = 0\n"))).missing == ()
    assert by_use(("per = 10\n", "per = 0\n"))["ask"].load.bytes == 0


def test_without_counts_the_shortest_conversation_is_counted_with_its_budgets() -> None:
    """A drive is a request (200 B) and an inform (100 B); the agree may be left out. Sizes unstated
    are the budgets.
    """
    silent = [
        ('typical_bytes = 200, count = 1 },\n  { sender = "base"',
         'typical_bytes = 200 },\n  { sender = "base"'),
        (
            '"base", performative = "agree", language = "WAY", bytes = 100, '
            "typical_bytes = 50, count = 1",
            AGREE,
        ),
        ('content = ["Driven"], bytes = 300, typical_bytes = 100, count = 1',
         'content = ["Driven"], bytes = 300'),
    ]  # fmt: skip
    drive = by_use(*silent)["drive"]
    assert estimate(design(*silent)).missing == ("drive",)
    assert (drive.load.communicates, drive.load.bytes) == (6 * 2, 6 * (200 + 300))


def test_cause_and_effect_in_a_circle_end() -> None:
    """A use within itself opens nothing, and the estimate is made."""
    assert estimate(design(('within = "order"\nper = 3', 'within = "drive"\nper = 3'))).seconds > 0


def test_a_run_is_measured_in_the_words_of_the_estimate() -> None:
    """One order with one drive and one question."""
    found = recorded_as_estimate(design(), run())
    assert found.seconds == pytest.approx(8.4)
    assert found.channels["C3"].communicates == 3
    assert found.channels["C3"].bytes == 350


def test_an_estimate_made_of_a_run_has_no_error_beside_it() -> None:
    """Figures of the run put into the design: every error is within 2 %."""
    fitted = design(
        ("per = 2\n", "per = 1\n"), ("per = 3\n", "per = 1\n"), ("per = 10\n", "per = 1\n"),
        ("typical_bytes = 400, count = 1, each", "typical_bytes = 400, count = 0, each"),
        ("typical_bytes = 50, count = 1, each", "typical_bytes = 50, count = 0, each"),
        ("latency_s = 1.0\n", "latency_s = 1.0\ntypical_s = 0.35\ntypical_latency_s = 0.1\n"),
    )  # fmt: skip
    figures = measure(fitted, estimate(fitted), run())
    assert {one.where for one in figures} >= {"run", "C2", "C3", "C4", "drive", "ask", "order"}
    assert all(one.error is None or abs(one.error) < 0.02 for one in figures), figures


def test_a_wrong_estimate_shows_its_error() -> None:
    """Three drives estimated, one was made."""
    figures = {(one.where, one.what): one for one in measure(design(), estimate(design()), run())}
    assert figures["C3", "communicates"].error == pytest.approx(5.0)


def test_nothing_recorded_is_no_error() -> None:
    """A share of nothing is not known."""
    assert all(one.error is None for one in measure(design(), estimate(design()), Observed(())))
