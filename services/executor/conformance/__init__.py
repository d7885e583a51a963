"""The tests that every back-end of the executor must pass: `python -m services.executor.conformance my_lab.robot:make`.

docs/back-ends.md is the contract that these checks hold a back-end to. In your own tests:

    @pytest.mark.parametrize("check", CHECKS, ids=str)
    def test_my_robot_conforms(check):
        result = judged(check, Subject(make))
        assert result.passed, result
"""

from services.executor.conformance.checks import CHECKS
from services.executor.conformance.judging import Check, Result, Verdict, judged, run
from services.executor.conformance.subject import Subject

__all__ = ["CHECKS", "Check", "Result", "Subject", "Verdict", "judged", "run"]
