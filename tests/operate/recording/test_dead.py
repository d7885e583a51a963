"""Dead letters: each communicate that nobody took is listed once, with the reason; what was taken
never is.
"""

import shutil
from pathlib import Path

import msgspec
import pytest

from agent_runtime.core.state import Outgoing
from agent_runtime.io.journal import MAGIC, frame
from agent_runtime.io.steplog import StepLogs
from agent_runtime.io.tap import Sample
from fipa_codec.communicate import Communicate, encode
from operate.file_names import TRAFFIC_FILE
from operate.recording import dead, mcap_file
from operate.recording.records import Record, Spoken, understood
from operate.recording.run import Run
from operate.system import System, here
from operate.verdict_lines import Dead, DeadLetter

ROOT = Path(__file__).parents[3]
DEPOT = ROOT / "tests" / "histories" / "verified_depot"
LATER_S = 3600.0


@pytest.fixture(scope="module")
def depot() -> System:
    """The system of the recorded run."""
    return here(ROOT / "examples" / "depot")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A copy of the recorded run."""
    return Path(shutil.copytree(DEPOT, tmp_path / "run"))


def said(act: str) -> Communicate:
    """The first communicate of the run with this act."""
    some = (one for one in records() if isinstance(one, Spoken))
    return next(one.communicate for one in some if one.performative == act)


def records() -> tuple[Record, ...]:
    """All that was recorded."""
    return mcap_file.read(DEPOT / TRAFFIC_FILE).records


def add(run: Path, *more: Record) -> None:
    """Record something more at the end of the run."""
    (run / TRAFFIC_FILE).unlink()
    recording = mcap_file.Recording(run / TRAFFIC_FILE)
    for one in (*records(), *more):
        recording.add(one)
    recording.finish()


def told(run: Path, depot: System) -> list[DeadLetter]:
    """The dead letters an hour after the end of the run."""
    return dead.letters(Run(run, depot), records()[-1].received + LATER_S)


def test_a_run_in_which_all_was_taken_has_none(run: Path, depot: System) -> None:
    """Two agents were killed in it; and a sender's journal still keeps what was receipted last."""
    assert told(run, depot) == []


@pytest.mark.parametrize(
    ("changed", "reason", "why"),
    [
        ({"receiver": "forklift"}, Dead.NO_RECEIVER, "forklift"),
        ({"sender": "traffic"}, Dead.NO_RIGHT, "traffic"),
    ],
)
def test_what_the_design_does_not_have(
    run: Path, depot: System, changed: dict[str, str], reason: Dead, why: str
) -> None:
    """An unknown receiver, and a sender that may not say this."""
    one = msgspec.structs.replace(said("request"), **changed)
    key = f"roco/depot/C2/{one.sender}/{one.receiver}/{one.protocol}/{one.performative}"
    add(run, understood(Sample(key, encode(one), records()[-1].received), depot))
    (letter,) = told(run, depot)
    named = letter.sender, letter.receiver, letter.id
    assert (letter.reason, named) == (reason, (one.sender, one.receiver, one.id))
    assert why in letter.why


@pytest.mark.parametrize(
    ("data", "reason"), [(b"\xc1", Dead.NO_COMMUNICATE), (bytes(5_000_000), Dead.TOO_LARGE)]
)
def test_bytes_that_were_no_communicate(
    run: Path, depot: System, data: bytes, reason: Dead
) -> None:
    """By their key; what is longer than an agent takes is told as such."""
    key = "roco/depot/C2/desk/dispatcher/request/request"
    add(run, understood(Sample(key, data, records()[-1].received), depot))
    (letter,) = told(run, depot)
    assert (letter.reason, letter.key, letter.bytes) == (reason, key, len(data))


@pytest.mark.parametrize(
    ("event", "reason"),
    [
        ("not understood", Dead.NOT_UNDERSTOOD),
        ("stray", Dead.OVER),
        ("inbox full", Dead.TURNED_AWAY),
        ("not for us", Dead.TURNED_AWAY),
    ],
)
def test_what_an_agent_turned_away(run: Path, depot: System, event: str, reason: Dead) -> None:
    """By the agent's own log, with what the recording knows of it; other lines are not letters."""
    one = said("cfp")
    line = {"agent": one.receiver, "t": one.sent + 1.0, "level": "warning", "event": event}
    line |= {"why": "it is", "id": one.id, "sender": one.sender, "performative": "cfp"}
    line |= {"conversation": one.conversation}
    other = line | {"event": "peer", "peer": "ox"}
    lines = [msgspec.json.encode(each) + b"\n" for each in (other, line)]
    (run / "logs").mkdir()
    (run / "logs" / "x.jsonl").write_bytes(b"".join(lines) + b"{")
    (letter,) = told(run, depot)
    assert (letter.reason, letter.sender, letter.receiver) == (reason, one.sender, one.receiver)
    assert (letter.protocol, letter.bytes) == ("cfp", len(encode(one)))
    assert "it is" in letter.why


def test_a_question_that_never_reached_its_receiver(run: Path, depot: System) -> None:
    """Its sender's log has it, and no other; a moment after it was said nobody can tell."""
    end = records()[-1].received
    name = "desk-7-7"
    one = msgspec.structs.replace(said("subscribe"), id=name, conversation=name, sent=end)
    StepLogs(run).said(one, end)
    assert [(one.reason, one.id) for one in told(run, depot)] == [(Dead.NOT_HEARD, "desk-7-7")]
    assert dead.letters(Run(run, depot), end + 1.0) == []


@pytest.mark.parametrize(("taken", "letters"), [(6, [7]), (7, [])])
def test_durable_words_that_were_never_taken(
    run: Path, depot: System, taken: int, letters: list[int]
) -> None:
    """The sender's journal keeps them; the receiver's says how far it has taken."""
    one = msgspec.structs.replace(said("request"), id="7")

    def journal(agent: str, **parts: object) -> None:
        file = run / "journal" / f"{agent}.journal"
        file.write_bytes(MAGIC + frame(msgspec.msgpack.encode(parts)))

    journal("desk", outbox={"dispatcher": (Outgoing(7, one),)})
    journal("dispatcher", taken={"desk": taken})
    found = [(each.reason, int(each.id), each.receiver) for each in told(run, depot)]
    assert found == [(Dead.NOT_RECEIPTED, number, "dispatcher") for number in letters]
    assert dead.letters(Run(run, depot), one.sent + 1.0) == []
