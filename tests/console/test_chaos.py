"""`roco chaos`: a seed chooses the same cell each time, one that can be done; results are kept and
gone on from.
"""

from pathlib import Path

import msgspec
import pytest
from calling import roco
from hypothesis import given
from hypothesis import strategies as st

from companion.tools.system import SYSTEM
from console import lazy
from console.errors import UsageError
from console.faults import chaos, moments, verbs
from console.faults.chaos import Cell, Result
from console.faults.kinds import KINDS, VERBS
from console.output import Format
from console.runs import experiment, folders
from operate.system import Job

WITHOUT = msgspec.structs.replace(SYSTEM, job=Job())
CELL = Cell(1, "kill", "pl", "planning", "event:plan-requested 1")


def result(
    cell: Cell = CELL, *, success: bool = True, why: str = "", began: bool = True, **more: object
) -> Result:
    """A run."""
    told = {"broken": (), "stuck": False, "orphans": (), **more}
    whole = {"exit": 0, "bytes": 1, "wall_s": 1.0, "load": 0.1, "text": "back"}
    return Result(cell=cell, began=began, success=success, why=why, **told, **whole)  # type: ignore[arg-type]


@given(st.integers(0, 2**31), st.sampled_from([SYSTEM, WITHOUT]))
def test_a_seed_is_a_cell_that_can_be_done(seed: int, system: chaos.System) -> None:
    """Always the same; its kind's verb takes its words, its moment is one, its amount lies in the
    kind's span.
    """
    cell = chaos.choose(system, seed, (), ())
    assert cell == chaos.choose(system, seed, (), ())
    row = KINDS[cell.kind]
    assert cell.target in chaos.targets_of(system, row)
    moments.parse(cell.at, system.design, cell.target)
    if row.amount is not None:
        assert cell.amount is not None
        assert row.amount.tried[0] <= cell.amount <= row.amount.tried[1]
    given = lazy.made("fault", verbs.fault).make_context("fault", list(cell.command)).params
    assert (given["kind"], given["process"], given["at"]) == (cell.kind, cell.target, cell.at)
    much = verbs.amount_of(cell.kind, row, given["amount"], given["per_second"])
    assert much == (cell.amount or 0.0)
    assert given["for_"] is None or row.for_s is not None


@given(st.integers(0, 2**31), st.sets(st.sampled_from(VERBS), min_size=1))
def test_only_what_was_asked_for_is_done(seed: int, kinds: set[str]) -> None:
    """Kinds and processes."""
    cell = chaos.choose(SYSTEM, seed, tuple(sorted(kinds)), ("pl", "co"))
    assert cell.kind in kinds
    assert cell.target in ("pl", "co")


def test_all_kinds_and_phases_come() -> None:
    """Some seed has each."""
    found = [chaos.choose(SYSTEM, seed, (), ()) for seed in range(500)]
    assert {one.kind for one in found} == {*VERBS}
    assert {one.phase for one in found} == {*SYSTEM.job.phases}


def test_a_kind_that_can_be_done_to_none_is_told() -> None:
    """The loop has no wire."""
    with pytest.raises(UsageError, match="cut can be done to none of loop"):
        chaos.choose(SYSTEM, 1, ("cut",), ("loop",))


def test_wrong_use_is_told() -> None:
    """Before anything is started."""
    no_kind = "there is no kind of fault 'explode'; there are kill, "
    assert no_kind in roco("chaos", "--kind", "explode", code=2).output
    no_process = "there is no process 'cow'; there are router, "
    assert no_process in roco("chaos", "--on", "cow", code=2).output
    assert "name its folder with --out" in roco("chaos", "--resume", code=2).output


@pytest.mark.parametrize(
    ("one", "held", "colour"),
    [
        (result(), True, chaos.DONE),
        (result(success=False, why="no way"), True, chaos.EXPLAINED),
        (result(success=False), False, chaos.BROKEN),
        (result(broken=("lost",)), False, chaos.BROKEN),
        (result(stuck=True), False, chaos.BROKEN),
        (result(orphans=("python",)), False, chaos.BROKEN),
        (result(began=False), True, chaos.NOTHING),
    ],
)
def test_a_run_holds_where_it_is_done_or_explained_and_nothing_is_broken(
    one: Result, held: bool, colour: str
) -> None:
    """And its seed has the colour of that."""
    assert (one.held, chaos.colour(one)) == (held, colour)


@pytest.fixture
def done(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[int]:
    """In place of runs the seeds that were run; seed 2 is broken."""
    seeds: list[int] = []

    def run(out: Path, setting: experiment.Setting, cell: Cell) -> Result:
        seeds.append(cell.seed)
        experiment.folder(out, cell.seed).mkdir(parents=True, exist_ok=True)
        return result(cell, broken=("it broke",) if cell.seed == 2 else ())

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(chaos, "done", run)
    monkeypatch.setattr(chaos, "here", lambda: SYSTEM)
    return seeds


def test_what_is_done_is_not_done_again(done: list[int], tmp_path: Path) -> None:
    """With --resume more runs are added; a line that a kill cut off is repeated; folders stay only
    of broken runs.
    """
    out = str(tmp_path / "c")
    assert "it broke" in roco("chaos", "--runs", 3, "--out", out, code=1).output
    assert done == [1, 2, 3]
    assert [path.name for path in (tmp_path / "c/runs").iterdir()] == ["seed-2"]
    file = tmp_path / "c" / chaos.RESULTS_FILE
    file.write_bytes(file.read_bytes()[:-20])
    roco("chaos", "--runs", 4, "--out", out, "--resume")
    assert done == [1, 2, 3, 3, 4]
    results = experiment.read_lines(file, Result)
    assert [one.cell.seed for one in results] == [1, 2, 3, 4]


def test_a_budget_begins_no_more_runs(done: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    """And says how to go on."""
    clock = iter(range(0, 10_000, 100))
    monkeypatch.setattr(chaos.time, "monotonic", lambda: float(next(clock)))
    told = roco("chaos", "--runs", 9, "--budget", 4, "--seed", 3, "--out", "c").output
    assert done == [3, 4]
    assert "--out" in told
    assert "--resume" in told


def test_programs_get_a_line_for_each_run(done: list[int]) -> None:
    """With the cell that repeats it."""
    told = roco("chaos", "--runs", 2, "--seed", 5, "--out", "c", "--format", Format.JSON).stdout
    found = [msgspec.json.decode(line, type=Result) for line in told.splitlines()]
    assert [one.cell for one in found] == [chaos.choose(SYSTEM, seed, (), ()) for seed in (5, 6)]


def test_beside_a_fleet_it_is_refused(done: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    """The machine would be shared."""
    fleet = folders.Fleet("roco", "tcp/127.0.0.1:1", 1, 1.0, ())
    living = folders.Living(Path("runs/x"), fleet, ("router",))
    monkeypatch.setattr(folders, "living_here", lambda: [living])
    assert "a fleet runs here already" in roco("chaos", code=1).output
    assert done == []
