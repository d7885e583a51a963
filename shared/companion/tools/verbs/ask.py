"""`roco ask`: a question in SPARQL to what km knows, or knew at a time of a recorded run. A process
answers it that can be ended.
"""

import signal
import subprocess
import sys
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from companion.asking import (
    ANSWERER,
    PREFIXES,
    Answer,
    Heard,
    Question,
    Refused,
    Rows,
    Term,
    Triple,
    Verdict,
)
from companion.design import AgentName
from companion.tools.system import SYSTEM
from console.errors import NO, ConsoleError, MissingExtraError, NoRunError, UsageError, needing
from console.fleet import targets
from console.output import Format, RunDir, problems
from console.traffic.listen import Recorded, recording_of

if TYPE_CHECKING:
    from operate.recording.run import Run

READING_S = 60.0
"""For the start of the process and the making of the triples, beside the query's own time;
estimate, with room.
"""


class AskError(ConsoleError):
    """A question was not answered: it took too long or too much memory."""


class Known(msgspec.Struct, frozen=True):
    """Messages to and from km until a time. `begin`: of the run [unix s]; `words`: what was asked,
    for people.
    """

    heard: tuple[Heard, ...]
    begin: float
    words: str


def known(place: "Path | Run", at: float | None = None) -> Known:
    """The knowledge of km from a run folder or a recording, now or `at` seconds after its first
    communicate.
    """
    with needing("monitor"):
        from operate.recording.records import Spoken, Token
        from operate.recording.run import opened
    run = opened(place, SYSTEM) if isinstance(place, Path) else place
    spoken = [one for one in run.talk_records if isinstance(one, Spoken)]
    if not spoken:
        raise NoRunError(
            str(run.place),
            f"{run.place} has no communicate; give a run folder, or a recording of `roco record`",
        )
    lives = dict[int, float]()
    for one in run.talk_records:
        if isinstance(one, Token) and one.agent == AgentName.KM and one.alive:
            lives.setdefault(one.incarnation, one.received)
    begin, end = spoken[0].received, spoken[-1].received
    until = end if at is None else begin + at
    heard = [
        Heard(one.received, one.wire)
        for one in spoken
        if AgentName.KM in (one.sender, one.receiver)
    ]
    heard += [Heard(when) for when in lives.values()]
    kept = tuple(sorted((one for one in heard if one.at <= until), key=lambda one: one.at))
    end_s = end - begin
    when = f"{end_s:.1f} s, the last communicate" if at is None else f"{at:g} of {end_s:.1f} s"
    return Known(kept, begin, f"as km knew it at {when}")


def answered(question: Question) -> Answer:
    """The answer. Raise AskError where there is none in time."""
    command = [sys.executable, "-P", "-m", ANSWERER]
    try:
        longest, data = question.seconds + READING_S, msgspec.msgpack.encode(question)
        done = subprocess.run(
            command, input=data, capture_output=True, timeout=longest, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise AskError(
            f"reading what km was told took more than {READING_S:.0f} s; ask of an earlier --at"
        ) from error
    if done.returncode == -signal.SIGALRM:
        raise AskError(
            f"the query was ended after {question.seconds:g} s; bind more of its variables, or give"
            " --seconds more"
        )
    if done.returncode:
        raise _ended(done.returncode, done.stderr.decode(errors="replace").strip())
    told: Answer = msgspec.msgpack.decode(done.stdout, type=Answer)
    return told


def _ended(code: int, said: str) -> ConsoleError:
    last = said.splitlines()[-1] if said else f"it ended with {code}"
    if "ModuleNotFoundError" in last:
        return MissingExtraError(last.rpartition("'")[0].rpartition("'")[2], "knowledge")
    if code == -signal.SIGABRT or "MemoryError" in last:
        return AskError(
            "the query needs too much memory; bind more of its variables, or sort and group less"
        )
    return AskError(f"the process that answers has died: {last}")


def short(term: Term) -> str:
    """A value for people: an IRI with its prefix, as it may be written in a question."""
    return written(term, _prefixed)


def written(term: Term, iri: Callable[[str], str] = str) -> str:
    """A value in one line; `iri` writes an IRI."""
    match term.value:
        case Triple(subject, predicate, about):
            return f"<<( {' '.join(written(one, iri) for one in (subject, predicate, about))} )>>"
        case value if term.type == "uri":
            return iri(value)
        case value:
            return f"_:{value}" if term.type == "bnode" else value


def _prefixed(iri: str) -> str:
    for prefix, space in PREFIXES.items():
        if iri.startswith(space):
            return f"{prefix}:{iri.removeprefix(space).replace('/', chr(92) + '/')}"
    return f"<{iri}>"


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
        typer.Option(
            "--at", min=0.0, help="As km knew it that many seconds after the first communicate."
        ),
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

    It asks the running fleet, or a recording at any time.

    These prefixes are known: roco (terms of the ontology), thing, content, model, grasp, agent,
    said, state; rdf, rdfs, owl, xsd, dul, soma, cora, pos. The query cannot change anything. Exits
    with 1 if the answer to ASK is no.

    Examples:
      roco ask 'SELECT ?thing ?where WHERE { ?thing roco:isIn ?where }'
      roco ask 'ASK { thing:jar_1 roco:isGraspedBy ?hand }' --run runs/latest --at 30
      roco ask 'SELECT ?p ?o WHERE { thing:jar_1 ?p ?o }' --format csv
    """
    with problems(Format.JSON if form is As.JSON else Format.TEXT):
        knowledge = known(recording_of(run, target, run_dir), at)
        text = sys.stdin.read() if question == "-" else question
        told = answered(Question(text, knowledge.heard, knowledge.begin, seconds, rows))
        if isinstance(told, Refused):
            raise UsageError(told.why)
    _show(told, form, knowledge)
    if isinstance(told, Rows) and told.cut and form is As.CSV:
        print(f"roco: only the first {rows} rows are shown; --rows gives more", file=sys.stderr)
    if told == Verdict(False):
        raise typer.Exit(NO)


def _show(told: Rows | Verdict, form: As, known: Known) -> None:
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
    writer.writerows(["" if term is None else written(term) for term in row] for row in told.rows)


def _print_table(told: Rows, known: Known) -> None:
    from rich.table import Table
    from rich.text import Text

    from console.terminal.console import Console

    table = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
    for name in told.columns:
        table.add_column(name, overflow="fold")
    for row in told.rows:
        table.add_row(*(Text("" if term is None else short(term)) for term in row))
    console = Console()
    console.print(table)
    rows, more = len(told.rows), ", and there are more (--rows)" * told.cut
    count = f"{rows} row{'s' * (rows != 1)}{more}"
    console.print(f"{count}; {known.words}", style="dim", highlight=False)
