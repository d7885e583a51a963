"""What is found in design files: `roco design check`, `diff`, `trace`.

`check` names every fault of a design with its place; with a recording also what the run shows.

With `--estimate` also what each channel will carry before anything runs; beside a recording, how
wrong that was. Exit codes: 0 no findings, 1 findings or a figure further off than is wanted, 2 a
file cannot be read.
"""

import textwrap
from collections import Counter
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from rich.table import Table

from console.design import files
from console.output import Form, Format, argument, option
from console.terminal.console import Console, table
from topdown.check import recorded
from topdown.check.difference import Change, Way, diff
from topdown.check.estimate import Estimate, Measured, estimate, measure
from topdown.check.requirements import Evidence, Shown, Traced, trace
from topdown.model import schema as schemas
from topdown.model.design import Design, Ruling, load, rulings
from topdown.model.findings import Finding

WITHIN = 0.3
"""The error that is wanted: estimates should be within 30 %."""


class EstimateReport(msgspec.Struct, frozen=True):
    """The estimate for programs. `compared`: each figure with its error."""

    estimate: Estimate
    narrowest: str
    slowest: str
    compared: tuple[tuple[Measured, float | None], ...] = ()


def check(
    file: files.File = None,
    run: files.Recording = None,
    ruled: Annotated[
        bool, option("Also what the design rules, entry by entry.", "--rulings")
    ] = False,
    estimated: Annotated[
        bool,
        option("Also counts, sizes, bandwidth, latencies, bottlenecks to expect.", "--estimate"),
    ] = False,
    within: Annotated[
        float, option("Of the estimate beside a recording: the error that is wanted, as a share.")
    ] = WITHIN,
    schema: Annotated[
        bool, option("Print the JSON schema of design files instead, for editors.", "--schema")
    ] = False,
    form: Form = Format.TEXT,
) -> None:
    """Check a design: steps, channels, messages both ways, interfaces, state machines. Exits with 1
    on a finding.

    Examples:
      roco design check
      roco design check design.toml --rulings
      roco design check --recording runs/latest
      roco design check --estimate
      roco design check --schema
    """
    if schema:
        print(msgspec.json.format(msgspec.json.encode(schemas.schema())).decode())
        return
    with files.problems(form):
        place = files.meant(file)
        design, heard = load(place), files.observed(run)
        found = files.findings(design, place)
        if heard is not None:
            found += recorded.findings(design, heard)
        told = rulings(design) if ruled else ()
        expected = estimate(design) if estimated else None
        compared = measure(design, expected, heard) if expected and heard is not None else ()
    answer: dict[str, object] = {"file": str(place), "findings": found, "rulings": told}
    width, shown = files.width(), files.shown(place)
    words = [line for one in told for line in _ruling(one, shown, width)]
    if expected is not None:
        errors = tuple((one, one.error) for one in compared)
        report = EstimateReport(expected, expected.narrowest, expected.slowest, errors)
        answer["estimate"] = report
    files.tell(answer, form, "\n".join([*words, written(found, shown, design, width)]))
    if expected is not None and form is Format.TEXT:
        print()
        show(expected, compared, within, Console(width=width, highlight=False))
    if found or any(off(one, within) for one in compared):
        raise typer.Exit(1)


def written(found: tuple[Finding, ...], file: str, design: Design, width: int) -> str:
    """The findings as people read them, then how many there are of each kind; of a sound design
    what it has.
    """
    if not found:
        has = design.file
        counts = {
            "requirements": len(has.requirement),
            "steps": len(has.step),
            "channels": len(design.channels),
            "protocols": len(has.protocol),
            "messages": sum(len(use.message) for use in has.protocol),
            "agents": len(has.agent),
            "states": sum(len(one.state) for one in has.agent),
        }
        inventory = ", ".join(f"{count} {name}" for name, count in counts.items())
        whole = f"{file}: no findings in {inventory}"
        return "\n".join(textwrap.wrap(whole, width, subsequent_indent="  "))
    lines: list[str] = []
    for finding in found:
        lines.append(f"{_place(file, finding.line)}: {finding.kind}")
        lines += _wrapped(f"{finding.where}: {finding.wrong}", width, "  ")
        lines += [*_wrapped(finding.right, width, "  -> "), ""]
    counted = Counter(finding.kind for finding in found).most_common()
    summary = f"{len(found)} findings: " + ", ".join(f"{count} {kind}" for kind, count in counted)
    return "\n".join([*lines, *textwrap.wrap(summary, width, subsequent_indent="  ")])


def _ruling(one: Ruling, file: str, width: int) -> list[str]:
    words = " ".join(one.text.split())
    return [f"{_place(file, one.line)}: ruling on {one.where}", *_wrapped(words, width, "  "), ""]


def _place(file: str, line: int | None) -> str:
    return f"{file}:{line}" if line else file


def _wrapped(text: str, width: int, first: str) -> list[str]:
    return textwrap.wrap(
        text, width, initial_indent=first, subsequent_indent=" " * (len(first) + 2)
    )


# --- The estimate ---------------------------------------------------------------------------------


def off(one: Measured, within: float) -> bool:
    """Whether an estimate is further off than wanted."""
    return one.error is not None and abs(one.error) > within


def show(found: Estimate, compared: tuple[Measured, ...], within: float, console: Console) -> None:
    """Print it for people."""
    console.print(_channels(found))
    console.print()
    console.print(_uses(found))
    if any(0 < one.budget_s < one.latency_s for one in found.uses):
        console.print("! over the budget of the design")
    console.print()
    if found.seconds:
        console.print(f"the whole takes {found.seconds:.3g} s")
    if found.narrowest:
        busy = _bits(found.channels[found.narrowest].busy_bit_s)
        console.print(f"narrowest: channel {found.narrowest}, {busy} while it is busy")
    if found.slowest:
        share = max(one.share for one in found.uses)
        console.print(f"slowest: {found.slowest}, in which {share:.0%} of the time passes")
    if found.missing:
        taken = "counted once, shortest, as large as the budgets allow"
        console.print(f"without figures, so {taken}: {', '.join(found.missing)}")
    if compared:
        console.print()
        console.print(_beside(compared, within))
        known = [one for one in compared if one.error is not None]
        near = [one for one in known if not off(one, within)]
        console.print(f"{len(near)} of {len(known)} figures are within {within:.0%}")


def _channels(found: Estimate) -> Table:
    drawn = _table("channel", "communicates", "bytes", "at most", "mean", "busy")
    for name, carried in found.channels.items():
        sizes = (_scaled(carried.bytes, "B"), _scaled(carried.most_bytes, "B"))
        rates = (_bits(carried.mean_bit_s), _bits(carried.busy_bit_s))
        drawn.add_row(name, f"{carried.communicates:.4g}", *sizes, *rates)
    return drawn


def _uses(found: Estimate) -> Table:
    times = ("one takes", "answer", "budget", "of the time")
    drawn = _table("protocol", "channel", "conversations", *times)
    for one in found.uses:
        over = " !" if 0 < one.budget_s < one.latency_s else ""
        took = (_seconds(one.seconds), _seconds(one.latency_s), _seconds(one.budget_s) + over)
        share = f"{one.share:.0%}" if one.share else ""
        drawn.add_row(one.use, one.channel, f"{one.conversations:.4g}", *took, share)
    return drawn


def _beside(compared: tuple[Measured, ...], within: float) -> Table:
    """A row for each figure: estimated, recorded, error."""
    drawn = _table("of", "figure", "estimated", "recorded", "error")
    for one in compared:
        if one.estimated or one.recorded:
            figures = (_figure(one.estimated, one.unit), _figure(one.recorded, one.unit))
            error = "" if one.error is None else f"{one.error:+.0%}"
            style = "yellow" if off(one, within) else ""
            drawn.add_row(one.where, one.what, *figures, error, style=style)
    return drawn


def _table(*heads: str) -> Table:
    numbers = [head for head in heads[1:] if head not in ("channel", "figure")]
    return table(heads, right=numbers, header_style="bold", padding=(0, 1), pad_edge=False)


def _figure(value: float, unit: str) -> str:
    if unit == "B":
        return _scaled(value, "B")
    if unit == "bit/s":
        return _bits(value)
    return _seconds(value) if unit == "s" else f"{value:.4g}"


def _bits(value: float) -> str:
    return _scaled(value, "bit/s") if value else ""


def _scaled(value: float, unit: str) -> str:
    """Three digits and a prefix of the SI."""
    for limit, prefix in ((1e6, "M"), (1e3, "k")):
        if value >= limit:
            return f"{float(f'{value / limit:.3g}'):g} {prefix}{unit}"
    return f"{value:.3g} {unit}"


def _seconds(value: float) -> str:
    """Short ones in ms; nothing for 0."""
    if not value:
        return ""
    return f"{value:.3g} s" if value >= 1 else f"{1000 * value:.3g} ms"


# --- `roco design diff A B`: what changed between two designs, and what follows from it -----------


WAYS = {Way.ADDED: "+", Way.REMOVED: "-", Way.CHANGED: "~"}


def diff_(
    old: Annotated[Path, argument("A design file.")],
    new: Annotated[Path, argument("The design file it became.")],
    form: Form = Format.TEXT,
) -> None:
    """Tell what changed between two designs, whatever the order of their entries. Exits with 1
    where they differ.

    Examples:
      roco design diff old.toml new.toml
    """
    with files.problems(form):
        found = diff(load(old), load(new))
    files.tell(found, form, changes_text(found, files.width()))
    if found:
        raise typer.Exit(1)


def changes_text(found: tuple[Change, ...], width: int) -> str:
    """The changes as people read them: what was written, then what follows."""
    if not found:
        return "the designs are the same"
    lines: list[str] = []
    for derived, title in ((False, "written"), (True, "what follows")):
        some = [change for change in found if change.derived is derived]
        if some:
            lines += [title, *_by_entry(some, width), ""]
    return "\n".join(lines).rstrip()


def _by_entry(changes: list[Change], width: int) -> list[str]:
    """Changes of one entry stand below its name."""
    lines: list[str] = []
    last = ""
    for one in changes:
        entry = f"  {WAYS[one.way]} {one.kind} {one.name}"
        if one.way is not Way.CHANGED:
            lines += _hung(entry, one.old or one.new, width)
        else:
            lines += [entry] * (entry != last)
            change = f"{one.old or 'nothing'} -> {one.new or 'nothing'}"
            lines += _hung(f"      {one.field}", change, width)
        last = entry
    return lines


def _hung(head: str, words: str, width: int) -> list[str]:
    whole = f"{head}: {words}" if words else head
    indent = len(head) - len(head.lstrip()) + 4
    return textwrap.wrap(whole, width, subsequent_indent=" " * indent, drop_whitespace=True)


# --- `roco design trace`: each leaf requirement, groups, agents, channels, and what shows it ------


SHOWN = {Shown.SEEN: "+", Shown.NAMED: " ", Shown.MISSING: "-"}


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
        leaves_text(found, files.width(), looked=run is not None),
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


def leaves_text(found: tuple[Traced, ...], width: int, *, looked: bool) -> str:
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
    return [*lines, *_evidence(leaf), ""]


def _evidence(leaf: Traced) -> list[str]:
    if not leaf.evidence:
        return ["  - nothing shows it"]
    times = (f" ({one.count} times)" if one.count > 1 else "" for one in leaf.evidence)
    return [
        f"  {SHOWN[one.shown]} {one.kind} {one.name}{count}"
        for one, count in zip(leaf.evidence, times, strict=True)
    ]
