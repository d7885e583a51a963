"""`python -m operate.recording` records a fleet until SIGTERM; `python -m services.monitor report RUN_DIR` makes the
report of a run folder again, without any fleet; `python -m services.monitor observations RUN_DIR` prints what was said.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from agent_runtime.io import cli
from agent_runtime.io.logs import Log
from agent_runtime.io.options import USAGE_ERROR
from operate.experiments.verbs import again, compare, experiment, export, invariants
from operate.recording.recorder import serve
from operate.recording.stored import NoRecordingError
from operate.run_folder import TRAFFIC_FILE
from operate.system import NoSystemError, here, languages_at, of_design, of_run

TEXT = "The recorder: writes all traffic into traffic.mcap. `report RUN_DIR` makes the report of a run folder again."


def report(run_dir: Annotated[Path, typer.Argument(help="A run folder with traffic.mcap or steps/.")]) -> None:
    """Make report.json, report.html and run.rrd of a run folder again, from its recording and the agents' step logs."""
    if not run_dir.is_dir():
        typer.echo(f"{run_dir} is not a folder; give one that a run was recorded in", err=True)
        raise typer.Exit(USAGE_ERROR)
    from operate.reports import make

    raise typer.Exit(0 if make.everything(run_dir, of_run(run_dir), Log("monitor").write) else 1)


def observations(run_dir: Annotated[Path, typer.Argument(help="A run folder.", exists=True, file_okay=False)]) -> None:
    """Print what was said in a run folder, as JSON: who to whom, which act, how large, when."""
    from operate.recording import observations as told

    told.main(run_dir)


def judge(
    file: Annotated[Path, typer.Argument(help="A run folder, a traffic.mcap or a live.jsonl.")],
    design: Annotated[Path | None, typer.Option(help="Another system's design file.")] = None,
    languages: Annotated[
        str, typer.Option(help="Its Languages: package.module:NAME; else contents are not read.")
    ] = "",
) -> None:
    """Print the verdict about each communicate of a recording. Exits with 2 where there is nothing to judge."""
    from operate.judging import judged, rejudge

    system = of_run(file) if design is None else of_design(design)
    if languages:
        system = msgspec.structs.replace(system, languages=languages_at(languages))
    sys.stdout.buffer.writelines(map(judged.encoded, rejudge.judge(file, system)))


def said(
    file: Annotated[Path, typer.Argument(help="A run folder or a recording.")],
    everything: Annotated[bool, typer.Option("--everything", help="Receipts, heartbeats and telemetry, too.")] = False,
) -> None:
    """Print what a recording holds as samples of a tap, one JSON object a line. Exits with 2 where there is none."""
    from operate.recording import samples

    samples.main(file, of_run(file), everything=everything)


def dead(run_dir: Annotated[Path, typer.Argument(help="A run folder.", exists=True, file_okay=False)]) -> None:
    """Print the communicates of a run folder that nobody took, one JSON object a line."""
    from operate.recording import dead as letters

    for letter in letters.of_run(run_dir, of_run(run_dir)):
        sys.stdout.buffer.write(msgspec.json.encode(letter) + b"\n")


def trace(file: Annotated[Path, typer.Argument(help="A run folder or a recording.")]) -> None:
    """Print the trace of a run in JSON: conversations, and which was opened for the sake of which."""
    from operate.recording import traced

    sys.stdout.buffer.write(msgspec.json.encode(traced.of(file, of_run(file)).trace))


def why(
    file: Annotated[Path, typer.Argument(help="A run folder or a recording.")],
    about: Annotated[str, typer.Argument(help="A task, or a thing of the system; else the newest task.")] = "",
    at: Annotated[float | None, typer.Option("--at", help="As it was then [s after the first communicate].")] = None,
) -> None:
    """Print the reasons that are recorded, in JSON. Exits with 2 where nothing is known of what was asked about."""
    from operate.recording import reasons

    try:
        found = reasons.of(file, of_run(file), about, at)
    except reasons.NothingKnown as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(USAGE_ERROR) from error
    sys.stdout.buffer.write(msgspec.json.encode(found))


def info(file: Annotated[Path, typer.Argument(help="A run folder or a recording.")]) -> None:
    """Print what is in a recording: topics, keys, counts, times, versions. Exits with 2 where there is none."""
    from operate.recording import contents

    contents.main(file)


def repair(file: Annotated[Path, typer.Argument(help="A run folder or a recording.")]) -> None:
    """Give a recording its index, and print what was done. Exits with 2 where there is none, or one is being made."""
    from agent_runtime.io.full_disk import worded
    from operate.recording import index

    path = file / TRAFFIC_FILE if file.is_dir() else file
    try:
        sys.stdout.buffer.write(msgspec.json.encode(index.repaired(path)) + b"\n")
    except OSError as error:
        typer.echo(worded(path, error), err=True)
        raise typer.Exit(1) from error


def record(
    out: Annotated[Path, typer.Argument(help="The recording to be made.")],
    which: Annotated[str, typer.Option(help="An operate.filters.Filter, in JSON.")] = "{}",
    count: Annotated[int, typer.Option(help="End after this many communicates.")] = 0,
    seconds: Annotated[float, typer.Option(help="End after so long.")] = 0.0,
) -> None:
    """Record what `hear` prints, from standard input, until it ends or SIGINT."""
    from operate.filters import Filter
    from operate.recording import side_recording

    asked = side_recording.Asked(out, msgspec.json.decode(which, type=Filter), count, seconds)
    side_recording.serve(here(), asked)


def replayed(folder: Annotated[Path, typer.Argument(help="The folder of a replay.")]) -> None:
    """Write live.jsonl of what is replayed: samples on standard input, one JSON object a line."""
    from operate.recording import replayed as lines

    lines.write(folder, here())


VERBS: dict[str, Callable[..., None]] = {
    "report": report,
    "judge": judge,
    "observations": observations,
    "said": said,
    "dead": dead,
    "info": info,
    "repair": repair,
    "trace": trace,
    "why": why,
    "record": record,
    "replayed": replayed,
    "again": again,
    "export": export,
    "compare": compare,
    "invariants": invariants,
    "experiment": experiment,
}


def main() -> None:
    """Do what the command line says; ends the process."""
    if sys.argv[1:2] == ["hear"]:
        from operate.recording import hear

        cli.app("monitor hear", str(hear.__doc__), lambda options: hear.serve(options, here()))(sys.argv[2:])
    elif sys.argv[1:2] and sys.argv[1] in VERBS:
        app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        app.command()(VERBS[sys.argv[1]])
        try:
            app(sys.argv[2:], prog_name=f"monitor {sys.argv[1]}")
        except (NoRecordingError, NoSystemError) as error:
            typer.echo(str(error), err=True)
            sys.exit(USAGE_ERROR)
    else:
        cli.run("monitor", TEXT, lambda options: serve(options, here()))


if __name__ == "__main__":
    main()
