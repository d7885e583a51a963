"""`roco traffic dead`: the communicates of a run that nobody took, and why."""

from datetime import datetime
from pathlib import Path

from rich.text import Text

from console.errors import UsageError
from console.fleet import targets
from console.fleet.local import Local
from console.output import Form, Format, RunDir, problems, tell
from console.terminal.console import Console
from console.terminal.table import table
from console.traffic.listen import about
from console.traffic.selection import Agents, Recorded, wanted
from operate.verdict_lines import DeadLetter


def dead(
    agent: Agents = None,
    run: Recorded = None,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """List the communicates that nobody took, and why.

    Of a running fleet so far, also from before restarts; what is on its way for less than 5 s is
    left out. Of a run that has ended by its folder: recording, step logs, agents' logs and
    journals.

    Examples:
      roco traffic dead
      roco traffic dead --run runs/latest --agent AGENT
      roco traffic dead --run runs/latest --format json
    """
    with problems(form):
        which = wanted(about(run, run_dir, target).design, None, agent, None, None).agents
        from operate.recording import dead
        from operate.recording.run import Run

        found = dead.letters(Run(_folder(run, run_dir, target)))
    letters = [one for one in found if not which or {one.sender, one.receiver} & {*which}]
    tell(letters, form, lambda: _show(letters, Console(highlight=False)))


def _show(letters: list[DeadLetter], console: Console) -> None:
    heads = ("at", "reason", "from > to", "act", "protocol", "id", "why")
    drawn = table(heads, fold=("why",))
    for one in letters:
        at = datetime.fromtimestamp(one.t).strftime("%H:%M:%S.%f")[:-3]
        both = one.sender or one.receiver
        who = f"{one.sender or '?'} > {one.receiver or '?'}" if both else one.key
        act = (one.performative, one.protocol, one.id)
        drawn.add_row(at, Text(one.reason, "red"), who, *act, Text(one.why))
    if letters:
        console.print(drawn)
    console.print(f"{len(letters)} dead letter{'s' * (len(letters) != 1)}", style="dim")


def _folder(run: Path | None, run_dir: Path | None, target: str) -> Path:
    """The run folder that is meant. Raises UsageError where there is none here."""
    if run is not None:
        if not run.is_dir():
            raise UsageError(
                f"{run} is no run folder; a recording alone does not tell what was taken"
            )
        return run
    fleet = targets.find(target, run_dir)
    if not isinstance(fleet, Local):
        raise UsageError(
            "the folder of a fleet in containers is in its volumes; copy it, and name it with --run"
        )
    return fleet.run
