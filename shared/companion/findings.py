"""Inconsistencies in the design of the Robot Companion, or between it and its languages, for tools
and tests.

Apart from companion.design, so that no agent loads the checks when it starts.
"""

from typing import get_args

from companion.all_languages import LANGUAGES
from companion.design import DESIGN
from companion.languages import wm
from topdown import check
from topdown.check import agreement
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind

# Interface sets whose argument classes are, together, exactly the query classes of WM.
QUERY_INTERFACES = ("knowledge", "hypotheses")


def findings(design: Design = DESIGN) -> tuple[Finding, ...]:
    """All inconsistencies in the design, and between it and the languages; () if there are none."""
    return (*check.check(design), *agreement_findings(design))


def agreement_findings(design: Design) -> tuple[Finding, ...]:
    """All inconsistencies between the design and the languages; () if there are none."""
    classes = {
        entry.name: [kind.__name__ for kind in LANGUAGES.named(entry.name).classes]
        for entry in design.file.language
        if entry.name in LANGUAGES.names
    }
    queries = [kind.__name__ for kind in get_args(wm.AnyQuery)]
    lost = [one for one in wm.Query.__subclasses__() if one not in get_args(wm.AnyQuery)]
    return (
        *(
            Finding(
                Kind.UNUSED,
                f"WM.{one.__name__}",
                "a query that is not in WM",
                "name it in AnyQuery",
            )
            for one in lost
        ),
        *agreement.check_languages(design, classes),
        *agreement.check_queries(design, QUERY_INTERFACES, "WM", queries),
    )
