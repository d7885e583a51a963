"""`roco param list|get|set`: the parameters of the design's agents, and their values now."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from rich.text import Text

from agent_runtime.core.control import Order, Pause, Resume, SetLevel, SetParameter, Value
from agent_runtime.io.cli import Level
from operate.cli import completion
from operate.cli.fleet import operator, targets
from operate.cli.fleet.targets import Target
from operate.cli.output import Form, Format, RunDir, problems, tell_json
from operate.cli.terminal.console import Console
from operate.cli.terminal.table import table
from topdown.model.parameters import Parameters, allowed, worded

# --- `roco agent pause|resume|log-level NAME`: orders to one agent while it runs -------------------------------------


Agent = Annotated[str, typer.Argument(metavar="AGENT", help="An agent.", autocompletion=completion.agents)]


class Ordered(msgspec.Struct, frozen=True):
    """An agent after an order, as its heartbeat says."""

    agent: str
    paused: bool
    level: str
    text: str


def pause(agent: Agent, target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Let an agent take no step until it is resumed. It stays alive, and what is said to it waits.

    A physical act that has begun goes on to its end: pausing is not an emergency stop. A restart does not end a pause.

    Examples:
      roco agent pause AGENT
    """
    text = f"paused; `roco agent resume {agent}` lets it go on"
    _ordered(agent, Pause(), text, target, run_dir, form)


def resume(agent: Agent, target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Let a paused agent go on with what waits.

    Examples:
      roco agent resume AGENT
    """
    _ordered(agent, Resume(), "goes on", target, run_dir, form)


def log_level(
    agent: Agent,
    level: Annotated[Level, typer.Argument(help="Least level that its output shows; its log file has everything.")],
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Set what an agent's output shows while it runs.

    Examples:
      roco agent log-level AGENT debug
    """
    _ordered(agent, SetLevel(level.value), f"shows {level.value} and above", target, run_dir, form)


def _ordered(agent: str, order: Order, text: str, target: str, run_dir: Path | None, form: Format) -> None:
    with problems(form):
        beat = operator.order(targets.find(target, run_dir), agent, order)
        if form is Format.JSON:
            tell_json(Ordered(agent, beat.paused, beat.level, text))
        else:
            print(f"{agent}: {text}")


# --- `roco param list|get|set` ----------------------------------------------------------------------------------------


HEADS = ("agent", "parameter", "value", "default", "allowed", "says")
Name = Annotated[str, typer.Argument(metavar="NAME", help="A parameter of it.", autocompletion=completion.parameters)]


class Shown(msgspec.Struct, frozen=True):
    """A parameter. `value`: now, the default where the agent never ran; `allowed`: what it can be, in words."""

    agent: str
    name: str
    value: Value
    default: Value
    allowed: str
    says: str


class Listed(msgspec.Struct, frozen=True):
    """`roco param list --format json`."""

    where: str
    parameters: tuple[Shown, ...]


def list_(
    agent: Annotated[
        str, typer.Argument(metavar="[AGENT]", help="Only this one's.", autocompletion=completion.agents)
    ] = "",
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """List the parameters of all agents or of one: value now, default, what it can be, what it does.

    Examples:
      roco param list
      roco param list AGENT --format json
    """
    with problems(form):
        fleet = targets.find(target, run_dir)
        names = (operator.agent_of(fleet, agent),) if agent else tuple(fleet.system.design.agents)
        told = Listed(fleet.where, tuple(one for name in names for one in shown(fleet, name)))
        if form is Format.JSON:
            tell_json(told)
        elif told.parameters:
            Console().print(table(HEADS, map(_row, told.parameters), fold=HEADS))
        else:
            print(f"{agent or fleet.system.name} has no parameters; docs/parameters.md says how to give it some")


def get(agent: Agent, name: Name, target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Show the value of a parameter now.

    Examples:
      roco param get AGENT NAME
    """
    with problems(form):
        fleet = targets.find(target, run_dir)
        _tell(one_of(fleet, agent, name), form)


def set_(
    agent: Agent,
    name: Name,
    value: Annotated[
        str, typer.Argument(metavar="VALUE", help="Its value from now on.", autocompletion=completion.parameter_values)
    ],
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Set a parameter of an agent while it runs; its next step reads it, and a restart keeps it.

    Exits with 2 where the value does not fit the design.

    Examples:
      roco param set AGENT NAME 5
    """
    with problems(form):
        fleet = targets.find(target, run_dir)
        operator.order(fleet, agent, SetParameter(name, of(fleet, agent).read(name, value)))
        _tell(one_of(fleet, agent, name), form)


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


def _tell(one: Shown, form: Format) -> None:
    if form is Format.JSON:
        tell_json(one)
    else:
        print(worded(one.value))
