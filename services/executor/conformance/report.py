"""What a lab reads: a line for each property; then what does not hold, by how much, its limit, and what to do."""

from collections.abc import Iterable

from services.executor.conformance.judging import Check, Result, Verdict


def number(value: float) -> str:
    """Three digits, without noise."""
    return f"{value:.3g}"


def listed(checks: Iterable[Check]) -> str:
    """Every property with its limit and where that comes from, by area."""
    lines, area = [], None
    for check in checks:
        if check.area is not area:
            area = check.area
            lines += ["", str(area)]
        lines.append(f"  {check.name:16}  {check.says}")
        lines.append(f"  {'':16}  at most {number(check.limit)} {check.unit}".rstrip() + f": {check.source}")
    return "\n".join(lines[1:])


def line(result: Result) -> str:
    """One property: verdict, area, name, measured, limit."""
    measured = "-" if result.value is None else number(result.value)
    against = f"{measured} of at most {number(result.limit)} {result.unit}".rstrip()
    return f"{result.verdict:8} {result.area:9}  {result.check:16}  {against}"


def page(results: Iterable[Result]) -> str:
    """All that failed, in words, and the sum."""
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
    """One failure."""
    measured = "nothing could be measured" if result.value is None else f"{number(result.value)} {result.unit}".rstrip()
    return (
        f"{result.check}: {result.says}\n"
        f"  measured  {measured} ({result.why})\n"
        f"  limit     {number(result.limit)} {result.unit}".rstrip()
        + f" - {result.source}\n"
        f"  to do     {result.remedy}"
    )
