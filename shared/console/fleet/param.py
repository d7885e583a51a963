"""`roco param`: the parameters of the design's agents, and their values now."""

from collections.abc import Iterator
from typing import Annotated

import msgspec
from rich.text import Text

from agent_runtime.core.control import LEVELS, Order, SetLevel, SetParameter, Value
from console import completion
from console.errors import UsageError
from console.fleet import operator, targets
from console.fleet.targets import Target
from console.output import Form, Format, RunDir, argument, tell
from console.terminal.console import Console, table
from topdown.model.parameters import Parameters, allowed, worded

LEVEL = completion.LEVEL
HEADS = ("agent", "parameter", "value", "default", "allowed", "says")


class Shown(msgspec.Struct, frozen=True):
    """A parameter. `value`: now, the default where the agent never ran; `allowed`: what it can be,
    in words.
    """

    agent: str
    name: str
    value: Value
    default: Value
    allowed: str
    says: str


class Listed(msgspec.Struct, frozen=True):
    """`roco param --format json` where no parameter is named."""

    where: str
    parameters: tuple[Shown, ...]


def param(
    agent: Annotated[
        str, argument("Only this one's.", complete=completion.agents, metavar="[AGENT]")
    ] = "",
    name: Annotated[
        str, argument("Only this one.", complete=completion.parameters, metavar="[NAME]")
    ] = "",
    value: Annotated[
        str | None,
        argument("Its value from now on.", complete=completion.parameter_values, metavar="[VALUE]"),
    ] = None,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Show the parameters of all agents, of one, or a single one; with VALUE set it while the agent
    runs.

    A list has value now, default, what it can be, what it does; of a single one the value is
    printed. The agent's next step reads a new value, and a restart keeps it. Every agent has
    log-level, too: the least level that its output shows; its log file has everything. Exits with 2
    where the value does not fit the design.

    Examples:
      roco param
      roco param AGENT --format json
      roco param AGENT log-level
      roco param AGENT log-level debug
    """
    fleet = targets.find(target, run_dir)
    if name:
        if value is not None:
            operator.order(fleet, agent, setting(fleet, agent, name, value))
        one = log_level(fleet, agent) if name == LEVEL else one_of(fleet, agent, name)
        tell(one, form, worded(one.value))
        return
    names = (operator.agent_of(fleet, agent),) if agent else tuple(fleet.system.design.agents)
    told = Listed(fleet.where, tuple(one for each in names for one in shown(fleet, each)))
    if told.parameters:
        drawn = table(HEADS, map(_row, told.parameters), fold=HEADS)
        tell(told, form, lambda: Console().print(drawn))
    else:
        none = f"{agent or fleet.system.name} has no parameters"
        tell(told, form, f"{none}; docs/parameters.md says how to give it some")


def setting(fleet: Target, agent: str, name: str, text: str) -> Order:
    """The order that sets a parameter. Raise UsageError for another log level, else as
    Parameters.read does.
    """
    if name != LEVEL:
        return SetParameter(name, of(fleet, agent).read(name, text))
    if text not in LEVELS:
        raise UsageError(f"{text!r} is no log level; give one of {', '.join(LEVELS)}")
    return SetLevel(text)


def log_level(fleet: Target, agent: str) -> Shown:
    """The least level of what an agent's output shows, as its last heartbeat says."""
    beat = operator.heartbeat(fleet, operator.agent_of(fleet, agent))
    level = beat.level if beat is not None else ""
    return Shown(
        agent, LEVEL, level, "info", ", ".join(LEVELS), "the least level that its output shows"
    )


def of(fleet: Target, agent: str) -> Parameters:
    """The parameters of an agent. Raises UsageError for an unknown agent."""
    return Parameters(fleet.system.design.agent(operator.agent_of(fleet, agent)))


def one_of(fleet: Target, agent: str, name: str) -> Shown:
    """A parameter with its value. Raises NoSuchParameter, which lists those there are."""
    of(fleet, agent).entry(name)
    return next(one for one in shown(fleet, agent) if one.name == name)


def shown(fleet: Target, agent: str) -> Iterator[Shown]:
    """The parameters of an agent, with the values of its last heartbeat."""
    parameters = of(fleet, agent)
    beat = operator.heartbeat(fleet, agent) if parameters.entries else None
    now = parameters.defaults | (beat.parameters if beat is not None else {})
    for name, entry in parameters.entries.items():
        yield Shown(agent, name, now[name], parameters.defaults[name], allowed(entry), entry.says)


def _row(one: Shown) -> tuple[str | Text, ...]:
    value = Text(worded(one.value), "" if one.value == one.default else "bold")  # bold: it was set
    return one.agent, one.name, value, worded(one.default), Text(one.allowed), one.says
