"""A latency is what its sender waited, by its own step log: others' clocks do not matter."""

import re
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent_runtime.core.events import Arrived
from agent_runtime.io import steplog
from operate.file_names import STEPS
from operate.quantiles import enough, quantile, tail
from operate.recording import history
from operate.recording.ends import Hearing
from operate.recording.records import House, Record, Spoken, Token
from operate.recording.run import Run
from operate.reports import counts, page
from operate.reports.counts import Latency, Spans
from operate.system import System, here

ROOT = Path(__file__).parents[3]
DEPOT = ROOT / "tests" / "histories" / "verified_depot"


@pytest.fixture(scope="module")
def depot() -> System:
    """The system of the recorded run."""
    return here(ROOT / "examples" / "depot")


@pytest.fixture(scope="module")
def heard(depot: System) -> tuple[Record, ...]:
    """The record of a run."""
    return Run(DEPOT, depot).records


def told(heard: tuple[Record, ...], depot: System) -> dict[tuple[str, str], Spans]:
    """Return (use, "answer" or "receipt") -> its latencies."""
    rows = counts.latencies(history.of_records(heard, depot), depot.design)
    found = {(row.use, name): getattr(row, name) for row in rows for name in ("answer", "receipt")}
    return {key: spans for key, spans in found.items() if spans}


def later(record: Record, by: float) -> Record:
    """A record as it would be with another time of its hearing."""
    at = record.received + by
    moved = msgspec.structs.replace(record, received=at)
    return moved.read_in(None) if isinstance(moved, Spoken) else moved


def by_wrong_clocks(record: Record, wrong: dict[str, float]) -> Record:
    """A record where the clock of each agent is wrong by so much."""
    match record:
        case Spoken(sender=sender, receiver=receiver):
            moved = later(record, wrong[receiver])
            return msgspec.structs.replace(moved, sent=record.sent + wrong[sender]).read_in(None)
        case House(kind="receipt", peer=peer):
            return later(record, wrong[peer])
        case Token(agent=agent, noted=True):
            return later(record, wrong[agent])
    return record


def same(one: dict[tuple[str, str], Spans], other: dict[tuple[str, str], Spans]) -> bool:
    """Whether all times are the same, but for the rounding of unix seconds (some 0.2 us, so below 2
    us).
    """
    if one.keys() != other.keys():
        return False
    both = [(spans, other[key]) for key, spans in one.items()]
    times = [((a.p50, a.max), (b.p50, b.max)) for a, b in both]
    return all(b == pytest.approx(a, abs=2e-3) for a, b in times)


def test_an_answer_is_there_when_its_asker_hears_it(
    heard: tuple[Record, ...], depot: System
) -> None:
    """The orders of the desk, by its own log alone."""
    every = steplog.read(DEPOT / STEPS / "desk.steps")
    steps = [one for one in every if one.kind == Arrived.__name__]
    came = [(one.at, msgspec.msgpack.decode(one.input, type=Arrived).communicate) for one in steps]
    said = [one for one in heard if isinstance(one, Spoken) and one.sender == "desk"]
    asked = [one for one in said if one.performative == "request"]
    first = {one.conversation: one for one in reversed(asked)}
    waited = [
        next(at for at, answer in came if answer.conversation == name) - one.sent
        for name, one in sorted(first.items())
    ]
    found = told(heard, depot)["order", "answer"]
    assert found.count == len(waited)
    assert found.max == pytest.approx(1000 * max(waited))


def test_a_copy_answers_nothing_again(heard: tuple[Record, ...], depot: System) -> None:
    """What reached an agent once more, ten seconds later, was there before."""
    again = tuple(later(one, 10.0) for one in heard if isinstance(one, Spoken))
    assert told((*heard, *again), depot) == told(heard, depot)


@settings(max_examples=20, deadline=None)
@given(st.data())
def test_clocks_that_differ_change_no_latency(
    heard: tuple[Record, ...], depot: System, data: st.DataObject
) -> None:
    """Each agent is on a host whose clock is wrong by some seconds: both ends of a latency are on
    one clock.
    """
    wrong = {agent: data.draw(st.floats(-30.0, 30.0)) for agent in depot.design.agents}
    moved = tuple(by_wrong_clocks(one, wrong) for one in heard)
    assert same(told(moved, depot), told(heard, depot))


SECONDS = st.integers(0, 1000).map(float)


@given(st.lists(SECONDS, max_size=4), SECONDS, st.none() | SECONDS)
def test_a_time_is_of_one_life(lives: list[float], sent: float, at: float | None) -> None:
    """A clock may be set between two lives; and nothing is heard before it was asked for."""
    spent = Hearing({}, lives=tuple(lives)).after(sent, at)
    one_life = at is not None and sent <= at and not any(sent < began <= at for began in lives)
    assert spent == (at - sent if one_life and at is not None else None)


def test_an_agent_whose_clock_was_set_while_it_was_down(
    heard: tuple[Record, ...], depot: System
) -> None:
    """The desk asks, is killed, and hears the answers in a life an hour ahead: how long they took
    nobody knows.
    """
    asked = min(one.sent for one in heard if isinstance(one, Spoken) and one.sender == "desk")
    others = [one for one in heard if not (isinstance(one, Token) and one.agent == "desk")]
    to_desk = lambda one: "desk" in (getattr(one, "receiver", ""), getattr(one, "peer", ""))  # noqa: E731
    ahead = [later(one, 3600.0) if to_desk(one) else one for one in others]
    found = told((*ahead, Token("desk", 2, True, asked + 3600.0, noted=True)), depot)
    assert ("order", "answer") not in found
    assert ("order", "answer") in told(heard, depot)


def test_the_page_names_a_share_only_where_so_few_values_have_one() -> None:
    """Of fewer than twenty it says within what all are."""
    shares = {1: "all", 19: "all", 20: "95", 99: "95", 100: "99", 1000: "99"}
    for count, told in shares.items():
        spans = counts.spans([float(one) for one in range(count)])
        text = page.latencies((Latency("C1", "ask", 5.0, spans, None),))
        assert re.findall(r'"theirs">(all|\d+).*?</span>', text) == [told], count


# --- Quantiles are values that were measured ------------------------------------------------------


VALUES = st.lists(st.floats(0.0, 1e6), min_size=1, max_size=300)
SHARES = st.sampled_from((0.5, 0.95, 0.99))


@pytest.mark.parametrize(
    ("values", "share", "wanted"), [([], 0.5, None), ([3], 0.95, 3), ([4, 1, 3, 2], 0.5, 2)]
)
def test_the_nearest_rank(values: list[float], share: float, wanted: float | None) -> None:
    """The smallest value that half of them do not exceed."""
    assert quantile(values, share) == wanted


@given(VALUES, SHARES)
def test_a_quantile_is_the_smallest_value_that_a_share_does_not_exceed(
    values: list[float], share: float
) -> None:
    """Of the values themselves: nothing is put between two of them."""
    told = quantile(values, share)
    assert told in values
    assert told is not None
    assert sum(one <= told for one in values) >= share * len(values)
    assert sum(one < told for one in values) < share * len(values)


@given(VALUES, st.sampled_from(((0.95, 20), (0.99, 100))))
def test_a_tail_needs_values_beyond_it(values: list[float], rule: tuple[float, int]) -> None:
    """With fewer than twenty, or a hundred, it would be just the largest."""
    share, least = rule
    assert (tail(values, share) is None) == (len(values) < least)
    assert (quantile(range(len(values)), share) == len(values) - 1) == (len(values) < least)


@pytest.mark.parametrize(("share", "least"), [(0.95, 20), (0.99, 100)])
def test_the_first_number_that_is_enough(share: float, least: int) -> None:
    """Sharp: one fewer is not."""
    assert (enough(least - 1, share), enough(least, share)) == (False, True)
