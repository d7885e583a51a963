"""Layer 2 of the companion's design: every use holds; the naive variants of `coordinate` fail by a
shortest way.
"""

import pytest

from companion.design import COORDINATE, DESIGN
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import RECEIVE, SEND, Role, Row
from topdown.prove.durable import durable_pair
from topdown.prove.engine import DEADLOCK, UNREACHED, WRONG, explore
from topdown.prove.net import NetModel
from topdown.prove.pairs import changed_channels, explore_use, spoken
from topdown.prove.roles import Players

CO, TA = Role.INITIATOR, Role.PARTICIPANT
PROGRESS, FINAL = Kind.PROGRESS, Kind.FINAL


@pytest.mark.parametrize("faults", [1, pytest.param(2, marks=pytest.mark.long)])
@pytest.mark.parametrize("use", DESIGN.protocols)
def test_every_use_holds(use, faults):
    """No deadlock, no reception without a row, no bound passed, every conversation ends, every
    state reached; with two faults there are some hundred thousand of them.
    """
    result = explore_use(DESIGN, use, faults)
    assert result.holds, f"{result.unreached} {[str(one) for one in result.exploration.findings]}"
    assert result.exploration.states < 400_000


def test_a_step_is_verified_by_what_it_changed():
    """Only the channels that it created, reallocated, split or complemented, each for itself."""
    assert changed_channels(DESIGN, 6) == ("C6",)
    assert set(changed_channels(DESIGN, 4)) == {"C3", "C4"}
    steps = range(1, len(DESIGN.file.step) + 1)
    touched = [channel for step in steps for channel in changed_channels(DESIGN, step)]
    assert set(touched) == set(DESIGN.channels)


# --- coordinate, naively --------------------------------------------------------------------------


def shortest(co=None, ta=None, faults=0):
    """The first finding of `coordinate` with another table, and its steps."""
    protocol = COORDINATE.with_tables(initiator=co, participant=ta)
    net = durable_pair(protocol, Players("co", "ta"), faults=faults)
    finding = explore(NetModel(net), first=False).findings[0]
    return finding, [f"{step.who} {step.what}" for step in finding.trace]


def waiting_ta():
    """ta waits for the confirm of each report before it takes anything else."""
    return COORDINATE.tables[TA].with_rows(
        Row("asked", SEND, P.INFORM, PROGRESS, "unconfirmed"),
        Row("unconfirmed", RECEIVE, P.CONFIRM, PROGRESS, "running"),
    )


def test_ta_must_not_wait_for_a_confirm():
    """The cancel may come first."""
    finding, steps = shortest(ta=waiting_ta())
    assert (finding.kind, finding.text) == (WRONG, "ta in state unconfirmed has no row for cancel")
    assert [step for step in steps if "->" in step][:2] == ["co request -> ta", "co cancel -> ta"]
    assert len(steps) == 5


def test_ta_that_waits_and_co_that_stops_confirming_block_each_other():
    """Even where ta lets the cancel wait: no fault is needed."""
    ta = waiting_ta().with_rows(Row("unconfirmed", RECEIVE, P.CANCEL, Kind.PLAIN, "unconfirmed"))
    co = COORDINATE.tables[CO].with_rows(
        Row("cancelling", RECEIVE, P.INFORM, PROGRESS, "cancelling")
    )
    finding, steps = shortest(co, ta)
    assert finding.kind in (UNREACHED, DEADLOCK)
    assert "co cancel -> ta" in steps
    assert len(steps) <= 5


@pytest.mark.parametrize(
    ("state", "act", "kind", "length"),
    [
        ("refused", P.CANCEL, Kind.PLAIN, 5),
        ("finished", P.CANCEL, Kind.PLAIN, 6),
        ("finished", P.CONFIRM, PROGRESS, 7),
        ("stopping", P.CONFIRM, PROGRESS, 8),
        ("running", P.CONFIRM, PROGRESS, 6),
    ],
)
def test_what_crosses_must_be_taken(state, act, kind, length):
    """Each row that the paper's text leaves out, without any fault."""
    finding, steps = shortest(ta=COORDINATE.tables[TA].without(state, RECEIVE, act, kind))
    word = f"{act}[{kind}]" if kind else act
    assert (finding.kind, finding.text) == (WRONG, f"ta in state {state} has no row for {word}")
    assert len(steps) == length


def test_a_cancel_that_meets_a_forgotten_refuse_must_be_taken():
    """ta remembers nothing of what it refused."""
    finding, _ = shortest(ta=COORDINATE.tables[TA].without("start", RECEIVE, P.CANCEL))
    assert "its conversation forgotten, has no row for cancel" in finding.text


def test_the_final_report_must_be_confirmed():
    """co ends with it and says nothing: a plan that ta has taken on is never done, whatever comes
    then.
    """
    co = COORDINATE.tables[CO].with_rows(
        Row("running", RECEIVE, P.INFORM, FINAL, "done"),
        Row("cancelling", RECEIVE, P.INFORM, FINAL, "done"),
    )
    finding, steps = shortest(co)
    assert finding.kind == UNREACHED
    assert steps == ["co request -> ta", "ta request <- co", "ta inform[progress] -> co"]


def test_the_designs_own_table_is_explored(monkeypatch):
    """A row less in the one object that the file became: the design's verdict is another one."""
    assert DESIGN.tables["coordinate"] is COORDINATE
    ta = COORDINATE.tables[TA].without("finished", RECEIVE, P.CANCEL)
    monkeypatch.setattr(COORDINATE, "tables", {**COORDINATE.tables, TA: ta})
    assert spoken(DESIGN, "execute_plan").tables[TA].find("finished", RECEIVE, P.CANCEL) is None
    (finding, *_) = explore_use(DESIGN, "execute_plan", 0).exploration.findings
    assert finding.text == "ta in state finished has no row for cancel"
