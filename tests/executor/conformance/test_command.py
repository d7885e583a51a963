"""`python -m services.executor.conformance`: what a lab sees."""

import msgspec
import pytest
from typer.testing import CliRunner

from services.executor.conformance import CHECKS, Result
from services.executor.conformance.__main__ import app


def ask(*words: str) -> tuple[int, str, str]:
    """Exit code, standard output, standard error."""
    done = CliRunner().invoke(app, list(words), env={"COLUMNS": "200"})
    return done.exit_code, done.stdout, done.stderr


def test_a_failure_says_what_is_wrong_by_how_much_and_what_to_do() -> None:
    """Property, measured value, limit with its source, remedy; exit code 1."""
    code, out, _ = ask("turned:make", "--only", "own-joint,period")
    assert code == 1
    assert "FAILED   readings   own-joint" in out
    assert "measured  1 joints (right_arm_1_joint by -" in out
    assert "limit     0 joints - velma.names.BODY" in out
    assert "to do     map joints by name" in out
    assert "1 passed, 1 failed, 0 left out: the back-end does not conform" in out


def test_a_right_one_ends_with_0() -> None:
    """And the sentence."""
    code, out, _ = ask("point_mass:make", "--only", "period,rest,head")
    assert (code, out.splitlines()[-1]) == (0, "3 passed, 0 failed, 0 left out: the back-end conforms")


def test_what_was_left_out_is_told() -> None:
    """By name; it does not count as conforming."""
    code, out, _ = ask("point_mass:make", "--gentle", "--only", "period,servo-ends")
    assert code == 0
    assert "left out, so not known: servo-ends" in out
    assert "conforms" not in out


def test_json_is_for_programs() -> None:
    """Standard output is one list of results."""
    code, out, _ = ask("turned:make", "--only", "own-joint", "--format", "json")
    (result,) = msgspec.json.decode(out, type=list[Result])
    assert (code, result.check, result.value, result.limit) == (1, "own-joint", 1.0, 0.0)


@pytest.mark.parametrize("words", [("no_such:make",), ("point_mass:none",), ("point_mass",), ("point_mass:INERTIA",)])
def test_no_such_back_end_is_wrong_usage(words: tuple[str, ...]) -> None:
    """Exit code 2, and what to give."""
    code, _, error = ask(*words)
    assert code == 2
    assert "makes a back-end" in error


def test_an_unknown_check_is_wrong_usage() -> None:
    """With the names there are."""
    code, _, error = ask("point_mass:make", "--only", "own-joints")
    assert code == 2
    assert "whole-records" in error


def test_the_list_has_every_property_with_its_limit_and_source() -> None:
    """No back-end is needed for it."""
    code, out, _ = ask("--list")
    assert code == 0
    assert all(f"  {check.name} " in out and check.source in out for check in CHECKS)


def test_names_are_unique_and_every_limit_has_its_source_and_remedy() -> None:
    """So that a lab can trust and act."""
    assert len({check.name for check in CHECKS}) == len(CHECKS)
    assert all(check.source and check.remedy and check.says for check in CHECKS)
