"""A latency is what its sender waited, by its own step log: neither the recorder's delay nor others' clocks matter."""

import re
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent_runtime.core.events import Arrived
from agent_runtime.io import steplog
from operate.recording import filled, history, mcap_file
from operate.recording.hearing import Hearing, Took
from operate.recording.noted import noted
from operate.recording.records import House, Record, Spoken, Token
from operate.reports import counts, page
from operate.reports.counts import Latency, Spans
from operate.system import System, here

ROOT = Path(__file__).parents[3]
DEPOT = ROOT / "tests" / "histories" / "verified_depot"
Logs = dict[str, tuple[Record, ...]]


@pytest.fixture(scope="module")
def depot() -> System:
    """The system of the recorded run."""
    return here(ROOT / "examples" / "depot")


@pytest.fixture(scope="module")
def heard(depot: System) -> tuple[Record, ...]:
    """Everything that the recorder heard."""
    return mcap_file.read(DEPOT / mcap_file.FILE, depot).records


@pytest.fixture(scope="module")
def logs(depot: System) -> Logs:
    """The step log of every agent."""
    return {file.stem: tuple(noted(file, depot)) for file in (DEPOT / filled.STEPS).iterdir()}


def told(heard: tuple[Record, ...], logs: Logs, depot: System) -> dict[tuple[str, str], Spans]:
    """Return (use, "answer" or "receipt") -> its latencies."""
    rows = counts.latencies(history.merged(heard, logs, depot), depot.design)
    return {(row.use, name): one for row in rows for name in ("answer", "receipt") if (one := getattr(row, name))}


def later(record: Record, by: float) -> Record:
    """A record as it would be with another time of its hearing."""
    at = record.received + by
    return record.moved(at) if isinstance(record, Spoken) else msgspec.structs.replace(record, received=at)


def said_later(record: Record, by: dict[str, float]) -> Record:
    """A record with the time of its sending on a clock of its sender that is wrong by so much."""
    if not isinstance(record, Spoken):
        return record
    return msgspec.structs.replace(record, sent=record.sent + by[record.sender]).read_in(None)


def same(one: dict[tuple[str, str], Spans], other: dict[tuple[str, str], Spans]) -> bool:
    """Whether all times are the same, but for the rounding of unix seconds (some 0.2 us, so below 2 us)."""
    ours, theirs = ({key: (spans.p50, spans.max) for key, spans in each.items()} for each in (one, other))
    return ours.keys() == theirs.keys() and all(theirs[key] == pytest.approx(ours[key], abs=2e-3) for key in ours)


def test_an_answer_is_there_when_its_asker_hears_it(heard: tuple[Record, ...], logs: Logs, depot: System) -> None:
    """The orders of the desk, by its own log alone."""
    steps = [one for one in steplog.read(DEPOT / filled.STEPS / "desk.steps") if one.kind == Arrived.__name__]
    came = [(one.at, msgspec.msgpack.decode(one.input, type=Arrived).communicate) for one in steps]
    asked = [one for one in heard if isinstance(one, Spoken) and (one.sender, one.performative) == ("desk", "request")]
    first = {one.conversation: one for one in reversed(asked)}
    waited = [
        next(at for at, answer in came if answer.conversation == name) - one.sent for name, one in sorted(first.items())
    ]
    found = told(heard, logs, depot)["order", "answer"]
    assert (found.count, found.by_sender) == (len(waited), len(waited))
    assert found.max == pytest.approx(1000 * max(waited))
    assert found.max != pytest.approx(told(heard, {}, depot)["order", "answer"].max, rel=0.01)


@settings(max_examples=20, deadline=None)
@given(slower=st.floats(0.0, 5.0), late=st.floats(0.0, 10.0))
def test_a_recorder_that_is_late_changes_no_latency(
    heard: tuple[Record, ...], logs: Logs, depot: System, slower: float, late: float
) -> None:
    """It hears all of it later, and later and later; of a run without logs it has nothing else to tell."""
    begin = heard[0].received
    moved = tuple(later(one, late + slower * (one.received - begin)) for one in heard)
    assert same(told(moved, logs, depot), told(heard, logs, depot))
    alone, before = told(moved, {}, depot), told(heard, {}, depot)
    assert {one.by_sender for one in alone.values()} == {0}
    assert [one.max for one in alone.values()] == pytest.approx(
        [(1 + slower) * one.max for one in before.values()], 1e-3
    )


def test_a_copy_answers_nothing_again(heard: tuple[Record, ...], logs: Logs, depot: System) -> None:
    """What reached an agent once more, ten seconds later, was there before."""
    again = {agent: tuple(later(one, 10.0) for one in log if isinstance(one, Spoken)) for agent, log in logs.items()}
    twice = {agent: (*log, *again[agent]) for agent, log in logs.items()}
    assert told(heard, twice, depot) == told(heard, logs, depot)


@settings(max_examples=20, deadline=None)
@given(st.data())
def test_clocks_that_differ_change_no_latency(
    heard: tuple[Record, ...], logs: Logs, depot: System, data: st.DataObject
) -> None:
    """Each agent is on a host whose clock is wrong by some seconds: both ends of a latency are on one clock."""
    wrong = {agent: data.draw(st.floats(-30.0, 30.0)) for agent in logs}
    there = tuple(said_later(one, wrong) for one in heard)
    theirs = {agent: tuple(later(said_later(one, wrong), wrong[agent]) for one in log) for agent, log in logs.items()}
    assert same(told(there, theirs, depot), told(heard, logs, depot))


@pytest.mark.parametrize("away", ["desk", "dispatcher", "mule", "ox"])
def test_without_a_senders_log_the_recorder_tells_its_latencies(
    heard: tuple[Record, ...], logs: Logs, depot: System, away: str
) -> None:
    """All of them are there, and as many fewer are said to be the sender's own."""
    less = {agent: log for agent, log in logs.items() if agent != away}
    whole, part, alone = (told(heard, some, depot) for some in (logs, less, {}))
    assert {key: one.count for key, one in part.items()} == {key: one.count for key, one in whole.items()}
    assert all(one.by_sender == one.count for one in whole.values())
    assert sum(one.by_sender for one in part.values()) < sum(one.count for one in part.values())
    mine = {key for key, one in part.items() if one.by_sender == 0}
    assert same({key: part[key] for key in mine}, {key: alone[key] for key in mine})


SECONDS = st.integers(0, 1000).map(float)


@given(st.lists(SECONDS, max_size=4), SECONDS, st.none() | SECONDS)
def test_a_time_is_of_one_life(lives: list[float], sent: float, at: float | None) -> None:
    """A clock may be set between two lives; and nothing is heard before it was asked for."""
    spent = Hearing(lives=tuple(lives)).after(sent, at)
    one_life = at is not None and sent <= at and not any(sent < began <= at for began in lives)
    assert spent == (at - sent if one_life and at is not None else None)


def test_an_agent_whose_clock_was_set_while_it_was_down(heard: tuple[Record, ...], logs: Logs, depot: System) -> None:
    """The desk asks, is killed, and hears the answers in a life an hour ahead: then the recorder tells."""
    asked = min(one.sent for one in heard if isinstance(one, Spoken) and one.sender == "desk")
    again = Token("desk", 2, True, asked + 3600.0)
    ahead = tuple(later(one, 3600.0) for one in logs["desk"] if isinstance(one, Spoken | House))
    found = told(heard, logs | {"desk": (*logs["desk"][:1], again, *ahead)}, depot)
    assert found["order", "answer"].by_sender == 0
    assert found["order", "answer"].max == told(heard, {}, depot)["order", "answer"].max


@pytest.mark.parametrize(
    ("count", "told"), [(1, "all"), (19, "all"), (20, "95"), (99, "95"), (100, "99"), (1000, "99")]
)
def test_the_page_names_a_share_only_where_so_few_values_have_one(count: int, told: str) -> None:
    """Of fewer than twenty it says within what all are."""
    spans = counts.spans([Took(float(one)) for one in range(count)])
    text = page.latencies((Latency("C1", "ask", 5.0, spans, None),))
    assert re.findall(r'"theirs">(all|\d+).*?</span>', text) == [told]


@pytest.mark.parametrize(
    ("own", "sentence"),
    [(3, "All 3 times"), (2, "2 of 3 times .* the other 1 are as"), (0, "Times are as the recorder")],
)
def test_the_page_says_whose_times_they_are(own: int, sentence: str) -> None:
    """The sender's, the recorder's, or how many of both."""
    spans = counts.spans([Took(1.0, by_sender=number < own) for number in range(3)])
    assert re.search(sentence, page.latencies((Latency("C1", "ask", 5.0, spans, None),)))
