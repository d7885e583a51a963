"""Check whether a design is consistent in itself; topdown.check.agreement compares it with code.

The order is names -> requirements, steps -> channels, protocols, message_form, interfaces -> machines, rows, waits,
parameters -> claims, adding_up; recorded compares a run with the design. A fault is reported once: what only follows
from it is left out. No I/O.
"""

from topdown.check import (
    adding_up,
    channels,
    claims,
    interfaces,
    machines,
    message_form,
    names,
    outcome,
    parameters,
    protocols,
    requirements,
    rows,
    sides,
    steps,
    waits,
)
from topdown.check.machines import reachable as reachable
from topdown.model.design import Design
from topdown.model.findings import Finding, located

PARTS = (
    requirements.findings,
    steps.findings,
    outcome.findings,
    channels.findings,
    names.findings,
    protocols.findings,
    message_form.findings,
    sides.findings,
    interfaces.findings,
    machines.findings,
    rows.findings,
    waits.findings,
    parameters.findings,
    claims.findings,
    adding_up.findings,
)


def check(design: Design) -> tuple[Finding, ...]:
    """All findings of the file itself, none where it is consistent; with lines where the file's text is known."""
    found = tuple(names.twice(design)) or tuple(finding for part in PARTS for finding in part(design))
    return located(found, design.text)
