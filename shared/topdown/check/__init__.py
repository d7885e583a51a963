"""Check whether a design is consistent in itself; topdown.check.agreement compares it with code.

The order is format -> names -> requirements, steps -> channels, protocols, forms, interfaces ->
machines, rows, waits, parameters -> guests, includes; recorded compares a run with the design. A
fault is reported once: what only follows from it is left out. The only I/O: included designs are
read.
"""

from topdown.check import guests, includes, machines, names, protocols, requirements, talks
from topdown.check.machines import reachable as reachable
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind, located

PARTS = (
    requirements.findings,
    requirements.step_findings,
    requirements.outcome_findings,
    protocols.channel_findings,
    names.findings,
    protocols.findings,
    protocols.form_findings,
    protocols.within_findings,
    machines.side_findings,
    protocols.interface_findings,
    machines.findings,
    machines.row_findings,
    talks.findings,
    machines.wait_findings,
    machines.parameter_findings,
    guests.findings,
    includes.findings,
)


def check(design: Design) -> tuple[Finding, ...]:
    """All findings of the file itself, none where it is consistent; with lines where the file's
    text is known.
    """
    missing = (one for one in includes.findings(design) if one.kind is Kind.NO_INCLUDE)
    found = (
        tuple(names.twice(design))
        or tuple(missing)
        or tuple(finding for part in PARTS for finding in part(design))
    )
    return located((*names.older(design), *found), design.text)
