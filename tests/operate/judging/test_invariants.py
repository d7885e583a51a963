"""Invariants of a run: those recorded hold, and each that is broken on purpose is told."""

import importlib.util
import shutil
import sys
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent_runtime.core.state import Outgoing, Record
from agent_runtime.io.journal import Journal
from companion.languages import rc
from companion.skills.loop_messages import Mode
from companion.tools.report import verdict
from companion.tools.system import SYSTEM
from fipa_codec.communicate import Communicate
from fipa_codec.performatives import Performative
from operate.judging import invariants
from operate.recording.history import Entered, History
from operate.recording.run import Run
from operate.system import Job, System, load

HISTORIES = Path(__file__).parents[2] / "histories"
DEPOT = Path(__file__).parents[3] / "examples" / "depot"
WORD = Communicate(performative=Performative.INFORM, sender="mule", receiver="ox")


@pytest.fixture(scope="module")
def depot() -> System:
    """The depot as the tools see it."""
    if importlib.util.find_spec("depot") is None:
        sys.path.insert(0, str(DEPOT))
    return load("depot.system:SYSTEM")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A recorded run of the depot without its journals, to be broken."""
    copied = shutil.copytree(
        HISTORIES / "verified_depot", tmp_path / "run", ignore=shutil.ignore_patterns("journal")
    )
    return Path(copied)


def journalled(run: Path, one: Record) -> None:
    """Write a record as the last one of its agent."""
    journal = Journal(run / "journal" / f"{one.agent}.journal")
    journal.append(msgspec.msgpack.encode(one))
    journal.close()


def record(agent: str, issued: int, taken: int, outbox: tuple[int, ...], state: str = "") -> Record:
    """Return a journal's record of the streams with one peer."""
    peer = "ox" if agent == "mule" else "mule"
    waiting = {peer: tuple(Outgoing(number, WORD) for number in outbox)}
    streams = {"issued": {peer: issued}, "taken": {peer: taken}, "outbox": waiting}
    return Record(
        agent=agent, incarnation=1, counter=0, state=state, memory=msgspec.Raw(b"\x80"), **streams
    )


@given(st.integers(0, 20), st.integers(0, 20), st.sets(st.integers(1, 20)))
def test_what_was_numbered_is_taken_or_waits(said: int, taken: int, waiting: set[int]) -> None:
    """Missing ones are told as lost; a receiver that took more than was said is told, too."""
    found = list(
        invariants.lost(
            {"mule": record("mule", said, 0, tuple(waiting)), "ox": record("ox", 0, taken, ())}
        )
    )
    gone = {number for number in range(1, said + 1) if number > taken and number not in waiting}
    if taken > said:
        assert found == [f"ox took {taken} durable messages of mule, which said {said}"]
    elif gone:
        assert found == [
            f"{len(gone)} durable messages of mule to ox are lost, the first one has number"
            f" {min(gone)}"
        ]
    else:
        assert found == []


def test_a_recorded_run_holds(run: Path, depot: System) -> None:
    """With its size."""
    checked = invariants.checked(Run(run, depot))
    assert checked.broken == ()
    assert checked.bytes > (run / "traffic.mcap").stat().st_size


def test_a_journal_that_went_back_is_told(run: Path, depot: System) -> None:
    """As after an agent that lost what it had receipted."""
    journalled(run, record("ox", 5, 0, ()))
    journalled(run, record("mule", 0, 5, ()))
    assert invariants.checked(Run(run, depot)).broken == ()
    journalled(run, record("mule", 0, 4, ()))
    told = "1 durable messages of ox to mule are lost, the first one has number 5"
    assert invariants.checked(Run(run, depot)).broken == (told,)


def test_a_run_without_a_recording_is_told_by_its_agents(run: Path, depot: System) -> None:
    """Step logs stand in for it: nothing is broken by that."""
    (run / "traffic.mcap").unlink()
    assert invariants.checked(Run(run, depot)).broken == ()


@pytest.mark.parametrize(("state", "told"), [("flying", True), ("idle", False), ("", False)])
def test_a_state_that_the_design_does_not_have_is_told(
    run: Path, depot: System, monkeypatch: pytest.MonkeyPatch, state: str, told: bool
) -> None:
    """Of agents; what processes tell that are none is theirs."""
    past = History(entered=(Entered(1.0, "mule", state), Entered(1.0, "loop", "whirling")))
    monkeypatch.setattr(Run, "history", past)
    assert [one for one in invariants.checked(Run(run, depot)).broken if "was in state" in one] == (
        ["mule was in state 'flying'"] if told else []
    )


@pytest.mark.parametrize("success", [True, False, None])
@pytest.mark.parametrize("state", ["idle", "driving"])
def test_an_agent_that_is_still_busy_when_the_job_is_done_is_told(
    run: Path, depot: System, state: str, success: bool | None
) -> None:
    """By the state in its journal, whether the job succeeded or failed; of one that never ended it
    is not asked.
    """
    journalled(run, record("mule", 0, 0, (), state))
    if success is not None:
        (run / "report.json").write_bytes(msgspec.json.encode({"success": success}))
    resting = msgspec.structs.replace(depot, job=Job(rests={"mule": "idle"}))
    told = state != "idle" and success is not None
    assert invariants.checked(Run(run, resting)).broken == (
        ("mule was still driving at the end, and not idle",) if told else ()
    )


def test_the_robot_s_promises_hold_of_the_recorded_pour() -> None:
    """No act twice, no unknown mode, nothing has fallen."""
    assert invariants.checked(Run(HISTORIES / "pour_seed_7", SYSTEM)).broken == ()


def test_an_act_that_was_begun_twice_is_told() -> None:
    """By its key; a communicate sent again counts once."""
    past = Run(HISTORIES / "pour_seed_7", SYSTEM).history
    begun = next(one for one in past.said if isinstance(one.content, rc.Accepted))
    twice = msgspec.structs.replace(past, said=(*past.said, begun))
    assert isinstance(begun.content, rc.Accepted)
    assert verdict.begun_twice(past) == {}
    assert list(verdict.broken(twice)) == [f"the act {begun.content.key} was begun 2 times"]


def test_the_modes_are_those_of_the_loop() -> None:
    """And "" before it has told one."""
    assert set(verdict.MODES) == {"", *Mode}
