"""A pytest plugin: the tests that every back-end of the executor must pass. docs/back-ends.md is
their contract.

    python -P -m pytest -p services.executor.conformance --backend my_lab.robot:make

In tests of your own:

    @pytest.mark.parametrize("check", CHECKS, ids=str)
    def test_my_robot_conforms(check):
        result = judged(check, Subject(make))
        assert result.passed, result
"""

import math
import threading
from pathlib import Path

import msgspec
import pytest

from services.executor.conformance.checks import CHECKS, Check, Measured
from services.executor.conformance.subject import Subject
from services.executor.loop.backends import SHORT, maker
from velma.errors import BackendError
from velma.model import scene

__all__ = ["CHECKS", "Check", "Result", "Subject", "judged"]

HUNG = pytest.StashKey[str]()
"""The check that did not come back: after it nothing else is tried, since the robot may still be in
it.
"""


class Result(msgspec.Struct, frozen=True):
    """What a check has measured and where; None where nothing could be measured, and then why. In
    words as `str`.
    """

    check: Check
    value: float | None
    why: str
    hung: bool = False

    @property
    def passed(self) -> bool:
        """Whether the property holds."""
        return (
            self.value is not None and math.isfinite(self.value) and self.value <= self.check.limit
        )

    @property
    def measured(self) -> str:
        """The value beside its limit."""
        value = "-" if self.value is None else f"{self.value:.3g}"
        return f"{value} of at most {self.check.limit:.3g} {self.check.unit}".rstrip()

    def __str__(self) -> str:
        check = self.check
        value = (
            "nothing could be measured"
            if self.value is None
            else f"{self.value:.3g} {check.unit}".rstrip()
        )
        limit = f"{check.limit:.3g} {check.unit}".rstrip()
        return (
            f"{check.name}: {check.says}\n"
            f"  measured  {value} ({self.why})\n"
            f"  limit     {limit} - {check.source}\n"
            f"  to do     {check.remedy}"
        )


def judged(check: Check, subject: Subject) -> Result:
    """The result of one check. Never raises; returns within the time of the check even if the robot
    hangs.
    """
    found: list[Measured | BaseException] = []

    def measure() -> None:
        try:
            found.append(check.measure(subject))
        except BaseException as error:  # whatever the back-end raises is the result of the check
            found.append(error)

    thread = threading.Thread(target=measure, name=check.name, daemon=True)
    thread.start()
    thread.join(check.most_s)
    if not found:
        return Result(
            check, None, f"no answer within {check.most_s:g} s: a call does not return", hung=True
        )
    if isinstance(found[0], BaseException):
        return Result(check, None, f"{type(found[0]).__name__}: {found[0]}")
    return Result(check, *found[0])


# --- The plugin -----------------------------------------------------------------------------------


class Property(pytest.Item):
    """The test of one check; `subject`: the back-end."""

    def __init__(self, *, check: Check, subject: Subject, **more: object) -> None:
        super().__init__(**more)  # type: ignore[arg-type]
        self.check, self.subject = check, subject

    def runtest(self) -> None:
        """Fail with what is wrong, by how much, and what to do."""
        if hung := self.session.stash.get(HUNG, ""):
            pytest.fail(f"{self.check}: not tried: {hung} did not come back", pytrace=False)
        if self.check.rough and self.subject.gentle:
            pytest.skip("left out, so not known: it pushes the robot to its ends (--gentle)")
        result = judged(self.check, self.subject)
        if result.hung:
            self.session.stash[HUNG] = self.check.name
        self.user_properties.append(("measured", result.measured))
        if not result.passed:
            pytest.fail(str(result), pytrace=False)

    def reportinfo(self) -> tuple[Path, None, str]:
        """Area and name, as a headline."""
        return self.path, None, f"{self.check.area}: {self.check}"


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options."""
    group = parser.getgroup("back-end", "a back-end of the executor (docs/back-ends.md)")
    group.addoption(
        "--backend", help=f"package.module:function that makes a back-end; {', '.join(SHORT)}"
    )
    group.addoption(
        "--paced", action="store_true", help="A robot in real time: a step every period."
    )
    group.addoption(
        "--gentle", action="store_true", help="Leave out what pushes joints to their ends."
    )
    group.addoption(
        "--push", type=float, default=0.1, help="Share of the accepted torque that moves a joint."
    )


def pytest_collection(session: pytest.Session) -> bool | None:
    """With --backend the checks of the table are all that is tried, whatever the folder has."""
    config = session.config
    backend = config.getoption("backend")
    if not backend:
        return None
    try:
        make = maker(backend, scene.load())
        # what is no back-end is told once, and not by every check
        getattr(make(), "close", lambda: None)()
    except BackendError as error:
        raise pytest.UsageError(str(error)) from None
    paced, gentle, push = (config.getoption(name) for name in ("paced", "gentle", "push"))
    subject = Subject(make, paced=paced, gentle=gentle, push=push)
    session.items = [
        Property.from_parent(
            session, name=check.name, nodeid=f"{check.area}::{check}", check=check, subject=subject
        )
        for check in CHECKS
    ]
    config.hook.pytest_collectreport(
        report=pytest.CollectReport("", "passed", None, list(session.items))
    )
    config.hook.pytest_collection_modifyitems(session=session, config=config, items=session.items)
    session.testscollected = len(session.items)
    config.hook.pytest_collection_finish(session=session)
    return True


def pytest_report_collectionfinish(config: pytest.Config, items: list[pytest.Item]) -> list[str]:
    """With --collect-only each property with its limit and the source of that."""
    lines = []
    for check in (
        item.check for item in items if isinstance(item, Property) and config.option.collectonly
    ):
        limit = f"at most {check.limit:.3g} {check.unit}".rstrip()
        lines += [f"{check.area}: {check}", f"  {check.says}", f"  {limit}: {check.source}"]
    return lines


def pytest_report_teststatus(report: pytest.TestReport) -> tuple[str, str, str] | None:
    """With -v a line has the value beside its limit."""
    measured = dict(report.user_properties).get("measured")
    if report.when != "call" or measured is None:
        return None
    return report.outcome, "." if report.passed else "F", f"{report.outcome.upper()} {measured}"
