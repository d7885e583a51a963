"""The design of the Robot Companion, read once from design.toml; every agent, tool and document gets it here.

`DESIGN.key(system, communicate)`, `DESIGN.rule(communicate)`, `DESIGN.agent("co")` and so on are in topdown.design.
Must not know: agents' code, Zenoh.
"""

from enum import StrEnum
from pathlib import Path
from typing import get_args

from companion.languages import LANGUAGES, wm
from topdown import checks
from topdown.design import Design, load

FILE = Path(__file__).with_name("design.toml")
DESIGN: Design = load(FILE)


class AgentName(StrEnum):
    """The six agents by the names of the paper."""

    CO = "co"
    HI = "hi"
    PL = "pl"
    KM = "km"
    TA = "ta"
    EX = "ex"


# Interface sets whose argument classes are, together, exactly the query classes of WM.
QUERY_INTERFACES = ("knowledge", "hypotheses")


def findings(design: Design = DESIGN) -> tuple[checks.Finding, ...]:
    """Whatever is inconsistent in the design or between it and the languages; nothing, if all is well."""
    classes = {
        entry.name: [kind.__name__ for kind in LANGUAGES.named(entry.name).classes]
        for entry in design.file.language
        if entry.name in LANGUAGES.names
    }
    queries = [kind.__name__ for kind in get_args(wm.AnyQuery)]
    return (
        *checks.check(design),
        *checks.check_languages(design, classes),
        *checks.check_queries(design, QUERY_INTERFACES, "WM", queries),
    )
