"""`python -m services.executor.conformance my_lab.robot:make`: whether a back-end does what the executor relies on.

Exit codes: 0 it conforms, 1 it does not, 2 there is no such back-end.
"""

from typing import Annotated

import msgspec
import typer

from services.executor.conformance import CHECKS, Result, Subject, Verdict, run
from services.executor.conformance.report import line, listed, page
from services.executor.loop.backends import SHORT, maker
from velma.errors import BackendError
from velma.model import scene

app = typer.Typer(add_completion=False, help=__doc__)


@app.command()
def main(
    backend: Annotated[
        str, typer.Argument(help=f"package.module:function that makes a back-end; {', '.join(SHORT)}")
    ] = "",
    paced: Annotated[bool, typer.Option("--paced", help="A robot in real time: a step every period.")] = False,
    gentle: Annotated[bool, typer.Option("--gentle", help="Leave out what pushes joints to their ends.")] = False,
    push: Annotated[float, typer.Option(help="Share of the accepted torque that moves a joint.")] = 0.1,
    only: Annotated[str, typer.Option(help="Names of checks, comma between; else all.")] = "",
    properties: Annotated[bool, typer.Option("--list", help="Print the properties, and try none.")] = False,
    form: Annotated[str, typer.Option("--format", help="text or json")] = "text",
) -> None:
    """Check a back-end against docs/back-ends.md."""
    if properties:
        typer.echo(listed(CHECKS))
        return
    try:
        make = maker(backend, scene.load())
        getattr(make(), "close", lambda: None)()  # what is no back-end is told once, and not by every check
    except BackendError as error:
        raise typer.BadParameter(str(error)) from None
    subject = Subject(make, paced=paced, gentle=gentle, push=push)
    asked = [name for name in only.split(",") if name]
    unknown = set(asked) - {check.name for check in CHECKS}
    if unknown:
        raise typer.BadParameter(f"no check {sorted(unknown)}; there are {', '.join(map(str, CHECKS))}")
    results: list[Result] = []
    for result in run(subject, [check for check in CHECKS if not asked or check.name in asked]):
        results.append(result)
        typer.echo(line(result), err=form == "json")
    typer.echo(msgspec.json.encode(results).decode() if form == "json" else "\n" + page(results))
    raise typer.Exit(any(result.verdict is Verdict.FAILED for result in results))


if __name__ == "__main__":
    app()
