"""`roco design estimate`: what each channel will carry before anything runs; beside a recording, how wrong that was.

Exit codes: 0 told (and within the error that is wanted), 1 a figure is further off, 2 a file cannot be read.
"""

from typing import Annotated

import msgspec
import typer
from rich.table import Table

from operate.cli.design import files
from operate.cli.output import Form, Format
from operate.cli.terminal.console import Console
from topdown.check.estimate import Estimate, UseEstimate, estimate
from topdown.check.measure import Measured, measure
from topdown.model.design import load

WITHIN = 0.3
"""The error that is wanted: estimates should be within 30 %."""


class Told(msgspec.Struct, frozen=True):
    """The answer for programs. `compared`: each figure with its error."""

    estimate: Estimate
    narrowest: str
    slowest: str
    compared: tuple[tuple[Measured, float | None], ...] = ()


def estimate_(
    file: files.File = None,
    run: files.Recording = None,
    within: Annotated[float, typer.Option(help="Beside a recording: the error that is wanted, as a share.")] = WITHIN,
    form: Form = Format.TEXT,
) -> None:
    """Estimate counts, sizes, bandwidth, latencies, bottlenecks. Beside a recording exits with 1 on a larger error.

    Examples:
      roco design estimate
      roco design estimate --recording runs/latest
    """
    with files.problems(form):
        place = files.meant(file)
        design, heard = load(place), files.observed(run)
        found = estimate(design)
        compared = measure(design, found, heard) if heard is not None else ()
    if form is Format.JSON:
        errors = tuple((one, one.error) for one in compared)
        files.tell_json(Told(found, found.narrowest, found.slowest, errors))
    else:
        show(found, compared, within, Console(width=files.width(), highlight=False))
    if any(off(one, within) for one in compared):
        raise typer.Exit(1)


def off(one: Measured, within: float) -> bool:
    """Whether an estimate is further off than wanted."""
    return one.error is not None and abs(one.error) > within


def show(found: Estimate, compared: tuple[Measured, ...], within: float, console: Console) -> None:
    """Print it for people."""
    console.print(channels(found))
    console.print()
    console.print(uses(found))
    if any(0 < one.budget_s < one.latency_s for one in found.uses):
        console.print("! over the budget of the design")
    console.print()
    if found.seconds:
        console.print(f"the whole takes {found.seconds:.3g} s")
    if found.narrowest:
        busy = bits(found.channels[found.narrowest].busy_bit_s)
        console.print(f"narrowest: channel {found.narrowest}, {busy} while it is busy")
    if found.slowest:
        share = max(one.share for one in found.uses)
        console.print(f"slowest: {found.slowest}, in which {share:.0%} of the time passes")
    if found.missing:
        names = ", ".join(found.missing)
        console.print(f"without figures, so counted once, shortest, as large as the budgets allow: {names}")
    if compared:
        console.print()
        console.print(beside(compared, within))
        far = [one for one in compared if off(one, within)]
        known = [one for one in compared if one.error is not None]
        console.print(f"{len(known) - len(far)} of {len(known)} figures are within {within:.0%}")


def channels(found: Estimate) -> Table:
    """A row for each channel."""
    table = _table("channel", "communicates", "bytes", "at most", "mean", "busy")
    for name, carried in found.channels.items():
        most = size(carried.most_bytes)
        table.add_row(
            name,
            f"{carried.communicates:.4g}",
            size(carried.bytes),
            most,
            bits(carried.mean_bit_s),
            bits(carried.busy_bit_s),
        )
    return table


def uses(found: Estimate) -> Table:
    """A row for each use of a protocol."""
    table = _table("protocol", "channel", "conversations", "one takes", "answer", "budget", "of the time")
    for one in found.uses:
        table.add_row(
            one.use,
            one.channel,
            f"{one.conversations:.4g}",
            seconds(one.seconds),
            seconds(one.latency_s),
            _budget(one),
            f"{one.share:.0%}" if one.share else "",
        )
    return table


def beside(compared: tuple[Measured, ...], within: float) -> Table:
    """A row for each figure: estimated, recorded, error."""
    table = _table("of", "figure", "estimated", "recorded", "error")
    for one in compared:
        if not one.estimated and not one.recorded:
            continue
        error = "" if one.error is None else f"{one.error:+.0%}"
        style = "yellow" if off(one, within) else ""
        table.add_row(
            one.where, one.what, said(one.estimated, one.unit), said(one.recorded, one.unit), error, style=style
        )
    return table


def _budget(one: UseEstimate) -> str:
    return seconds(one.budget_s) + (" !" if 0 < one.budget_s < one.latency_s else "")


def _table(*heads: str) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    for number, head in enumerate(heads):
        words = number == 0 or head in ("channel", "figure")
        table.add_column(head, justify="left" if words else "right", no_wrap=True)
    return table


def said(value: float, unit: str) -> str:
    """A figure with its unit."""
    match unit:
        case "B":
            return size(value)
        case "bit/s":
            return bits(value)
        case "s":
            return seconds(value)
        case _:
            return f"{value:.4g}"


def size(value: float) -> str:
    """Bytes."""
    return _scaled(value, "B")


def bits(value: float) -> str:
    """Bit per second; nothing for 0."""
    return _scaled(value, "bit/s") if value else ""


def _scaled(value: float, unit: str) -> str:
    """Three digits and a prefix of the SI."""
    for limit, prefix in ((1e6, "M"), (1e3, "k")):
        if value >= limit:
            return f"{float(f'{value / limit:.3g}'):g} {prefix}{unit}"
    return f"{value:.3g} {unit}"


def seconds(value: float) -> str:
    """Seconds, short ones in ms; nothing for 0."""
    if not value:
        return ""
    return f"{value:.3g} s" if value >= 1 else f"{1000 * value:.3g} ms"
