"""`roco design check|trace|diff`: what is printed, in both forms, and the exit codes."""

import json
from functools import partial
from pathlib import Path

import pytest
from calling import printed, roco

from companion.design import FILE
from topdown.model.schema import schema

TESTS = Path(__file__).resolve().parents[1]
PRINTED = TESTS / "topdown/paper_as_printed.toml"
BARROW = TESTS / "topdown/barrow.toml"
RUN = TESTS / "companion/pours/pour_seed_3.json"
HISTORY = TESTS / "histories/pour_seed_7"


design = partial(roco, "design", columns=80)


@pytest.mark.parametrize("file", [(), (BARROW,)])
def test_a_sound_design_exits_with_0(file: tuple[Path, ...]) -> None:
    """The companion's is the default; and it says what there is."""
    done = design("check", *file, code=0)
    assert "no findings in" in done.output


def test_findings_exit_with_1_and_have_file_and_line() -> None:
    """As compilers write them."""
    done = design("check", PRINTED, code=1)
    assert "paper_as_printed.toml:64: group never introduced" in done.output
    assert "34 findings: " in done.output


@pytest.mark.parametrize("columns", [80, 120])
def test_lines_fit_the_terminal(columns: int) -> None:
    """But for what cannot be broken: paths."""
    for words in (
        ("check", PRINTED),
        ("diff", FILE, BARROW),
        ("check", "--estimate", "--recording", RUN),
    ):
        lines = design(*words, columns=columns).output.splitlines()
        assert lines
        assert [line for line in lines if len(line) > columns and " " in line.strip()] == []


@pytest.mark.parametrize("verb", ["check", "trace"])
def test_a_file_that_is_not_there_exits_with_2(verb: str, tmp_path: Path) -> None:
    """So does one that is not a design, with its line."""
    assert design(verb, tmp_path / "none.toml").exit_code == 2
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(BARROW.read_text().replace('name = "barrow"', "name = 3"))
    done = design(verb, wrong)
    assert done.exit_code == 2
    assert "wrong.toml:" in done.output + done.stderr


def test_json_has_every_finding() -> None:
    """With kind, place and what would be right."""
    done = design("check", PRINTED, "--format", "json")
    found = json.loads(done.stdout)["findings"]
    assert done.exit_code == 1
    assert {"kind", "where", "wrong", "right", "line"} <= found[0].keys()
    assert any(one["kind"] == "channel renumbered" for one in found)


def test_a_recording_is_read_by_the_recorders_process() -> None:
    """From traffic.mcap; the committed history has answers later than the design allows."""
    done = design("check", "--recording", HISTORY, code=1)
    assert "latency budget exceeded" in done.output


def test_a_folder_without_a_recording_is_told(tmp_path: Path) -> None:
    """In words, and with exit code 2."""
    done = design("check", "--recording", tmp_path, code=2)
    assert "no recorded communicates" in done.stderr


def test_rulings_are_printed_where_they_are_wanted() -> None:
    """With file and line; they are not findings."""
    assert "ruling on" not in design("check").output
    done = design("check", "--rulings", code=0)
    assert "design.toml:" in done.output
    assert "ruling on protocol execute_plan" in done.output
    assert len(printed("design", "check", "--rulings")["rulings"]) > 20


def test_the_schema_is_for_editors() -> None:
    """Printed as JSON, without a design."""
    assert json.loads(design("check", "--schema", code=0).stdout) == schema()


def test_every_leaf_of_the_companion_has_evidence() -> None:
    """And a recording shows what it can show."""
    done = design("trace", "--recording", RUN, code=0)
    assert "all 11 leaves have evidence" in done.output


def test_leaves_without_evidence_are_printed(tmp_path: Path) -> None:
    """By name, and in JSON; the exit code is 1."""
    bare = tmp_path / "bare.toml"
    bare.write_text(
        BARROW.read_text().replace(
            'evidence = ["event:order done", "message:order inform WAY.Arrived"]', ""
        )
    )
    done = design("trace", bare, code=1)
    assert "without evidence: R2" in done.output
    assert printed("design", "trace", bare, code=1)["bare"][0] == "R2"


def test_a_design_does_not_differ_from_itself(tmp_path: Path) -> None:
    """Exit code 0; a changed one 1, with both values, and a written JSON."""
    design("diff", FILE, FILE, code=0)
    changed = tmp_path / "changed.toml"
    changed.write_text(BARROW.read_text().replace("latency_s = 9.0", "latency_s = 7.0"))
    done = design("diff", BARROW, changed, code=1)
    assert "latency_s: 9 -> 7" in done.output
    assert printed("design", "diff", BARROW, changed, code=1)[0]["new"] == "7"


def test_an_estimate_names_the_narrow_place() -> None:
    """And needs no recording."""
    done = design("check", "--estimate", code=0)
    assert "narrowest: channel C4" in done.output
    assert printed("design", "check", "--estimate")["estimate"]["narrowest"] == "C4"


def test_an_estimate_beside_a_run_tells_its_error() -> None:
    """Exit code 1 where one is further off than wanted, 0 where any error will do."""
    assert "error" in design("check", "--estimate", "--recording", RUN).output
    design("check", "--estimate", "--recording", RUN, "--within", 9, code=0)
    design("check", "--estimate", "--recording", RUN, "--within", 0, code=1)
