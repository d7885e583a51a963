"""report.html of any system: one file that needs nothing else. A system may have a page of its
own.
"""

from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path

import jinja2

from operate import verdict_lines
from operate.recording.history import History
from operate.reports import figures
from operate.reports.counts import Communicates, Latency
from operate.reports.report import FaultAt, Judged, Report
from operate.system import System
from topdown.judge.verdicts import VIOLATIONS

TEMPLATE, FAULTS, JUDGED, LATENCY = (
    Path(__file__).with_name(f"{name}.html.j2") for name in ("page", "faults", "judged", "latency")
)
STYLE = Path(__file__).with_name("style.css").read_text(encoding="utf-8")
ABSENT = "–"
MOST_VIOLATIONS = 50
"""Shown on the page; beyond that nobody reads on (estimate)."""


def rendered(history: History, report: Report, run: str, system: System) -> str:
    """Return the page of a run."""
    design, began = system.design, datetime.fromtimestamp(report.began)
    stretches = [(one.agent, one.state, one.start, one.end) for one in report.busy]
    guests = {use.channel: (use.initiator, use.participant) for use in design.guest_uses.values()}
    ends = {**guests, **{name: channel.ends for name, channel in design.channels.items()}}
    return template(TEMPLATE).render(
        run=run,
        began=began.strftime("%Y-%m-%d %H:%M:%S") if report.began else ABSENT,
        report=report,
        count=len(design.agents),
        agents=tuple(report.communicates.matrix),
        channels={name: "-".join(ends[name]) for name in report.communicates.per_channel},
        busy=figures.busy(stretches, design),
        sizes=figures.sizes(history, design),
        latencies=latencies(report.latency),
        heat=heat(report.communicates),
        faults=faults(report.faults, history),
        houses=history.houses,
        judged=judged(report.judged),
        style=STYLE,
    )


def faults(found: tuple[FaultAt, ...], history: History) -> str:
    """Return the part of a page about the faults that were done on purpose; "" where none was."""
    if not found:
        return ""
    last = max((one.received for one in history.said[-1:]), default=history.begin) - history.begin
    end = max(
        [last, *(one.end for one in found if one.end is not None), *(one.start for one in found)]
    )
    stretches = [
        (one.target, one.kind, one.start, end if one.end is None else one.end) for one in found
    ]
    return template(FAULTS).render(faults=found, figure=figures.faults(stretches, end))


def judged(found: Judged | None) -> str:
    """Return the part of a page about what the judge says."""
    outcome = verdict_lines.outcome(found.verdicts) if found else ""
    return template(JUDGED).render(
        judged=found, outcome=outcome, against=VIOLATIONS, most_violations=MOST_VIOLATIONS
    )


def latencies(rows: tuple[Latency, ...]) -> str:
    """Return the part of a page about how long answers and receipts take."""
    return template(LATENCY).render(rows=rows, figure=figures.latencies(rows))


def template(file: Path, **filters: Callable[..., str]) -> jinja2.Template:
    """Return a page's template, with the filters for numbers and further ones."""
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    own = {"number": number, "size": size, "ms": milliseconds, "share": share, "place": place}
    environment.filters |= own | filters
    return environment.from_string(file.read_text(encoding="utf-8"))


def heat(communicates: Communicates) -> dict[tuple[str, str], float]:
    """Return the shade of a cell of the count matrix: by the root, so that small counts show beside
    large ones.
    """
    cells = {(s, r): n for s, row in communicates.matrix.items() for r, n in row.items()}
    most = max(cells.values(), default=0) or 1
    return {pair: (n / most) ** 0.5 for pair, n in cells.items()}


def number(value: float | None, digits: int = 0, unit: str = "") -> str:
    """A number with thin spaces between thousands; a dash for one that is not known."""
    if value is None:
        return ABSENT
    return f"{value:,.{digits}f}".replace(",", "\u202f") + (f"\u00a0{unit}" if unit else "")


def size(value: float | None) -> str:
    """Bytes for people."""
    if value is None:
        return ABSENT
    for unit, step in (("MB", 1e6), ("kB", 1e3)):
        if value >= step:
            return f"{value / step:.3g}\u00a0{unit}"
    return f"{value:.0f}\u00a0B"


def place(xyz: Sequence[float] | None) -> str:
    """A point in metres, to the millimetre."""
    return ABSENT if xyz is None else "\u2002".join(f"{part:.3f}" for part in xyz)


def milliseconds(value: float | None) -> str:
    """A duration for people."""
    if value is None:
        return ABSENT
    return f"{value / 1000:.3g}\u00a0s" if value >= 1000 else f"{value:.3g}\u00a0ms"


def share(value: float | None) -> str:
    """A part of the whole in per cent."""
    return ABSENT if value is None else f"{100 * value:.0f}\u00a0%"
