"""Wrong inputs end in documented errors, with words: some thousand new ones, and each that was a
crash once.

`benchmarks/fuzz.py` runs a million; what crashes there is kept in tests/fuzz_corpus.
"""

import random
from pathlib import Path

import pytest
from fuzzing import Outcome, fuzz, replayed
from mutation import mutated
from targets import TARGETS, Target, held

CORPUS = Path(__file__).parents[1] / "fuzz_corpus"
SEED, MOST = 16, 300
BY_NAME = {target.name: target for target in TARGETS}
KEPT = sorted(path for path in CORPUS.glob("*/*") if path.is_file())
each = pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)


def unbroken(outcome: Outcome) -> None:
    """No crash."""
    assert not outcome.crashes, [
        (crash.where, crash.what, crash.input[:200]) for crash in outcome.crashes[:3]
    ]


@each
def test_new_inputs_crash_nothing(target: Target) -> None:
    """The same inputs in each run."""
    count = max(60, int(MOST * min(target.weight, 1.0)))
    outcome = fuzz(target, SEED, count)
    unbroken(outcome)
    assert outcome.inputs == count


@pytest.mark.parametrize("path", KEPT, ids=lambda path: f"{path.parent.name}-{path.name}")
def test_what_crashed_once_does_not_again(path: Path, tmp_path: Path) -> None:
    """Each was found by fuzzing, and mended."""
    unbroken(replayed(BY_NAME[path.parent.name], path.read_bytes(), tmp_path))


@each
def test_valid_inputs_are_accepted_and_some_changed_ones_are_not(
    target: Target, tmp_path: Path
) -> None:
    """Else nothing but the first check of a reader would be tried."""
    seeds = target.seeds()
    accepted = [not replayed(target, data, tmp_path).errors.keys() - {""} for data in seeds[:12]]
    assert sum(accepted) >= len(accepted) / 4
    chance = random.Random(SEED)
    changed = {mutated(seeds, target.changes, chance) for _ in range(100)}
    assert len(changed) > 80
    if target.allowed:
        assert any(replayed(target, data, tmp_path).errors.keys() - {""} for data in changed)


def test_a_reader_that_crashes_hangs_or_breaks_its_promise_is_noticed(tmp_path: Path) -> None:
    """The fuzzer finds the crash and the broken promise of a toy reader, and accepts a fine
    input.
    """

    def reader(data: bytes) -> None:
        held(data != b"promise", "never b'promise'")
        data.decode()

    from contextlib import nullcontext

    toy = Target(
        "toy",
        "a toy",
        lambda: [b"seed"],
        lambda folder: nullcontext(reader),
        BY_NAME["codec"].changes,
    )
    assert fuzz(toy, SEED, 200).crashes
    assert "Broken" in replayed(toy, b"promise", tmp_path).crashes[0].what
    assert not replayed(toy, b"fine", tmp_path).crashes
