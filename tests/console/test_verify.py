"""`roco replay --verify`: recorded histories run again to the same bytes; else agent, step, field
and both values.
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.msgpack import encode as pack
from msgspec.structs import replace
from typer.testing import CliRunner

from agent_runtime.core.events import Arrived, Effects, Receipt
from agent_runtime.io.steplog import HEAD, Parted, Put, fingerprint, read
from console.__main__ import app
from console.traffic.verify import Kept, first
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative
from operate.file_names import TRAFFIC_FILE
from operate.recording import mcap_file
from operate.recording.records import Spoken

ROOT = Path(__file__).parents[2]
POUR, DEPOT = (ROOT / "tests/histories" / f"verified_{name}" for name in ("pour_seed_7", "depot"))
MEANT = "an agent puts out something else than then; if that is meant: scripts/record-histories"


def told(code: int, wanted: int, out: str, error: str) -> Any:
    """What a verb told, whose exit code must be the wanted one."""
    assert code == wanted, f"{MEANT}\n{out}{error}"
    return json.loads(out) if out else error


@pytest.fixture
def verify(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """Run a history again with the system of a folder; the exit code must be `code`."""

    def again(run: Path, *words: str, folder: Path = ROOT, code: int = 0) -> Any:
        monkeypatch.chdir(folder)
        done = CliRunner().invoke(app, ["replay", str(run), "--verify", *words, "--format", "json"])
        return told(done.exit_code, code, done.stdout, done.stderr)

    return again


# --- recorded histories ---------------------------------------------------------------------------


@pytest.mark.process
@pytest.mark.timeout(180)
def test_the_agents_of_a_pour_put_out_the_same_bytes() -> None:
    """Every step of co, hi, km, pl and ta of a run over Zenoh."""
    command = [sys.executable, "-m", "console", "replay", str(POUR), "--verify"]
    command += ["--seed", "7", "--format", "json"]
    kept = {name: value for name, value in os.environ.items() if not name.startswith("ROCO_")}
    done = subprocess.run(command, cwd=ROOT, env=kept, capture_output=True, text=True, timeout=110)
    found = told(done.returncode, 0, done.stdout, done.stderr)
    assert [one["agent"] for one in found] == ["co", "hi", "km", "pl", "ta"]
    assert all(one["difference"] is None and one["steps"] > 20 for one in found)


@pytest.mark.process
@pytest.mark.timeout(180)
def test_another_system_with_two_deaths_and_a_parameter(verify: Callable[..., Any]) -> None:
    """Two agents were killed and lived again; all that they said is in the recording, to the
    byte.
    """
    found = {one["agent"]: one for one in verify(DEPOT, folder=ROOT / "examples/depot")}
    assert [one["lives"] for one in found.values()] == [1, 2, 1, 2, 1]
    assert [one["difference"] for one in found.values()] == [None] * 5
    assert all(one["heard"] == one["said"] > 0 for one in found.values())


@pytest.mark.process
@pytest.mark.timeout(60)
def test_another_seed_is_another_agent(verify: Callable[..., Any]) -> None:
    """pl keeps its seed in its memory: the field of its journal's record, with both values."""
    (one,) = verify(POUR, "--seed", "8", "--agent", "pl", code=1)
    difference = one["difference"]
    assert (difference["life"], difference["kind"]) == (1, "PeerChanged")
    assert difference["field"].startswith("record.memory.")
    assert (difference["recorded"], difference["now"]) == (7, 8)


def changed(run: Path, agent: str, field: str, value: Any, *, skip: int = 0) -> int:
    """Change a field in the first communicate to reach an agent whose content has it, but for
    `skip` conversations; the number of that step.
    """
    file = run / "steps" / f"{agent}.steps"
    steps, number, talks = list(read(file)), 0, set[str]()
    for place, step in enumerate(steps):
        if step.kind != Arrived.__name__ or number:
            continue
        arrived = msgspec.msgpack.decode(step.input, type=Arrived)
        content = arrived.communicate.content
        told = None if content is msgspec.UNSET else msgspec.msgpack.decode(content)
        if isinstance(told, dict) and field in told:
            talks.add(arrived.communicate.conversation)
            if len(talks) <= skip:
                continue
            told[field] = value
            other = replace(arrived.communicate, content=msgspec.Raw(pack(told)))
            number = step.step
            steps[place] = replace(step, input=pack(replace(arrived, communicate=other)))
    lines = [pack(step) for step in steps]
    file.write_bytes(b"".join(HEAD.pack(len(line)) + line for line in lines))
    return number


@pytest.mark.process
@pytest.mark.timeout(60)
@pytest.mark.parametrize(
    ("agent", "path", "skip", "fields"),
    [
        ("dispatcher", "item", 1, ("sends[0].content.item",)),
        ("mule", "item", 0, ("tells", "record.memory.job.item")),
    ],
    ids=["said", "written"],
)
def test_a_message_that_says_something_else_is_seen(
    tmp_path: Path,
    agent: str,
    path: str,
    skip: int,
    fields: tuple[str, ...],
    verify: Callable[..., Any],
) -> None:
    """Asked for something else, an agent says or writes something else; both are told.

    When the first order comes the robots have perhaps not appeared yet, and what the dispatcher
    says to them waits.
    """
    run = tmp_path / "run"
    shutil.copytree(DEPOT, run)
    number = changed(run, agent, path, "anvil", skip=skip)
    (one,) = verify(run, "--agent", agent, folder=ROOT / "examples/depot", code=1)
    difference = one["difference"]
    assert (difference["life"], difference["step"]) == (1, number)
    assert difference["field"] in fields
    if difference["field"].endswith("item"):
        assert difference["now"] == "anvil"
    assert difference["recorded"] not in (None, difference["now"])


@pytest.mark.process
@pytest.mark.timeout(60)
def test_a_recording_that_says_something_else_is_seen(
    tmp_path: Path, verify: Callable[..., Any]
) -> None:
    """A recording that differs from the agent's own output is noticed: another sender, or a changed
    file.
    """
    run = tmp_path / "run"
    shutil.copytree(DEPOT, run)
    (run / TRAFFIC_FILE).unlink()
    copy, done = mcap_file.Recording(run / TRAFFIC_FILE), ""
    for record in mcap_file.read(DEPOT / TRAFFIC_FILE).records:
        if isinstance(record, Spoken) and record.sender == "ox" and not done:
            wire = encode(replace(record.communicate, sent=1.0))
            record, done = replace(record, wire=wire, size=len(wire)), record.communicate.id
        copy.add(record)
    copy.finish()
    (one,) = verify(run, "--agent", "ox", folder=ROOT / "examples/depot", code=1)
    assert one["heard"] == one["said"] - 1
    assert one["difference"]["field"].startswith(f"recording of the communicate {done} to ")


def test_wrong_use_is_told(tmp_path: Path, verify: Callable[..., Any]) -> None:
    """Exit code 2."""
    has = "has no log of 'ex'; it has co, hi, km, pl, ta"
    assert has in verify(POUR, "--agent", "ex", code=2)
    assert "are two questions" in verify(POUR, "--replace", "pl", code=2)
    assert "has no step logs; give the folder of a run" in verify(tmp_path, code=2)


# --- the field, from what the run has kept --------------------------------------------------------


def word(id: str, content: Any, sent: float = 5.0) -> Communicate:
    """A communicate of the agent."""
    return Communicate(
        performative=Performative.INFORM,
        content=msgspec.Raw(pack(content)),
        receiver="b",
        sender="a",
        id=id,
        sent=sent,
    )


BEFORE, RECORD = pack({"memory": {"n": 1}}), pack({"memory": {"n": 2}})
THEN = Effects(RECORD, (Receipt("b", 4),), (word("7", {"at": 1}),), ("go",))
KEPT = Kept((b"older", BEFORE, RECORD, b"newer"), THEN.sends, (Receipt("c", 1), *THEN.receipts))


def parted(now: Effects, then: Effects = THEN) -> Parted:
    """A step that put out `then`, and puts out `now`."""
    put = Put(now.record, now.receipts, tuple(map(encode, now.sends)), pack(now.tells), None)
    return Parted(1, 9, 5.0, "Arrived", fingerprint(then), None, BEFORE, put)


@pytest.mark.parametrize(
    ("now", "field", "recorded", "is_now"),
    [
        (replace(THEN, record=pack({"memory": {"n": 3}})), "record.memory.n", 2, 3),
        (replace(THEN, record=None), "record", {"memory": {"n": 2}}, None),
        (replace(THEN, sends=(word("7", {"at": 2}),)), "sends[0].content.at", 1, 2),
        (replace(THEN, sends=()), "sends (length)", 1, 0),
        (replace(THEN, sends=(*THEN.sends, word("8", 0))), "sends (length)", 1, 2),
        (replace(THEN, receipts=(Receipt("b", 5),)), "receipts[0].taken", 4, 5),
        (replace(THEN, receipts=()), "receipts (length)", 1, 0),
        (replace(THEN, tells=("stop",)), "tells", f"hash {fingerprint(THEN).hex()}", ["stop"]),
    ],
)
def test_the_part_that_differs_is_named(
    now: Effects, field: str, recorded: Any, is_now: Any
) -> None:
    """With its recorded value, from the journal or the recording, and its value now."""
    found = first(parted(now), KEPT)
    assert (found.step, found.field, found.recorded, found.now) == (9, field, recorded, is_now)


def test_a_part_where_there_was_none() -> None:
    """The journal's next record is a later step's; that a device was told nothing is known."""
    assert first(parted(THEN, replace(THEN, record=None)), KEPT).recorded is None
    found = first(parted(THEN, replace(THEN, tells=())), KEPT)
    assert (found.field, found.recorded, found.now) == ("tells (length)", 0, 1)


def test_without_journal_and_recording_only_the_hash_is_known() -> None:
    """And all that is put out now."""
    found = first(parted(replace(THEN, record=BEFORE)), Kept())
    assert (found.field, found.recorded) == ("output", f"hash {fingerprint(THEN).hex()}")
    assert found.now["record"] == {"memory": {"n": 1}}
