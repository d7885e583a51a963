"""Check whether a design is consistent in itself; topdown.check.agreement compares it with code.

The order is names -> requirements, steps -> channels, protocols, forms, interfaces -> machines,
rows, waits, parameters; recorded compares a run with the design. A fault is reported once: what
only follows from it is left out. No I/O.
"""

from topdown.check import machines, names, protocols, requirements
from topdown.check.machines import reachable as reachable
from topdown.model.design import Design
from topdown.model.findings import Finding, located

PARTS = (
    requirements.findings,
    requirements.step_findings,
    requirements.outcome_findings,
    protocols.channel_findings,
    names.findings,
    protocols.findings,
    protocols.form_findings,
    machines.side_findings,
    protocols.interface_findings,
    machines.findings,
    machines.row_findings,
    machines.wait_findings,
    machines.parameter_findings,
)


def check(design: Design) -> tuple[Finding, ...]:
    """All findings of the file itself, none where it is consistent; with lines where the file's
    text is known.
    """
    found = tuple(names.twice(design)) or tuple(
        finding for part in PARTS for finding in part(design)
    )
    return located(found, design.text)
