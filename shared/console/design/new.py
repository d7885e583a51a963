"""`roco design new`: a project made from a design file, or the smallest one to begin with."""

from pathlib import Path
from typing import Annotated

from console.design import files
from console.errors import NO
from console.output import Form, Format, argument, option, tell
from topdown.model.loading import text_of
from topdown.scaffold import Outcome, scaffold, smallest


def new(
    folder: Annotated[Path, argument("The project's folder; made where missing.")],
    name: Annotated[
        str, option("Name of package and system; else the design's, or the folder's.")
    ] = "",
    source: Annotated[
        Path | None,
        option(
            "A design file; else the smallest system begins.", "--from", exists=True, dir_okay=False
        ),
    ] = None,
    form: Form = Format.TEXT,
) -> None:
    """Make a project of a design: packages, typed interfaces, stubs, tests, processes, compose
    entries.

    Run it again after a change of the design: a file that you changed is kept, and the names it
    lacks are told.

    Examples:
      roco design new lamp
      roco design new robot --from design.toml
    """
    with files.problems(form, NO):
        if source is not None:
            outcome = scaffold(text_of(source), folder, name, str(source))
        else:
            package = name or folder.resolve().name
            outcome = scaffold(smallest(package), folder, package)
    tell(outcome, form, "\n".join(_outcome_lines(outcome)))


def _outcome_lines(outcome: Outcome) -> list[str]:
    """The outcome in words for people."""
    lines = [
        f"{outcome.folder}: {len(outcome.written)} files written, {len(outcome.same)} as they were"
    ]
    lines += [f"  {path}" for path in outcome.written]
    for kept in outcome.kept:
        lacks = f"; nothing of yours mentions {', '.join(kept.missing)} yet" if kept.missing else ""
        lines.append(f"  kept {kept.path}, which you changed{lacks}")
    lines += [f"  left {path}, which the design no longer makes" for path in outcome.left]
    return lines
