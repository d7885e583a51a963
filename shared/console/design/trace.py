"""`roco design trace`: every leaf requirement -> groups -> agents -> channels -> what shows it, if
anything.

Exit codes: 0 every leaf has evidence, 1 one has none or misses some, 2 a file cannot be read.
"""

import textwrap
from pathlib import Path

import typer

from console.design import files
from console.output import Form, Format
from topdown.check.requirements import Evidence, Shown, Traced, trace
from topdown.model.design import load

MARKS = {Shown.SEEN: "+", Shown.NAMED: " ", Shown.MISSING: "-"}


def trace_(file: files.File = None, run: files.Recording = None, form: Form = Format.TEXT) -> None:
    """Trace every leaf requirement to what shows that it is met. Exits with 1 where something is
    missing.

    Examples:
      roco design trace
      roco design trace --format json
    """
    with files.problems(form):
        place = files.meant(file)
        found = trace(load(place), files.observed(run), Tests(place))
    files.tell(
        {"file": str(place), "leaves": found, "bare": [leaf.id for leaf in found if leaf.bare]},
        form,
        written(found, files.width(), looked=run is not None),
    )
    if any(leaf.bare or missing(leaf) for leaf in found):
        raise typer.Exit(1)


class Tests:
    """Looks for tests by paths that begin where the design file stands, or in a folder above it."""

    __test__ = False

    def __init__(self, file: Path) -> None:
        self._folders = file.resolve().parents

    def __call__(self, path: str, name: str) -> bool:
        found = next((folder / path for folder in self._folders if (folder / path).is_file()), None)
        return found is not None and (
            not name or f"def {name}(" in found.read_text(encoding="utf-8")
        )


def missing(leaf: Traced) -> list[Evidence]:
    """Evidence that was looked for in vain."""
    return [one for one in leaf.evidence if one.shown is Shown.MISSING]


def written(found: tuple[Traced, ...], width: int, *, looked: bool) -> str:
    """The leaves as people read them, then those that nothing shows."""
    lines = [line for leaf in found for line in _leaf(leaf, width)]
    how = "; events and messages are looked for with --recording RUN"
    lines.append(f"+ seen, - missing{'' if looked else how}")
    bare = [leaf.id for leaf in found if leaf.bare]
    lost = [leaf.id for leaf in found if missing(leaf) and not leaf.bare]
    without = f"without evidence: {', '.join(bare)}"
    lines.append(without if bare else f"all {len(found)} leaves have evidence")
    lines += [f"some evidence is missing: {', '.join(lost)}"] if lost else []
    return "\n".join(lines)


def _leaf(leaf: Traced, width: int) -> list[str]:
    leads = {"step": map(str, leaf.steps), "groups": leaf.groups, "agents": leaf.agents}
    leads["channels"] = leaf.channels
    way = " -> ".join(f"{kind} {', '.join(names) or 'none'}" for kind, names in leads.items())
    lines = textwrap.wrap(f"{leaf.id}  {leaf.text}", width, subsequent_indent="    ")
    lines += textwrap.wrap(way, width, initial_indent="    ", subsequent_indent="      ")
    return [*lines, *_shown(leaf), ""]


def _shown(leaf: Traced) -> list[str]:
    if not leaf.evidence:
        return ["  - nothing shows it"]
    times = (f" ({one.count} times)" if one.count > 1 else "" for one in leaf.evidence)
    return [
        f"  {MARKS[one.shown]} {one.kind} {one.name}{count}"
        for one, count in zip(leaf.evidence, times, strict=True)
    ]
