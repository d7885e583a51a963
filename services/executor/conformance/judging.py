"""A check measures how far a back-end is from a property; more than the limit fails.

A measurement that raises, does not return, or is not a number fails its check.
"""

import math
import threading
from collections.abc import Callable, Iterable, Iterator
from enum import StrEnum

import msgspec

from services.executor.conformance.subject import Subject

Measured = tuple[float, str]  # how far from the property, in the check's unit; where, in words


class Area(StrEnum):
    """The area of a property."""

    TIMING = "timing"
    READINGS = "readings"
    LIMITS = "limits"
    STOP = "stop"
    SAFE_MODE = "safe mode"
    SLOTS = "slots"


class Check(msgspec.Struct, frozen=True):
    """One property: in words, its limit with the source, the remedy if it does not hold, how it is measured."""

    name: str
    area: Area
    says: str
    limit: float
    unit: str
    source: str
    remedy: str
    measure: Callable[[Subject], Measured]
    rough: bool = False  # pushes joints to their ends: left out with --gentle
    most_s: float = 60.0

    def __str__(self) -> str:
        return self.name


class Verdict(StrEnum):
    """The result of a check."""

    PASSED = "passed"
    FAILED = "FAILED"
    LEFT_OUT = "left out"


class Result(msgspec.Struct, frozen=True):
    """The result of a check. `value` is None if nothing could be measured; `why` is then the reason."""

    check: str
    area: Area
    says: str
    verdict: Verdict
    value: float | None
    limit: float
    unit: str
    source: str
    why: str
    remedy: str

    @property
    def passed(self) -> bool:
        """Whether the property holds."""
        return self.verdict is Verdict.PASSED


def judged(check: Check, subject: Subject) -> Result:
    """Return the result of one check. Never raises; returns within the time of the check even if the robot hangs."""
    if check.rough and subject.gentle:
        return _result(check, Verdict.LEFT_OUT, None, "it pushes the robot to its ends (--gentle)")
    found: list[Measured | BaseException] = []
    thread = threading.Thread(target=_measure, args=(check, subject, found), name=check.name, daemon=True)
    thread.start()
    thread.join(check.most_s)
    if not found:
        return _result(check, Verdict.FAILED, None, f"no answer within {check.most_s:g} s: a call does not return")
    if isinstance(found[0], BaseException):
        return _result(check, Verdict.FAILED, None, f"{type(found[0]).__name__}: {found[0]}")
    value, where = found[0]
    good = math.isfinite(value) and value <= check.limit
    return _result(check, Verdict.PASSED if good else Verdict.FAILED, value, where)


def _measure(check: Check, subject: Subject, found: list[Measured | BaseException]) -> None:
    try:
        found.append(check.measure(subject))
    except BaseException as error:  # whatever the back-end raises is the result of the check
        found.append(error)


def _result(check: Check, verdict: Verdict, value: float | None, why: str) -> Result:
    known = value if value is None or math.isfinite(value) else None
    why = why if known is value else f"{value} {check.unit}; {why}"
    return Result(
        check.name, check.area, check.says, verdict, known, check.limit, check.unit, check.source, why, check.remedy
    )


def run(subject: Subject, checks: Iterable[Check]) -> Iterator[Result]:
    """Yield the results in order. After a call that does not return the rest is not tried: it may still be running."""
    hangs = ""
    for check in checks:
        if hangs:
            yield _result(check, Verdict.FAILED, None, f"not tried: {hangs} did not come back")
            continue
        result = judged(check, subject)
        if result.why.startswith("no answer"):
            hangs = check.name
        yield result
