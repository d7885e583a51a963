"""`roco traffic judge`: is everything that was said as designed? Afterwards, from a recording."""

from collections import Counter
from datetime import datetime
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from rich.table import Table
from rich.text import Text

from console import completion
from console.errors import UsageError
from console.fleet import targets
from console.fleet.local import Local
from console.output import Form, Format, RunDir, argument, option, tell
from console.runs.folders import judged
from console.terminal.console import Console, table
from console.traffic.listen import Agents, Recorded, about, wanted
from operate import verdict_lines
from operate.system import languages_at, of_design, of_run
from operate.verdict_lines import DeadLetter, Judged
from topdown.judge.verdicts import VIOLATIONS, Verdict

MOST = 40
"""Violations shown at most; a person reads no more (estimate). `--format json` has all."""


class Judgements(msgspec.Struct, frozen=True):
    """`roco traffic judge --format json`: how often each verdict by channel, and all that is
    against the design.

    `since`: when the first was said [unix s].
    """

    communicates: int
    since: float
    channels: dict[str, dict[str, int]]
    violations: tuple[Judged, ...]


def judge(
    file: Annotated[
        Path, argument("A run folder, a traffic.mcap or a live.jsonl.", complete=completion.runs)
    ],
    design: Annotated[
        Path | None, option("Another system's design file; else this system's.")
    ] = None,
    languages: Annotated[
        str,
        option("That system's Languages, as package.module:NAME; else its contents are not read."),
    ] = "",
    form: Form = Format.TEXT,
) -> None:
    """Judge every communicate of a recording by the design. Exits with 1 where something is against
    it, with 2 where there is nothing to judge.

    A run folder is judged by the step logs of its agents: also what was said while no recorder
    lived.

    Examples:
      roco traffic judge runs/latest
      roco traffic judge runs/latest/traffic.mcap --format json
    """
    system = of_run(file) if design is None else of_design(design)
    if languages:
        system = msgspec.structs.replace(system, languages=languages_at(languages))
    lines = judged(file, system)
    if not lines:
        raise UsageError(
            f"{file} has no communicates to judge; give a recording in which agents spoke"
        )
    found = summary(lines)
    tell(found, form, lambda: show(found, Console()))
    raise typer.Exit(1 if found.violations else 0)


def summary(lines: list[Judged]) -> Judgements:
    """Return the totals of the lines. A communicate with two verdicts counts once."""
    counted: dict[str, Counter[str]] = {}
    for one in lines:
        counted.setdefault(one.channel or "none", Counter())[one.verdict] += 1
    heard = {(one.t, one.sender, one.receiver, one.id) for one in lines}
    channels = {
        name: {str(v): row[v] for v in Verdict if row[v]} for name, row in sorted(counted.items())
    }
    since = min((one.t for one in lines), default=0.0)
    return Judgements(len(heard), since, channels, tuple(one for one in lines if one.violation))


def show(found: Judgements, console: Console) -> None:
    """For people: channels by verdicts, then each violation."""
    console.print(counts(found))
    for one in found.violations[:MOST]:
        console.print(violation(one, found.since))
    if len(found.violations) > MOST:
        console.print(
            f"and {len(found.violations) - MOST} more: --format json has them all", style="dim"
        )
    console.print(sentence(found))


def counts(found: Judgements) -> Table:
    """Return the number of each verdict on each channel; verdicts that never occurred are left
    out.
    """
    channels = (*found.channels, "in all")
    drawn = table(("", *channels), right=channels, fold=("",), header_style="bold")
    for verdict in Verdict:
        row = [counted.get(verdict, 0) for counted in found.channels.values()]
        if any(row):
            cells = [str(count) if count else "·" for count in (*row, sum(row))]
            drawn.add_row(verdict, *cells, style="red" if verdict in VIOLATIONS else "")
    return drawn


def violation(one: Judged, begin: float) -> Text:
    """Return a violation for people: the communicate, its time, the fault and the reason."""
    what, where = f"{one.bytes} bytes on {one.key}", ""
    if one.sender:
        what = f"{one.sender} > {one.receiver} {one.performative}"
        where = f"id {one.id or 'none'}, conversation {one.conversation or 'none'}, "
    text = Text.assemble((f"\n{one.verdict}", "bold red"), f"  {one.channel}  {what}  ")
    return text.append(f"{where}+{one.t - begin:.2f}\u00a0s", "dim").append(f"\n  {one.why}")


def sentence(found: Judgements) -> Text:
    """Return whether all is as designed."""
    if found.violations:
        count = len(found.violations)
        wrong = (
            f"{count} violation{'s' * (count != 1)} of the design among {found.communicates}"
            " communicates"
        )
        return Text(f"\n{wrong}; + counts from the first communicate", "bold red")
    verdicts: Counter[str] = Counter()
    for row in found.channels.values():
        verdicts.update(row)
    text = verdict_lines.outcome(verdicts)
    return Text(f"\n{text}", "green" if text.startswith("all") else "")


# --- `roco traffic dead`: the communicates that nobody took, and why ------------------------------


def dead_(
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
    which = wanted(about(run, run_dir, target).design, None, agent, None, None).agents
    from operate.recording import dead as dead_letters
    from operate.recording.run import Run

    found = dead_letters.letters(Run(_folder(run, run_dir, target)))
    letters = [one for one in found if not which or {one.sender, one.receiver} & {*which}]
    tell(letters, form, lambda: show_letters(letters, Console(highlight=False)))


def show_letters(letters: list[DeadLetter], console: Console) -> None:
    drawn = table(("at", "dead letter"), fold=("dead letter",))
    for one in letters:
        at = datetime.fromtimestamp(one.t).strftime("%H:%M:%S.%f")[:-3]
        both = one.sender or one.receiver
        who = f"{one.sender or '?'} > {one.receiver or '?'}" if both else one.key
        act = " ".join(filter(None, (one.protocol, one.performative, one.id)))
        # the reason has lines of its own: beside six columns 80 letters leave it one each
        drawn.add_row(at, Text.assemble((one.reason, "red"), f"  {who}  {act}\n{one.why}"))
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
