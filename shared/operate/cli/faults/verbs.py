"""`roco fault KIND PROCESS`, `list`, `heal`: faults done on purpose, recorded, healed at the end.

A verb for each kind, with the options that its row in operate.cli.faults.kinds has.
"""

from collections.abc import Callable
from datetime import datetime
from functools import partial
from inspect import Parameter, Signature
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

from operate.cli import completion, interrupts
from operate.cli.faults import inflict, moments
from operate.cli.faults.kinds import KINDS, Amount
from operate.cli.fleet import living_names, targets
from operate.cli.output import Form, Format, Reply, RunDir, problems, tell, tell_json, tell_problem
from operate.cli.terminal.console import Console
from operate.cli.terminal.table import table
from operate.fault_lines import latest, read
from operate.run_folder import Fault

Process = Annotated[str, typer.Argument(metavar="PROCESS", help="A process.", autocompletion=living_names.processes)]
At = Annotated[
    str,
    typer.Option(
        "--at",
        metavar="MOMENT",
        help="When it begins: seconds from now, a state (STATE or AGENT:STATE), the Nth message of the process "
        "(3rd-message), or words that the run tells (told:WORDS); else at once.",
        autocompletion=completion.moments,
    ),
]
Within = Annotated[float, typer.Option("--within", min=0.1, help="The moment is waited for so long [s].")]
For = Annotated[float, typer.Option("--for", min=0.0, help="How long it lasts [s]; then it is healed.")]
Speaker = Annotated[
    str,
    typer.Option("--as", metavar="NAME", help="Who floods: the operator, or a peer.", autocompletion=completion.agents),
]
HEADS = ("begun", "fault", "lasted", "what came of it")
WITHIN_S = 300.0
"""Estimate: longer than a pour on a loaded machine."""
EMPTY = Parameter.empty


class Faults(msgspec.Struct, frozen=True):
    """`roco fault list --format json`. `healed`: those whose command was gone, just now."""

    where: str
    faults: tuple[Fault, ...]
    healed: tuple[Fault, ...]


def verb(kind: str, text: str) -> Callable[..., None]:
    """Return the verb of a kind of faults, with the options that its row has; `text`: its docstring."""
    row = KINDS[kind]
    whole = {
        "process": (Process, EMPTY),
        "amount": (
            _amount(row.amount),
            EMPTY if row.amount is None or row.amount.default is None else row.amount.default,
        ),
        "speaker": (Speaker, ""),
        "at": (At, ""),
        "for_": (For, row.for_s),
        "within": (Within, WITHIN_S),
        "target": (targets.Name, ""),
        "run_dir": (RunDir, None),
        "form": (Form, Format.TEXT),
    }
    without = {"amount": row.amount is None, "speaker": not row.speaker, "for_": row.for_s is None}
    given = {name: one for name, one in whole.items() if not without.get(name)}

    def do(**told: Any) -> None:
        for_s = told.get("for_") or 0.0
        asked = Asked(row.timed if row.timed and for_s else kind, told["process"], told["at"], for_s, told["within"])
        more = {name: told[name] for name in ("amount", "speaker") if name in told}
        inflicted(msgspec.structs.replace(asked, **more), told["target"], told["run_dir"], told["form"])

    do.__doc__, do.__name__ = text, kind
    do.__annotations__ = {}
    parameters = [
        Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
        for name, (annotation, default) in given.items()
    ]
    do.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    return do


def _amount(row: Amount | None) -> Any:
    """Return the type of a kind's amount as typer reads it."""
    if row is None:
        return None
    shown: dict[str, Any] = {"metavar": row.metavar, "help": row.text, "min": row.least, "max": row.most}
    return Annotated[float, typer.Option(row.option, **shown) if row.option else typer.Argument(**shown)]


kill = verb(
    "kill",
    """Kill a process (SIGKILL), and wait until it is back; with --for it is kept down so long.

    Examples:
      roco fault kill AGENT
      roco fault kill AGENT --at 10th-message
      roco fault kill router --for 5
    """,
)
hang = verb(
    "hang",
    """Let a process hang (SIGSTOP) until somebody ends it: who supervises it, `roco fault heal`, or the time --for.

    Examples:
      roco fault hang AGENT
      roco fault hang monitor --for 10
    """,
)
pause = verb(
    "pause",
    """Give a process no processor for a time (SIGSTOP, then SIGCONT).

    Examples:
      roco fault pause AGENT --for 1.5
      roco fault pause router --for 3 --at 20
    """,
)
restart = verb(
    "restart",
    """End a process in order (SIGTERM) in the middle of its work, and wait until it is back.

    Examples:
      roco fault restart AGENT
      roco fault restart AGENT --at 3rd-message
    """,
)
cut = verb(
    "cut",
    """Cut the wires of an agent, as if its plug were pulled; a router: all to it; AGENT-PEER: the link of the two.

    Examples:
      roco fault cut AGENT
      roco fault cut AGENT-PEER
      roco fault cut AGENT --for 1 --at 5th-message
    """,
)
delay = verb(
    "delay",
    """Delay what passes the wires of an agent, each way.

    Examples:
      roco fault delay AGENT 0.2
    """,
)
loss = verb(
    "loss",
    """Lose a share of what passes the wires of an agent; TCP sends it again, later.

    Examples:
      roco fault loss AGENT 0.05 --for 10
    """,
)
rate = verb(
    "rate",
    """Bound the rate of the wires of an agent.

    Examples:
      roco fault rate AGENT 20000
    """,
)
corrupt = verb(
    "corrupt",
    """Turn over a bit in a share of what passes the wires of an agent.

    Examples:
      roco fault corrupt AGENT 0.01
    """,
)
disk_full = verb(
    "disk-full",
    """Let what a process writes to files fail, as if its disk were full (EFBIG), until it ends or the time is over.

    Examples:
      roco fault disk-full AGENT
      roco fault disk-full monitor --for 10
    """,
)
flood = verb(
    "flood",
    """Flood an agent with orders of the operator, or with copies of what another agent says to it (--as).

    Examples:
      roco fault flood AGENT
      roco fault flood AGENT --as PEER --per-second 2000 --for 10
    """,
)
clock = verb(
    "clock",
    """Step the wall clock of an agent; its monotonic clock goes on as it was.

    Examples:
      roco fault clock AGENT -3600
      roco fault clock AGENT 60 --for 30
    """,
)


class Asked(msgspec.Struct, frozen=True):
    """A fault as it is asked for: `at` as --at has it, `for_s` and `within_s` [s]."""

    kind: str
    process: str
    at: str
    for_s: float
    within_s: float
    amount: float = 0.0
    speaker: str = ""


def inflicted(asked: Asked, target: str, run_dir: Path | None, form: Format) -> None:
    """Do a fault from its order to its end, and tell what came of it."""
    with problems(form), interrupts.heard():
        fleet = targets.find(target, run_dir)
        inflict.refuse(fleet)
        moment = moments.parse(asked.at, fleet.system.design, asked.process)
        heal_left(fleet, form)
        at = moments.words(moment)
        fault = inflict.planned(fleet, asked.kind, asked.process, at, asked.amount, asked.speaker)
        wait = partial(moments.wait, moment, asked.within_s, target, run_dir)
        ended = inflict.Inflicting(fleet, fault).run(wait, asked.for_s, partial(_tell_begun, form))
        if form is Format.JSON:
            tell_json(ended)
        else:
            print(f"{ended.words}: {ended.text}, {lasted(ended):.1f} s")


def heal_left(fleet: targets.Target, form: Format) -> None:
    """Heal the faults whose command is gone, and tell of each."""
    for one in inflict.heal(fleet, inflict.left(fleet)):
        tell_problem(f"{one.words}: its command was gone; healed", form)


def _tell_begun(form: Format, words: str) -> None:
    if form is Format.TEXT:
        print(words)


def list_(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """List the faults of a run; those whose command was killed are healed first.

    Examples:
      roco fault list
      roco fault list --format json
    """
    with problems(form):
        fleet = targets.find(target, run_dir)
        healed = inflict.heal(fleet, inflict.left(fleet))
        every = latest(read(fleet.faults()))
        if form is Format.JSON:
            tell_json(Faults(fleet.where, every, tuple(healed)))
        elif every:
            Console().print(table(HEADS, map(_row, every), fold=HEADS))
        else:
            print(f"no fault was done to {fleet.where}")


def heal(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Heal all faults that go on, also those of commands that run.

    Examples:
      roco fault heal
    """
    with problems(form):
        fleet = targets.find(target, run_dir)
        healed = inflict.heal(fleet, inflict.open_faults(fleet))
        words = "\n".join(f"{one.words}: healed" for one in healed) or "no fault goes on"
        tell(Reply(words, fleet.where), form)


def lasted(fault: Fault) -> float:
    """Return how long a fault lasted [s]; so far, where it goes on."""
    return (fault.ended or fault.t) - fault.began if fault.began else 0.0


def _row(one: Fault) -> tuple[str, ...]:
    began = f"{datetime.fromtimestamp(one.began):%H:%M:%S}" if one.began else "–"
    now = one.text or ("goes on" if one.began else "waits for its moment")
    return began, one.words, f"{lasted(one):.1f} s" if one.ended else "", now
