"""`python -m services.executor.conformance my_lab.robot:make`: does this back-end do what the executor leans on?

Exit codes: 0 it conforms, 1 it does not, 2 there is no such back-end.
"""

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from services.executor.conformance import CHECKS, Result, Subject, Verdict, run
from services.executor.conformance.report import line, listed, page
from velma.sim.backend import Backend

app = typer.Typer(add_completion=False, help=__doc__)


def found(name: str) -> Callable[[], Backend]:
    """The function of `package.module:function`. typer.BadParameter says what is missing."""
    module, _, function = name.partition(":")
    sys.path.insert(0, str(Path.cwd()))
    try:
        make = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError, ValueError) as error:
        raise typer.BadParameter(f"{error}; give package.module:function, a function that makes a back-end") from None
    if not callable(make):
        raise typer.BadParameter(f"{name} is {type(make).__name__}; give a function that makes a back-end")
    return make  # type: ignore[no-any-return]


@app.command()
def main(
    backend: Annotated[str, typer.Argument(help="package.module:function that makes a back-end")] = "",
    paced: Annotated[bool, typer.Option("--paced", help="A robot in real time: a step every period.")] = False,
    gentle: Annotated[bool, typer.Option("--gentle", help="Leave out what pushes joints to their ends.")] = False,
    push: Annotated[float, typer.Option(help="Share of the accepted torque that moves a joint.")] = 0.1,
    only: Annotated[str, typer.Option(help="Names of checks, comma between; else all.")] = "",
    properties: Annotated[bool, typer.Option("--list", help="Print the properties, and try none.")] = False,
    form: Annotated[str, typer.Option("--format", help="text or json")] = "text",
) -> None:
    """Hold a back-end to docs/back-ends.md."""
    if properties:
        typer.echo(listed(CHECKS))
        return
    subject = Subject(found(backend), paced=paced, gentle=gentle, push=push)
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
