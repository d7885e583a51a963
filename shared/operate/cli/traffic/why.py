"""`roco why`: the recorded reasons of a task, or of what is believed of a thing."""

from typing import Annotated

from rich.text import Text

from operate.cli.fleet import targets
from operate.cli.output import Form, Format, RunDir, option, problems, tell, waiting
from operate.cli.terminal.console import Console
from operate.cli.traffic.selection import Recorded, Subject, recording_of
from operate.tracing.reasons import Fact, Why

TIME = 9
"""Columns of the time."""


def why(
    subject: Subject = "",
    run: Recorded = None,
    at: Annotated[
        float | None,
        option(
            "Of a thing: as it was believed then [s after the first communicate].", "--at", min=0.0
        ),
    ] = None,
    records: Annotated[
        bool, option("Also the communicate or step that each sentence is from.", "--records")
    ] = False,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Say why a task went as it did, from what is recorded.

    It says how it ended and what led to that, why it waited, which plans were made and what was
    rejected, and who was away. Without a subject it is the newest task. The subject may also be a
    thing that the system knows: then it says what is believed, since when, and by which
    observation. Each sentence repeats something that was said or done and recorded; what is not
    recorded is not told. Seconds count from the first communicate.

    Examples:
      roco why
      roco why SUBJECT --run runs/latest
      roco why THING --at 30
      roco why SUBJECT --records
    """
    with problems(form):
        from operate.recording import reasons
        from operate.recording.run import opened

        file = recording_of(run, target, run_dir)
        with waiting("reading the recording …", form):
            found = reasons.of(opened(file), subject, at)
        tell(found, form, lambda: _show(found, Console(), records=records))


def _show(found: Why, console: Console, *, records: bool) -> None:
    console.print(Text.assemble((found.about, "bold"), "  ", found.text), soft_wrap=False)
    for passage in found.passages:
        console.print(Text(f"\n{passage.title}", "bold"))
        for n, fact in enumerate(passage.facts):
            same = n > 0 and f"{fact.at:.2f}" == f"{passage.facts[n - 1].at:.2f}"
            _tell(fact, found.begin, console, repeated=same)
            if records and fact.record:
                console.print(Text(f"{'':{TIME + 2}}[{fact.record}]", "dim"), soft_wrap=True)


def _tell(fact: Fact, begin: float, console: Console, *, repeated: bool) -> None:
    """Print a sentence beside its time; the lines below it are indented likewise."""
    when = "" if repeated else f"{fact.at - begin:.2f} s"
    lines = Text(fact.text).wrap(console, max(20, console.width - TIME - 2))
    for n, line in enumerate(lines):
        console.print(
            Text.assemble((f"{when if not n else '':>{TIME}}  ", "dim"), line), soft_wrap=True
        )
