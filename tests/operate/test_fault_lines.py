"""faults.jsonl: read in whatever pieces it is written, each fault as its last line has it."""

import shutil
import tempfile
from pathlib import Path

import msgspec
from hypothesis import given
from hypothesis import strategies as st
from planting import POUR

from companion.tools.system import SYSTEM
from operate.fault_lines import Fault, FaultFile, done, encoded, latest, read
from operate.file_names import FAULTS_FILE
from operate.recording.run import Run

times = st.floats(1.0, 2e9)
faults = st.builds(
    Fault,
    id=st.sampled_from("abcd"),
    kind=st.sampled_from(["kill", "hang"]),
    target=st.text(max_size=5),
    t=times,
    began=st.just(0.0) | times,
    ended=st.none() | times,
    at=st.text(max_size=5),
)


@given(st.lists(faults, max_size=8), st.binary(max_size=10).filter(lambda data: b"\n" not in data))
def test_whole_lines_are_read_and_a_torn_one_is_not(some: list[Fault], torn: bytes) -> None:
    """This holds for any bytes that a kill left behind the last whole line."""
    assert list(read(b"".join(map(encoded, some)) + torn)) == some


@given(st.lists(faults, max_size=8))
def test_the_last_line_of_a_fault_counts(some: list[Fault]) -> None:
    """In the order in which they were first told; only what began was done, in the order of
    beginnings.
    """
    last = {one.id: one for one in some}
    assert latest(some) == tuple(last[name] for name in dict.fromkeys(one.id for one in some))
    assert done(some) == tuple(
        sorted((one for one in last.values() if one.began), key=lambda one: one.began)
    )


@given(
    st.lists(faults, max_size=6), st.lists(st.integers(1, 300), max_size=8), st.just(0.0) | times
)
def test_what_is_new_is_told_once(some: list[Fault], cuts: list[int], known: float) -> None:
    """However the lines are cut; those that were known before are left out."""
    data, told = b"".join(map(encoded, some)), []
    with tempfile.TemporaryDirectory() as folder:
        reader, file = FaultFile(Path(folder), known), Path(folder) / FAULTS_FILE
        assert reader.new() == []
        for cut in [*sorted({min(cut, len(data)) for cut in cuts}), len(data)]:
            file.write_bytes(data[:cut])
            told += reader.new()
    assert told == [one for one in some if one.t > known]


def test_a_line_of_another_version_is_left_out() -> None:
    """With further fields it is read, without those it needs it is not."""
    one = Fault(id="a", kind="kill", target="x", t=1.0)
    further = msgspec.json.encode({**msgspec.to_builtins(one), "new": 1}) + b"\n"
    assert list(read(b'{"id": 3}\n' + further)) == [one]


def test_a_run_has_the_faults_that_were_written_while_no_recorder_lived(tmp_path: Path) -> None:
    """Beside those that are recorded, in the order of their beginnings."""
    shutil.copy(POUR, tmp_path)
    began = Run(tmp_path, SYSTEM).history.begin
    one = Fault(id="a", kind="kill", target="pl", t=began + 1.0, began=began + 1.0)
    (tmp_path / FAULTS_FILE).write_bytes(encoded(one))
    assert Run(tmp_path, SYSTEM).history.faults == (one,)
