"""Output of `roco traffic echo|hz|bw|size|stats` for a recorded run, for people and for
programs.
"""

from itertools import pairwise, product
from pathlib import Path
from typing import Any

import calling
import msgspec
import pytest
from calling import POUR
from rich.cells import cell_len

from companion.design import DESIGN
from console.traffic import echo, listen
from console.traffic.listen import HeardMessage, heard_message, recorded
from console.traffic.play import moved
from console.traffic.rates import Tally
from console.traffic.replay import factor, narrowed
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative
from operate.filters import Filter, UnknownNameError, checked
from operate.quantiles import quantile, tail
from operate.verdict_lines import Judged
from topdown.judge.verdicts import Verdict

SAMPLES = list(recorded(POUR))
SAID = [
    one for sample in SAMPLES if sample is not None and (one := heard_message(sample)) is not None
]
KINDS = ["hz", "bw", "size", "all"]


@pytest.fixture(autouse=True)
def read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The recording is read by one process for all tests."""
    monkeypatch.setattr(listen, "recorded", lambda file: iter(SAMPLES))


def roco(*words: str, code: int = 0, columns: int = 80) -> str:
    """`roco traffic` of the recorded run."""
    done = calling.roco("traffic", *words, "--run", POUR, columns=columns, code=code)
    return done.stdout + done.stderr


def told(kind: str, *words: str) -> dict[str, Any]:
    """A table for programs."""
    return msgspec.json.decode(roco("stats", kind, *words, "--format", "json"))


@pytest.mark.parametrize("kind", KINDS)
def test_every_communicate_is_counted_in_its_row(kind: str) -> None:
    """In all tables alike."""
    rows = told(kind)["rows"]
    assert sum(row["count"] for row in rows) == len(SAID) == 424
    assert {(row["channel"], row["performative"]) for row in rows} == {
        (one.channel, one.performative) for one in SAID
    }


def test_tables_fit_the_terminal() -> None:
    """With nothing cut off."""
    for kind, columns in product(KINDS, (80, 100)):
        lines = roco("stats", kind, columns=columns).splitlines()
        assert max(map(cell_len, lines)) <= columns, (kind, columns)
        assert not any("…" in line for line in lines), (kind, columns)


def test_rates_are_those_of_the_row() -> None:
    """hz: from its first to its last; bw: bytes over the time of all that is meant."""
    mine = [one for one in SAID if (one.channel, one.performative) == ("C5", "request")]
    (row,) = told("hz", "--channel", "C5", "--performative", "request")["rows"]
    assert row["rate_hz"] == pytest.approx((len(mine) - 1) / (mine[-1].at - mine[0].at))
    assert row["max_gap_s"] == pytest.approx(max(b.at - a.at for a, b in pairwise(mine)))
    whole = told("bw", "--channel", "C5")
    speed = sum(row["bytes_per_s"] for row in whole["rows"])
    assert speed * whole["seconds"] == pytest.approx(
        sum(one.size for one in SAID if one.channel == "C5"), rel=1e-3
    )


def test_answers_are_timed_from_what_they_answer() -> None:
    """Though the question is filtered away; a copy of the question does not restart it."""
    (row,) = told("all", "--performative", "inform-ref", "--channel", "C4")["rows"]
    asked: dict[str, float] = {}
    spans = []
    for one in SAID:
        communicate = one.communicate()
        assert communicate is not None
        if one.channel == "C4" and one.performative == "query-ref":
            asked.setdefault(communicate.conversation, one.at)
        elif one.channel == "C4":
            spans.append(one.at - asked[communicate.conversation])
    assert row["answer_p50_s"] == pytest.approx(quantile(spans, 0.5), abs=1e-6)
    assert row["answer_p95_s"] == pytest.approx(tail(spans, 0.95), abs=1e-6)


def test_a_copy_of_an_answer_answers_nothing_again() -> None:
    """One latency."""
    tally = Tally(Filter())
    talk = Communicate(
        performative=Performative.QUERY_REF, conversation="c", sender="pl", receiver="km", id="1"
    )
    ask = msgspec.structs.replace(talk, reply_with="q")
    answer = msgspec.structs.replace(
        talk, performative=Performative.INFORM_REF, in_reply_to="q", sender="km", receiver="pl"
    )
    for at, one in ((1.0, ask), (1.5, answer), (9.0, answer)):
        data, ends = encode(one), (one.sender, one.receiver)
        act = str(one.performative)
        tally.take(HeardMessage(at, "", data, len(data), "C4", *ends, "query", act))
    (row,) = [row for row in tally.rows if row.performative == "inform-ref"]
    assert (row.count, list(row.answers)) == (2, [0.5])


def test_filters_of_one_kind_add_up_and_of_several_narrow() -> None:
    """Repeated options are or, different ones and."""
    count = told("all", "--agent", "hi", "--agent", "ex", "--performative", "request")["count"]
    assert count == sum(
        one.performative == "request" and bool({"hi", "ex"} & {one.sender, one.receiver})
        for one in SAID
    )


@pytest.mark.parametrize("option", ["--channel", "--agent", "--protocol", "--performative"])
def test_a_name_the_design_has_not_is_named(option: str) -> None:
    """Exit code 2, with those there are."""
    assert "it has" in roco("stats", option, "nonsense", code=2)
    with pytest.raises(UnknownNameError, match="C1, C2"):
        checked(Filter(channels=("C9",)), DESIGN)


def test_nothing_recorded_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exit code 2, and what would be right."""
    monkeypatch.setattr(listen, "recorded", recorded)
    done = calling.roco("traffic", "stats", "--run", tmp_path, code=2)
    assert "give a run folder" in done.stderr


def test_echo_has_every_communicate_with_its_verdict() -> None:
    """As `roco traffic judge` says; JSON has the content whole."""
    lines = [msgspec.json.decode(line) for line in roco("echo", "--format", "json").splitlines()]
    assert len(lines) == 424
    assert [line["t"] for line in lines if line["channel"] == "C1"] == [
        one.at for one in SAID if one.channel == "C1"
    ]
    assert {line["verdict"] for line in lines} == {"legal", "copy", "slow"}
    asked = (one for one in lines if one["performative"] == "request")
    plan = next(one for one in asked if one["channel"] == "C1")
    assert plan["content"]["type"] == "HierarchicalPlan"
    assert len(roco("echo", "--count", "7").splitlines()) == 7
    assert roco("echo", "--wrong") == ""


@pytest.mark.parametrize("width", [80, 100])
def test_a_line_of_echo_is_as_wide_as_the_terminal(width: int) -> None:
    """No line is wider than the terminal; the reason of a violation stands below."""
    fine = Judged(
        t=1.0, verdict=Verdict.LEGAL, bytes=852_000, channel="C4", sender="km", receiver="pl",
        protocol="query",
        performative="inform-ref", text="x" * 80,
    )  # fmt: skip
    assert cell_len(echo.drawn(fine, width, 5).plain) == width
    wrong = msgspec.structs.replace(
        fine, verdict=Verdict.OUT_OF_SEQUENCE, violation=True, why="allowed: nothing"
    )
    first, second = echo.drawn(wrong, width, 5).plain.splitlines()
    assert (cell_len(first), second.strip()) == (width, "allowed: nothing")


@pytest.mark.parametrize(("fast", "left"), [(1.0, 10.0), (4.0, 10.0), (0.5, 20.0), (None, 10.0)])
def test_what_is_replayed_is_as_old_as_it_was(fast: float | None, left: float) -> None:
    """And has as much time for an answer; slower than recorded so much more."""
    one = Communicate(performative=Performative.REQUEST, sent=99.5, reply_by=110.0)
    now = moved(one, 100.0, 5000.0, fast)
    assert (now.sent, now.reply_by) == (4999.5, 5000.0 + left)


def test_options_of_replay() -> None:
    """--only is another way to write the filters; a speed is a positive number, or max."""
    found = narrowed(["channel=C1,C4", "agent=pl"], ["C2"], None, None, None)
    assert found == [["C2", "C1", "C4"], ["pl"], [], []]
    assert (factor("max"), factor("0.5")) == (None, 0.5)
    wrong = {"--speed": ("0", "nan"), "--only": ("colour=red",), "--replace": ("ex", "x")}
    for option, values in wrong.items():
        for value in values:
            calling.roco("replay", POUR, option, value, code=2)
