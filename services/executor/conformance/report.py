"""The report: a line for each property; then each failure with its value, its limit, and what to do."""

from collections.abc import Iterable

from services.executor.conformance.judging import Check, Result, Verdict


def number(value: float) -> str:
    """Return a value with three digits."""
    return f"{value:.3g}"


def listed(checks: Iterable[Check]) -> str:
    """Return each property with its limit and the source of that, by area."""
    lines, area = [], None
    for check in checks:
        if check.area is not area:
            area = check.area
            lines += ["", str(area)]
        lines.append(f"  {check.name:16}  {check.says}")
        lines.append(f"  {'':16}  at most {number(check.limit)} {check.unit}".rstrip() + f": {check.source}")
    return "\n".join(lines[1:])


def line(result: Result) -> str:
    """Return the line of one property: verdict, area, name, value, limit."""
    measured = "-" if result.value is None else number(result.value)
    against = f"{measured} of at most {number(result.limit)} {result.unit}".rstrip()
    return f"{result.verdict:8} {result.area:9}  {result.check:16}  {against}"


def page(results: Iterable[Result]) -> str:
    """Return all failures in words, and the totals."""
    every = tuple(results)
    parts = [told(result) for result in every if result.verdict is Verdict.FAILED]
    left = [result.check for result in every if result.verdict is Verdict.LEFT_OUT]
    if left:
        parts.append(f"left out, so not known: {', '.join(left)}")
    failed = sum(result.verdict is Verdict.FAILED for result in every)
    passed = sum(result.passed for result in every)
    verdict = "the back-end does not conform" if failed else "the back-end conforms" if not left else "as far as tried"
    parts.append(f"{passed} passed, {failed} failed, {len(left)} left out: {verdict}")
    return "\n\n".join(parts)


def told(result: Result) -> str:
    """Return one failure in words."""
    measured = "nothing could be measured" if result.value is None else f"{number(result.value)} {result.unit}".rstrip()
    return (
        f"{result.check}: {result.says}\n"
        f"  measured  {measured} ({result.why})\n"
        f"  limit     {number(result.limit)} {result.unit}".rstrip()
        + f" - {result.source}\n"
        f"  to do     {result.remedy}"
    )
