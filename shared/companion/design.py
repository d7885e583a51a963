"""The design of the Robot Companion, read once from design.toml, with its six languages and what
binds an agent to it; every agent, tool and document gets it here.

`DESIGN.key(system, communicate)`, `DESIGN.rule(communicate)`, `DESIGN.agent("co")` ... are in
topdown.model.design. Must not know: agents' code, Zenoh.
"""

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, Union, get_args

from agent_runtime.core import binding
from agent_runtime.core.agent import Agent
from agent_runtime.core.binding import Condition, Takes, Transition
from agent_runtime.core.wiring import Wiring
from companion import acts, commands
from companion.languages import cmd, hfsm, rs, sw, wm
from fipa_codec import protocols
from fipa_codec.languages import Kind, Language, Languages
from topdown.model.design import Design, load
from topdown.model.findings import Finding
from topdown.model.findings import Kind as Found

if TYPE_CHECKING:
    AnyCommand = cmd.Command
else:
    AnyCommand = Union[tuple(row.content for row in commands.rows())]  # noqa: UP007
"""A command of some task, for the bytes: Command itself is no content."""


def _kind_of_report(content: object) -> Kind:
    """In coordinate an inform is one on the way or the last one; the worker's state tells which."""
    final = isinstance(content, sw.Report) and content.state in sw.FINAL
    return Kind.FINAL if final else Kind.PROGRESS


def _kind_of_task(content: object) -> Kind:
    """In request an inform tells progress or the result; the task's state tells which."""
    begun = (cmd.TaskState.WAITING, cmd.TaskState.PLANNING)
    going_on = (*begun, cmd.TaskState.RUNNING, cmd.TaskState.SUSPENDED)
    progress = isinstance(content, cmd.TaskReport) and content.state in going_on
    return Kind.PROGRESS if progress else Kind.PLAIN


HFSM = Language("HFSM", hfsm.Content)
SW = Language("SW", sw.Content, kind=_kind_of_report)
WM = Language("WM", wm.Content)
CMD = Language("CMD", AnyCommand | cmd.TaskReport | cmd.Sentence | cmd.Stopped, kind=_kind_of_task)
RC = Language("RC", acts.Content)
RS = Language("RS", rs.Content)

LANGUAGES = Languages((HFSM, SW, WM, CMD, RC, RS))


FILE = Path(__file__).with_name("design.toml")
DESIGN: Design = load(FILE)
COORDINATE = protocols.register(DESIGN.own_tables["coordinate"])
"""The paper's own protocol, known by name from here on (paper, section 5.4)."""


class AgentName(StrEnum):
    """The six agents by the names of the paper."""

    CO = "co"
    HI = "hi"
    PL = "pl"
    KM = "km"
    TA = "ta"
    EX = "ex"


# --- Inconsistencies in the design, or between it and its languages, for tools and tests ----------

# Interface sets whose argument classes are, together, exactly the query classes of WM.
QUERY_INTERFACES = ("knowledge", "hypotheses")


def findings(design: Design = DESIGN) -> tuple[Finding, ...]:
    """All inconsistencies in the design, and between it and the languages; () if there are none."""
    from topdown import check  # no agent loads the checks when it starts

    return (*check.check(design), *agreement_findings(design))


def agreement_findings(design: Design) -> tuple[Finding, ...]:
    """All inconsistencies between the design and the languages; () if there are none."""
    from topdown.check import agreement

    classes = {
        entry.name: [kind.__name__ for kind in LANGUAGES.named(entry.name).classes]
        for entry in design.file.language
        if entry.name in LANGUAGES.names
    }
    queries = [kind.__name__ for kind in get_args(wm.AnyQuery)]
    known = (kind.__name__ for kind in wm.Query.__subclasses__())
    lost = [name for name in known if name not in queries]
    return (
        *(
            Finding(Found.UNUSED, f"WM.{one}", "a query that is not in WM", "name it in AnyQuery")
            for one in lost
        ),
        *agreement.check_languages(design, classes),
        *agreement.check_queries(design, QUERY_INTERFACES, "WM", queries),
    )


# --- Agents and wirings of design.toml (agent_runtime.core.binding), in these languages ----------

M = TypeVar("M")


def bind(
    name: str,
    memory: M,
    behaviours: Mapping[str, Transition[M]],
    conditions: Mapping[str, Condition[M]],
    *,
    takes: Mapping[str, Takes[M]] | None = None,
    local: Any = None,
    design: Design = DESIGN,
) -> Agent[M]:
    """The agent `name` of the design; see agent_runtime.core.binding.bind."""
    return binding.bind(
        name, memory, behaviours, conditions, design=design, takes=takes, local=local
    )


def wiring(name: str, system: str, design: Design = DESIGN) -> Wiring:
    """All links of the agent `name` in the system called `system` (the prefix of its keys)."""
    return binding.wiring(name, system, design=design, languages=LANGUAGES)
