"""`roco design check`: every fault of a design by name, with its place; with a recording also what the run shows.

Exit codes: 0 no findings, 1 findings, 2 a file cannot be read.
"""

import textwrap
from collections import Counter
from typing import Annotated

import typer

from operate.cli.design import files
from operate.cli.output import Form, Format
from topdown.check import recorded
from topdown.model.design import Design, load
from topdown.model.findings import Finding
from topdown.model.rulings import Ruling, rulings


def check(
    file: files.File = None,
    run: files.Recording = None,
    ruled: Annotated[bool, typer.Option("--rulings", help="Also what the design rules, entry by entry.")] = False,
    form: Form = Format.TEXT,
) -> None:
    """Check a design: steps, channels, messages both ways, interfaces, state machines. Exits with 1 on a finding.

    Examples:
      roco design check
      roco design check design.toml --rulings
      roco design check --recording runs/latest
    """
    with files.problems(form):
        place = files.meant(file)
        design, heard = load(place), files.observed(run)
        found = files.findings(design, place)
        if heard is not None:
            found += recorded.findings(design, heard)
        told = rulings(design) if ruled else ()
    if form is Format.JSON:
        files.tell_json({"file": str(place), "findings": found, "rulings": told})
    else:
        print("".join(f"{line}\n" for one in told for line in _ruling(one, files.shown(place), files.width())), end="")
        print(written(found, files.shown(place), design, files.width()))
    if found:
        raise typer.Exit(1)


def written(found: tuple[Finding, ...], file: str, design: Design, width: int) -> str:
    """The findings as people read them, then how many there are of each kind; of a sound design what it has."""
    if not found:
        return "\n".join(textwrap.wrap(f"{file}: no findings in {inventory(design)}", width, subsequent_indent="  "))
    lines = [line for finding in found for line in _lines(finding, file, width)]
    counted = Counter(finding.kind for finding in found).most_common()
    summary = f"{len(found)} findings: " + ", ".join(f"{count} {kind}" for kind, count in counted)
    return "\n".join([*lines, *textwrap.wrap(summary, width, subsequent_indent="  ")])


def inventory(design: Design) -> str:
    """Return a design's inventory: the number of each kind of part."""
    file = design.file
    states = sum(len(agent.state) for agent in file.agent)
    messages = sum(len(use.message) for use in file.protocol)
    return (
        f"{len(file.requirement)} requirements, {len(file.step)} steps, {len(design.channels)} channels, "
        f"{len(file.protocol)} protocols, {messages} messages, {len(file.agent)} agents, {states} states"
    )


def _ruling(one: Ruling, file: str, width: int) -> list[str]:
    place = f"{file}:{one.line}" if one.line else file
    return [f"{place}: ruling on {one.where}", *_wrapped(" ".join(one.text.split()), width, "  "), ""]


def _lines(finding: Finding, file: str, width: int) -> list[str]:
    place = f"{file}:{finding.line}" if finding.line else file
    return [
        f"{place}: {finding.kind}",
        *_wrapped(f"{finding.where}: {finding.wrong}", width, "  "),
        *_wrapped(finding.right, width, "  -> "),
        "",
    ]


def _wrapped(text: str, width: int, first: str) -> list[str]:
    return textwrap.wrap(text, width, initial_indent=first, subsequent_indent=" " * (len(first) + 2))
