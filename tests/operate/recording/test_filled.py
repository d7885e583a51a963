"""A recording with a hole, filled from the step logs: the same verdicts as without it, and nothing hidden in it."""

import shutil
from collections import Counter
from pathlib import Path

import msgspec
import pytest

from agent_runtime.core.events import Arrived, Garbled
from agent_runtime.io.steplog import NOTHING, Step, StepLog
from fipa_codec.communicate import Communicate
from operate.judging.judged import of_records
from operate.recording import filled, history, mcap_file
from operate.recording.records import Garbage, Record, Resumed, Spoken, Token
from operate.run_folder import Judged
from operate.system import System, here

ROOT = Path(__file__).parents[3]
DEPOT = ROOT / "tests" / "histories" / "verified_depot"
HOLES = ((0.0, 0.3), (0.2, 0.5), (0.4, 0.8), (0.7, 1.0), (0.0, 1.0))
"""Begin and end, as shares of the run."""


@pytest.fixture(scope="module")
def depot() -> System:
    """The system of the recorded run."""
    return here(ROOT / "examples" / "depot")


def recorded() -> tuple[Record, ...]:
    """The run, in which the recorder heard everything."""
    return mcap_file.read(DEPOT / mcap_file.FILE).records


def with_hole(run: Path, begin: float, end: float) -> Resumed:
    """Write the run into a folder as a recorder would that was dead for this share of it."""
    shutil.copytree(DEPOT / filled.STEPS, run / filled.STEPS)
    records = recorded()
    said = [one.received for one in records if isinstance(one, Spoken)]
    first, last = said[0] - 0.1, said[-1] + 0.1
    hole = Resumed(first + begin * (last - first), first + end * (last - first))
    recording = mcap_file.Recording(run / mcap_file.FILE)
    for one in (
        *(r for r in records if r.received < hole.since),
        hole,
        *(r for r in records if r.received > hole.received),
    ):
        recording.add(one)
    recording.finish()
    return hole


def verdicts(lines: tuple[Judged, ...]) -> Counter[tuple[str, ...]]:
    """Verdicts with the communicates they are about; a copy is not among what logs can tell."""
    told = (one for one in lines if one.verdict not in ("copy", "slow"))
    return Counter((one.verdict, one.sender, one.receiver, one.id, one.conversation) for one in told)


@pytest.mark.parametrize(("begin", "end"), HOLES)
def test_a_hole_changes_no_verdict(tmp_path: Path, depot: System, begin: float, end: float) -> None:
    """Each communicate of the hole is there, marked, and judged; without the logs it is not."""
    hole = with_hole(tmp_path, begin, end)
    found = filled.of_run(tmp_path, depot)
    judged = of_records(found.known, depot)
    whole = of_records(recorded(), depot)
    assert verdicts(judged).keys() == {("legal", *key[1:]) for key in verdicts(whole)}
    assert all(bool(one.log) == (one.t < hole.received) for one in judged if one.log)
    unheard = [one for one in recorded() if isinstance(one, Spoken) and hole.since < one.received < hole.received]
    assert {one.identity for one in unheard} <= {one.identity for one in found.records if isinstance(one, Spoken)}
    heard = mcap_file.read(tmp_path / mcap_file.FILE).records
    assert verdicts(of_records(heard, depot)) != verdicts(judged)


def test_a_life_that_began_in_the_hole_is_known(tmp_path: Path, depot: System) -> None:
    """The dispatcher is killed and comes back while nobody records."""
    with_hole(tmp_path, 0.0, 1.0)
    lives = [one for one in filled.of_run(tmp_path, depot).records if isinstance(one, Token) and one.alive]
    assert {(one.agent, one.incarnation) for one in lives} >= {("dispatcher", 1), ("dispatcher", 2), ("ox", 2)}


def note(run: Path, agent: str, *events: Arrived | Garbled, at: float) -> None:
    """Write into an agent's log that this reached it."""
    log = StepLog(run / filled.STEPS / f"{agent}.steps")
    log.write((Step(9, 1, at, type(one).__name__, msgspec.msgpack.encode(one)), NOTHING) for one in events)
    log.close()


def words(at: float, **changed: str) -> Communicate:
    """The first thing that the desk said to the dispatcher, with other fields."""
    said = (one for one in recorded() if isinstance(one, Spoken) and one.performative == "request")
    return msgspec.structs.replace(next(said).communicate, sent=at, **changed)


@pytest.mark.parametrize(
    ("changed", "verdict"),
    [
        ({"conversation": "desk-7-7"}, "out of sequence"),
        ({"sender": "traffic"}, "not entitled"),
        ({"conversation": "desk-7-7", "language": "JOB"}, "wrong language"),
    ],
)
def test_what_was_wrong_in_the_hole_is_found(
    tmp_path: Path, depot: System, changed: dict[str, str], verdict: str
) -> None:
    """Somebody said it while nobody recorded: its receiver took it down."""
    hole = with_hole(tmp_path, 0.2, 0.6)
    at = (hole.since + hole.received) / 2
    note(tmp_path, "dispatcher", Arrived(words(at, **changed)), at=at + 0.001)
    wrong = [one for one in history.load(tmp_path, depot).judged if one.violation]
    assert [(one.verdict, one.log, one.t) for one in wrong] == [(verdict, "dispatcher", at)]


def test_bytes_that_were_no_communicate_are_found_in_the_hole(tmp_path: Path, depot: System) -> None:
    """The log keeps key and reason; outside the hole the recorder has the bytes, and they are not told twice."""
    hole = with_hole(tmp_path, 0.2, 0.6)
    broken = Garbled("roco/depot/C6/mule/traffic/passage/request", "Expected `array`, got `nil`")
    note(tmp_path, "traffic", broken, at=hole.since + 0.1)
    note(tmp_path, "traffic", broken, at=hole.received + 0.1)
    wrong = [one for one in history.load(tmp_path, depot).judged if one.violation]
    assert [(one.verdict, one.log, one.why) for one in wrong] == [("malformed", "traffic", broken.reason)]


@pytest.mark.parametrize(("sender", "told"), [("mule", 1), ("ox", 0)])
def test_of_bytes_in_a_time_of_slowness_those_are_new_that_were_not_heard(
    depot: System, sender: str, told: int
) -> None:
    """Of two on a key the recorder heard one; of another sender it heard all."""
    key = "roco/depot/C6/mule/traffic/passage/request"
    heard, noted = Garbage(key, 1, "", 2.0, b"x"), Garbage(key, 0, "why", 2.1, b"", log="traffic")
    second = msgspec.structs.replace(noted, received=2.2)
    logs: dict[str, tuple[Record, ...]] = {"traffic": (noted, second)}
    found = filled.filled((heard, Resumed(1.0, 3.0, sender)), logs, depot)
    assert sum(isinstance(one, Garbage) and bool(one.log) for one in found.records) == told


def test_without_the_log_of_an_agent_open_conversations_are_not_judged(tmp_path: Path, depot: System) -> None:
    """Words to it in the hole are unknown: the judge begins again behind the hole, and blames nobody."""
    with_hole(tmp_path, 0.2, 0.6)
    (tmp_path / filled.STEPS / "traffic.steps").unlink()
    assert [one for one in filled.of_run(tmp_path, depot).known if isinstance(one, Resumed)]
    judged = history.load(tmp_path, depot).judged
    assert [one for one in judged if one.violation] == []
    assert [one for one in judged if one.verdict == "not judged"]


def test_an_answer_that_the_router_held_up_was_said_in_time(depot: System) -> None:
    """Sent while the router was away, heard seconds after the reply-by of its question: nobody was silent or late."""
    said = [one for one in recorded() if isinstance(one, Spoken)]
    answer = next(one for one in said if one.performative == "propose")
    question = next(one for one in said if one.performative == "cfp" and one.conversation == answer.conversation)
    back = (question.communicate.reply_by or 0.0) + 10.0
    hole, held_up = Resumed(question.sent, back), answer.moved(back + 0.1)
    logs: dict[str, tuple[Record, ...]] = {question.sender: (), question.receiver: ()}
    found = filled.filled((question, hole, held_up), logs, depot)
    assert [one.verdict for one in of_records(found.known, depot)] == ["legal", "legal"]
    assert [one.verdict for one in of_records((question, held_up), depot)] != ["legal", "legal"]


def test_what_a_living_recorder_has_not_written_yet_is_no_hole(tmp_path: Path, depot: System) -> None:
    """Its file is up to a flush behind the logs."""
    shutil.copytree(DEPOT / filled.STEPS, tmp_path / filled.STEPS)
    recording = mcap_file.Recording(tmp_path / mcap_file.FILE)
    for one in recorded()[: len(recorded()) // 2]:
        recording.add(one)
    recording.flush()
    (tmp_path / filled.RECORDER_PID).write_text(str(1))
    assert [one for one in filled.of_run(tmp_path, depot).records if isinstance(one, Spoken) and one.log] == []
    (tmp_path / filled.RECORDER_PID).unlink()
    assert [one for one in filled.of_run(tmp_path, depot).records if isinstance(one, Spoken) and one.log]
    recording.finish()
