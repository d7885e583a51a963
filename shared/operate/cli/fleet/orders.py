"""`roco agent pause|resume|log-level NAME`: orders to one agent while it runs."""

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from agent_runtime.core.control import Order, Pause, Resume, SetLevel
from agent_runtime.io.cli import Level
from operate.cli import completion
from operate.cli.fleet import operator, targets
from operate.cli.output import Form, Format, RunDir, problems, tell_json

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
