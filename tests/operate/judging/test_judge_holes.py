"""After a hole in the recording: which conversations have ended, and why some of it is not judged."""

from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from operate.cli.traffic.conversation import Conversation, conversations
from operate.judging.judged import of_records
from operate.recording import mcap_file
from operate.recording.records import Record, Resumed, Spoken
from operate.system import System, here
from topdown.judge.verdicts import Verdict

ROOT = Path(__file__).parents[3]
HISTORIES = ROOT / "tests" / "histories"
SYSTEMS = {"verified_depot": here(ROOT / "examples" / "depot"), "pour_seed_7": here(ROOT)}
RUNS = {name: mcap_file.read(HISTORIES / name / mcap_file.FILE, system).records for name, system in SYSTEMS.items()}
NOT_FROM_THE_BEGINNING = "the beginning of its conversation was not heard"


def told(records: tuple[Record, ...], system: System) -> dict[tuple[str, str, str], Conversation]:
    """The conversations of a recording, as `roco conversation list` has them."""
    found = conversations(list(of_records(records, system)), system.design)
    return {(one.id, one.protocol, one.participant): one for one in found}


WHOLE = {name: told(RUNS[name], system) for name, system in SYSTEMS.items()}


@pytest.mark.parametrize("name", SYSTEMS)
@given(ends=st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)).map(sorted))
@example(ends=[0.0, 0.125])  # a copy of an opening is heard, and not the answer to it
def test_a_hole_before_the_last_message_leaves_nothing_open(name: str, ends: list[float]) -> None:
    """Nobody is blamed, and no beginning that was heard is said to be missing."""
    records, system = RUNS[name], SYSTEMS[name]
    said = [one.received for one in records if isinstance(one, Spoken)]
    since, until = (said[0] - 0.1 + end * (said[-1] - said[0] + 0.2) for end in ends)
    before = [one for one in records if one.received < since]
    behind = [one for one in records if one.received > until]
    left = (*before, Resumed(since, until), *behind)
    for known, one in told(left, system).items():
        whole = WHOLE[name][known]
        assert one.violations == 0
        if whole.ended and whole.until > until:
            assert one.ended, (one.states, one.said[-1])
        unjudged = {judged.why for judged in one.said if judged.verdict == Verdict.NOT_JUDGED}
        if one.since < since:
            assert NOT_FROM_THE_BEGINNING not in unjudged
