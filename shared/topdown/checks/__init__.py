"""Is a design consistent in itself? Typed findings, none where all is well; topdown.agreement compares it with code.

names -> requirements, steps -> channels, protocols, forms, interfaces -> machines, rows, waits -> claims,
adding_up; recorded: a run against the design. A fault is reported
once: what only follows from it is left out. No I/O.
"""

from topdown.checks import (
    adding_up,
    channels,
    claims,
    forms,
    interfaces,
    machines,
    names,
    outcome,
    protocols,
    requirements,
    rows,
    sides,
    steps,
    waits,
)
from topdown.checks.machines import reachable as reachable
from topdown.design import Design
from topdown.findings import Finding, located

PARTS = (
    requirements.findings,
    steps.findings,
    outcome.findings,
    channels.findings,
    names.findings,
    protocols.findings,
    forms.findings,
    sides.findings,
    interfaces.findings,
    machines.findings,
    rows.findings,
    waits.findings,
    claims.findings,
    adding_up.findings,
)


def check(design: Design) -> tuple[Finding, ...]:
    """All findings of the file itself, none where it is consistent; with lines where the file's text is known."""
    found = tuple(names.twice(design)) or tuple(finding for part in PARTS for finding in part(design))
    return located(found, design.text)
