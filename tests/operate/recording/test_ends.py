"""The record of a run in its agents' logs: each communicate is told once, whoever reads from
wherever, and what two logs do not agree on is named.
"""

import shutil
import tempfile
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent_runtime.io.steplog import MUCH_BYTES, StepLogs
from fipa_codec.communicate import Communicate
from operate.file_names import STEPS, TRAFFIC_FILE
from operate.judging.judged import of_records
from operate.recording import ends, mcap_file
from operate.recording.ends import LOST_S, RECEIPT, SURE_S, Ends
from operate.recording.recorder import Recorder
from operate.recording.records import Garbage, House, Origin, Record, Spoken, Token, Unpaired
from operate.recording.run import Run
from operate.system import here

ROOT = Path(__file__).parents[3]
DEPOT = ROOT / "tests" / "histories" / "verified_depot"
SYSTEM = here(ROOT / "examples" / "depot")
LOGS = {path.stem: path.read_bytes() for path in (DEPOT / STEPS).iterdir()}
WHOLE = tuple(Ends(DEPOT, SYSTEM).rest())
NOW = WHOLE[-1].received + 60.0


def name(one: Record) -> tuple[object, ...]:
    """What tells a record from others, of whatever reader."""
    match one:
        case Spoken():
            return (*one.identity, one.received, one.origin)
        case Token():
            return one.agent, one.incarnation, one.received
        case House():
            return one.kind, one.owner, one.peer, one.received, one.data
        case Garbage():
            return one.key, one.received
        case Unpaired():
            return one.sender, one.receiver, one.id, one.altered


def names(some: Iterable[Record]) -> Counter[tuple[object, ...]]:
    """How often there is each."""
    return Counter(map(name, some))


def test_the_logs_have_what_the_recorder_recorded() -> None:
    """Communicates, copies, lives and receipts, though two agents were killed; in the order of
    time, as designed.
    """
    recorded = mcap_file.read(DEPOT / TRAFFIC_FILE, SYSTEM).records
    said = [one for one in recorded if isinstance(one, Spoken)]
    assert len(said) > 50
    assert names(one for one in WHOLE if isinstance(one, Spoken)) == names(said)
    houses = [one for one in recorded if isinstance(one, House)]
    receipts = names(one for one in houses if one.kind == RECEIPT)
    assert names(one for one in WHOLE if isinstance(one, House)) == receipts
    lives = {(one.agent, one.incarnation) for one in WHOLE if isinstance(one, Token)}
    assert lives >= {("dispatcher", 1), ("dispatcher", 2), ("ox", 1), ("ox", 2)}
    assert [one.received for one in WHOLE] == sorted(one.received for one in WHOLE)
    assert not any(one.violation for one in of_records(WHOLE, SYSTEM))
    assert not any(isinstance(one, Unpaired) for one in WHOLE)


@settings(max_examples=30, deadline=None)
@given(
    st.lists(
        st.dictionaries(st.sampled_from(sorted(LOGS)), st.floats(0.0, 1.0), min_size=1), max_size=6
    ),
    st.data(),
)
def test_however_it_is_read_each_is_told_once(
    grown: list[dict[str, float]], data: st.DataObject
) -> None:
    """The logs grow at will, and now and then another reader goes on from the cursor of the
    last.
    """
    with tempfile.TemporaryDirectory() as folder:
        run, told = Path(folder), list[Record]()
        (run / STEPS).mkdir()
        reader = Ends(run, SYSTEM)
        for shares in (*grown, dict.fromkeys(LOGS, 1.0)):
            for agent, share in shares.items():
                path = run / STEPS / f"{agent}.{STEPS}"
                there = path.stat().st_size if path.exists() else 0
                path.write_bytes(LOGS[agent][: max(there, round(share * len(LOGS[agent])))])
            told += reader.new(NOW)
            if data.draw(st.booleans()):
                reader, before = Ends(run, SYSTEM), reader.cursor
                assert names(reader.before(before, lambda: None)) <= names(told)
        told += reader.rest()
        assert names(one for one in told if not _only_said(one)) == names(WHOLE)


def _only_said(one: Record) -> bool:
    """Whether it is told from its sender's log alone: its receiver's was not read as far."""
    return isinstance(one, Unpaired) or (isinstance(one, Spoken) and one.origin is Origin.SENDER)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(0.0, 1.0), max_size=4))
def test_a_recorder_that_was_killed_misses_nothing_and_repeats_nothing(shares: list[float]) -> None:
    """It is killed anywhere behind a flush, with more in its file, again and again."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "0"
        (run / STEPS).mkdir(parents=True)
        for number, share in enumerate(sorted(shares)):
            grow(run, share)
            recorder = Recorder(run, SYSTEM)
            recorder.follow()
            recorder.flush()
            left = shutil.copytree(run, Path(folder) / str(number + 1))
            recorder.finish()
            run = left
            with (run / TRAFFIC_FILE).open("ab") as file:
                file.write(b"\x05 what a kill cut off")
        grow(run, 1.0)
        Recorder(run, SYSTEM).finish()
        found = mcap_file.read(run / TRAFFIC_FILE, SYSTEM)
        assert found.whole
        assert names(one for one in found.records if not _only_said(one)) == names(WHOLE)
        assert not [one for one in of_records(Run(run, SYSTEM).records, SYSTEM) if one.violation]


def grow(run: Path, share: float) -> None:
    """Every log has so much of what it will have."""
    for agent, log in LOGS.items():
        (run / STEPS / f"{agent}.{STEPS}").write_bytes(log[: round(share * len(log))])


def test_a_large_content_is_stored_once(tmp_path: Path) -> None:
    """In the log of its receiver; who reads the run folder has it, and the recording tells its
    size.
    """
    large = msgspec.Raw(msgspec.msgpack.encode(["x" * MUCH_BYTES]))
    one = msgspec.structs.replace(first("request"), content=large)
    StepLogs(tmp_path).passed(one, one.sent)
    Recorder(tmp_path, SYSTEM).finish()
    (alone,) = spoken(mcap_file.read(tmp_path / TRAFFIC_FILE).records)
    (whole,) = spoken(Run(tmp_path, SYSTEM).records)
    assert (alone.lost, alone.size, whole.lost) == (True, whole.size, False)
    assert whole.communicate == one
    assert (tmp_path / TRAFFIC_FILE).stat().st_size < MUCH_BYTES


# --- two logs that do not agree -------------------------------------------------------------------


def first(act: str) -> Communicate:
    """The first communicate of the run with this act."""
    return next(one.communicate for one in spoken(WHOLE) if one.performative == act)


def spoken(some: Iterable[Record]) -> list[Spoken]:
    """The communicates among records."""
    return [one for one in some if isinstance(one, Spoken)]


def unpaired(some: Iterable[Record]) -> list[Unpaired]:
    """Those on which two logs do not agree."""
    return [one for one in some if isinstance(one, Unpaired)]


def verdicts(some: Iterable[Record]) -> list[str]:
    """What the judge says about records."""
    return [one.verdict for one in of_records(some, SYSTEM)]


def renumbered(one: Communicate, id: str, at: float) -> Communicate:
    """The same under another number, said then."""
    return msgspec.structs.replace(one, id=id, sent=at)


def told(run: Path, *heartbeats: tuple[str, float]) -> list[Record]:
    """What a reader tells who heard these agents live."""
    reader = Ends(run, SYSTEM)
    found = list(reader.new(NOW))
    for agent, at in heartbeats:
        reader.lived(agent, at)
    return [*found, *reader.new(NOW)]


@pytest.mark.parametrize("by", ["a step", "a heartbeat"])
def test_what_its_sender_did_not_say_is_named(tmp_path: Path, by: str) -> None:
    """As soon as the sender is known to have lived on; it may have been killed before it wrote."""
    one, logs = first("request"), StepLogs(tmp_path)
    logs.said(msgspec.structs.replace(one, id="100"), one.sent - 10.0)
    logs.took(one, one.sent)
    assert unpaired(told(tmp_path)) == []
    after = one.sent + 2 * SURE_S
    if by == "a step":
        logs.said(msgspec.structs.replace(one, id="101"), after)
    found = told(tmp_path, *([(one.sender, after)] if by == "a heartbeat" else []))
    (wrong,) = unpaired(found)
    assert (wrong.sender, wrong.receiver, wrong.id) == (one.sender, one.receiver, one.id)
    assert not wrong.altered
    (line,) = (each for each in of_records(found, SYSTEM) if each.verdict == "not said")
    assert line.violation
    assert one.sender in line.why


def test_a_copy_of_what_was_said_is_a_copy_whoever_makes_it(tmp_path: Path) -> None:
    """Somebody with the sender's key says the same words again: the judge calls it a copy."""
    one, logs = first("request"), StepLogs(tmp_path)
    logs.passed(one, one.sent + 0.001)
    logs.took(one, one.sent + 0.5)
    logs.said(msgspec.structs.replace(one, id="101"), one.sent + 4 * SURE_S)
    found = told(tmp_path)
    assert unpaired(found) == []
    assert "copy" in verdicts(found)


def test_who_died_after_it_spoke_is_not_blamed(tmp_path: Path) -> None:
    """The lines of its last milliseconds are lost, and it lives again."""
    one, logs = first("request"), StepLogs(tmp_path)
    logs.said(msgspec.structs.replace(one, id="100"), one.sent - 10.0)
    logs.took(one, one.sent)
    logs.boots(one.sender, 2, one.sent + 0.5)
    logs.said(msgspec.structs.replace(one, id="101"), one.sent + 2 * SURE_S)
    assert unpaired(told(tmp_path)) == []


@pytest.mark.parametrize(
    "changed", [{"conversation": "desk-9-9"}, {"content": msgspec.Raw(b"\x90")}]
)
def test_what_is_not_what_was_said_is_named(tmp_path: Path, changed: dict[str, object]) -> None:
    """Another field, or other content."""
    one, logs = first("request"), StepLogs(tmp_path)
    logs.said(one, one.sent)
    logs.took(msgspec.structs.replace(one, **changed), one.sent + 0.001)
    found = told(tmp_path)
    (wrong,) = unpaired(found)
    assert wrong.altered
    assert verdicts(found).count("altered") == 1


@pytest.mark.parametrize("taken", [(0, 1, 2), (0, 2), (2,), (0,)])
def test_an_observation_that_was_said_again_meanwhile_is_what_was_said(
    tmp_path: Path, taken: tuple[int, ...]
) -> None:
    """Its receiver was held up: it takes the copies later, whichever came through."""
    one, logs = first("request"), StepLogs(tmp_path)
    copies = [msgspec.structs.replace(one, sent=one.sent + number) for number in range(3)]
    for copy in copies:
        logs.said(copy, copy.sent)
    for number in taken:
        logs.took(copies[number], one.sent + 5.0 + number)
    assert unpaired(told(tmp_path)) == []
    logs.said(msgspec.structs.replace(one, id="102"), one.sent + 9.0)
    logs.took(msgspec.structs.replace(one, id="102", conversation="desk-9-9"), one.sent + 9.5)
    assert [each.altered for each in unpaired(told(tmp_path))] == [True]


def test_what_nobody_took_is_told_from_its_senders_log(tmp_path: Path) -> None:
    """A volatile one after a while; a durable one, which is said again, when nobody reads any
    more.
    """
    asked, ordered, logs = first("subscribe"), first("request"), StepLogs(tmp_path)
    logs.said(asked, asked.sent)
    logs.said(ordered, ordered.sent)
    soon = spoken(Ends(tmp_path, SYSTEM).new(asked.sent + LOST_S / 2))
    late = spoken(Ends(tmp_path, SYSTEM).new(NOW))
    rest = spoken(Ends(tmp_path, SYSTEM).rest())
    assert soon == []
    assert [one.identity for one in late] == [(asked.sender, asked.receiver, asked.id)]
    assert {one.performative for one in rest} == {"subscribe", "request"}
    assert all(one.origin is Origin.SENDER and one.lost for one in rest)
    judged = of_records(rest, SYSTEM)
    assert {one.verdict for one in judged} == {"legal", "not taken"}
    assert not any(one.violation for one in judged)


def test_what_is_taken_late_is_what_was_said(tmp_path: Path) -> None:
    """A frozen agent takes it after it was told as lost: no other words, and nobody is to blame."""
    one, logs = first("subscribe"), StepLogs(tmp_path)
    logs.said(one, one.sent)
    reader = Ends(tmp_path, SYSTEM)
    lost = list(reader.new(one.sent + 2 * LOST_S))
    logs.took(one, one.sent + 3 * LOST_S)
    found = [*lost, *reader.rest()]
    assert verdicts(found) == ["legal", "not taken", "copy"]


@pytest.mark.parametrize("ahead", ["sender", "receiver"])
def test_clocks_that_differ_blame_nobody(tmp_path: Path, ahead: str) -> None:
    """What the host whose clock is ten seconds ahead has written is there, though it is told
    later.
    """
    one, logs, now = first("subscribe"), StepLogs(tmp_path), first("subscribe").sent
    before = renumbered(one, "before", now - 30.0)
    logs.passed(before, now - 30.0)
    logs.said(one, now + 10.0 * (ahead == "sender"))
    logs.took(one, now + 10.0 * (ahead == "receiver"))
    reader = Ends(tmp_path, SYSTEM)
    found = list(reader.new(now + 0.5))
    for later in range(1, 20):
        reader.lived(one.sender, now + later)
        found += reader.new(now + later + 0.5)
    assert unpaired(found) == []
    assert [each.id for each in spoken(found)] == ["before", one.id]
    assert {each.origin for each in spoken(found)} == {Origin.RECEIVER}


def test_who_is_of_another_design_keeps_no_log(tmp_path: Path) -> None:
    """The sender's log has the whole, and it is told at once."""
    logs = StepLogs(tmp_path)
    one = msgspec.structs.replace(first("request"), receiver="stranger")
    logs.said(one, one.sent)
    # the design has not its rule
    assert [*spoken(told(tmp_path)), *unpaired(told(tmp_path))] == []


def test_time_stands_still_before_what_may_still_be_taken(tmp_path: Path) -> None:
    """A frozen agent has an answer in front of it: nobody can say yet that it was not answered."""
    one, logs = first("request"), StepLogs(tmp_path)
    logs.said(one, one.sent)
    reader = Ends(tmp_path, SYSTEM)
    assert list(reader.new(one.sent + 30.0)) == []
    assert reader.until == one.sent
    logs.took(one, one.sent + 30.5)
    list(reader.new(one.sent + 40.0))
    assert reader.until == pytest.approx(one.sent + 40.0 - ends.SETTLED_S)
