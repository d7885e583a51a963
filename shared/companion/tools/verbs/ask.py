"""`roco ask`: a question in SPARQL to what km knows, or knew at a time of a recorded run."""

import sys
from enum import StrEnum
from typing import Annotated

import msgspec
import typer

from companion.asking import Question, Refused, Rows, Verdict
from companion.tools import asking
from console.errors import NO, UsageError
from console.fleet import targets
from console.output import Format, RunDir, problems
from console.traffic.listen import Recorded, recording_of


class As(StrEnum):
    """Format of printed rows: csv and json as the W3C writes results of SPARQL."""

    TEXT = "text"
    JSON = "json"
    CSV = "csv"


def ask(
    question: Annotated[
        str, typer.Argument(help="SELECT or ASK, in quotes; - reads it from standard input.")
    ],
    run: Recorded = None,
    at: Annotated[
        float | None,
        typer.Option("--at", min=0.0, help="As km knew it then [s after the first communicate]."),
    ] = None,
    rows: Annotated[int, typer.Option("--rows", min=1, help="Rows shown at most.")] = 1000,
    seconds: Annotated[
        float, typer.Option("--seconds", min=0.001, max=600.0, help="The query is ended then.")
    ] = 5.0,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Annotated[
        As, typer.Option("--format", help="text for people, json or csv for programs.")
    ] = As.TEXT,
) -> None:
    """Ask what the robot knows, in SPARQL.

    It is asked of the running fleet, or of a recording at any time.

    Prefixes are filled in: roco (terms of the ontology), thing, content, model, grasp, agent, said,
    state; rdf, rdfs, owl, xsd, dul, soma, cora, pos. Nothing can be changed. Exits with 1 where ASK
    is answered with no.

    Examples:
      roco ask 'SELECT ?thing ?where WHERE { ?thing roco:isIn ?where }'
      roco ask 'ASK { thing:jar_1 roco:isGraspedBy ?hand }' --run runs/latest --at 30
      roco ask 'SELECT ?p ?o WHERE { thing:jar_1 ?p ?o }' --format csv
    """
    with problems(Format.JSON if form is As.JSON else Format.TEXT):
        known = asking.known(recording_of(run, target, run_dir), at)
        text = sys.stdin.read() if question == "-" else question
        told = asking.answered(Question(text, known.heard, known.begin, seconds, rows))
        if isinstance(told, Refused):
            raise UsageError(told.why)
    _show(told, form, known)
    if isinstance(told, Rows) and told.cut and form is As.CSV:
        print(f"roco: only the first {rows} rows are shown; --rows gives more", file=sys.stderr)
    if told == Verdict(False):
        raise typer.Exit(NO)


def _show(told: Rows | Verdict, form: As, known: asking.Known) -> None:
    match told, form:
        case Verdict(holds=holds), As.JSON:
            print(msgspec.json.encode({"head": {}, "boolean": holds}).decode())
        case Verdict(holds=holds), As.CSV:
            print("true" if holds else "false")
        case Verdict(holds=holds), _:
            print(f"{'yes' if holds else 'no'}; {known.words}")
        case Rows(), As.JSON:
            print(as_json(told))
        case Rows(), As.CSV:
            _print_csv(told)
        case Rows(), _:
            _print_table(told, known)


def as_json(told: Rows) -> str:
    """As "SPARQL 1.2 Query Results JSON Format" has it; `cut` besides says that there are more
    rows.
    """
    bindings = [
        {name: term for name, term in zip(told.columns, row, strict=True) if term}
        for row in told.rows
    ]
    whole = {"head": {"vars": told.columns}, "results": {"bindings": bindings}, "cut": told.cut}
    return msgspec.json.encode(whole).decode()


def _print_csv(told: Rows) -> None:
    """As "SPARQL 1.1 Query Results CSV" has it: values only."""
    import csv

    writer = csv.writer(sys.stdout)
    writer.writerow(told.columns)
    writer.writerows(
        ["" if term is None else asking.written(term) for term in row] for row in told.rows
    )


def _print_table(told: Rows, known: asking.Known) -> None:
    from rich.table import Table
    from rich.text import Text

    from console.terminal.console import Console

    table = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
    for name in told.columns:
        table.add_column(name, overflow="fold")
    for row in told.rows:
        table.add_row(*(Text("" if term is None else asking.short(term)) for term in row))
    console = Console()
    console.print(table)
    rows, more = len(told.rows), ", and there are more (--rows)" * told.cut
    count = f"{rows} row{'s' * (rows != 1)}{more}"
    console.print(f"{count}; {known.words}", style="dim", highlight=False)
