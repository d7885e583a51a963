"""report.html: one file that needs nothing else - verdict, the paper's tables beside ours, figures, what is missing."""

from datetime import datetime
from pathlib import Path

import jinja2

from companion.design import DESIGN
from companion.tools.report import plans, story
from companion.tools.report.paper import PAPER, Paper
from operate.recording.history import History
from operate.reports import counts, figures
from operate.reports.report import Report
from topdown.judge.verdicts import VIOLATIONS

TEMPLATE = Path(__file__).with_name("page.html.j2")
ABSENT = "–"
MOST_VIOLATIONS = 50
"""So many are shown on the page; beyond that nobody reads on (estimate)."""


def rendered(history: History, report: Report, run: str, paper: Paper = PAPER) -> str:
    """The page of a run."""
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {"number": number, "size": size, "ms": milliseconds, "share": share}
    template = environment.from_string(TEMPLATE.read_text(encoding="utf-8"))
    return template.render(
        run=run,
        began=datetime.fromtimestamp(report.began).strftime("%Y-%m-%d %H:%M:%S") if report.began else ABSENT,
        report=report,
        paper=paper,
        times=_times(report, paper),
        agents=counts.AGENTS,
        channels={name: "-".join(channel.ends) for name, channel in DESIGN.channels.items()},
        story=story.story(history),
        sizes=figures.sizes(history, report),
        plans=[
            (plan, paper.made(plan.number), figures.planning(history, plan, made))
            for plan, made in zip(report.plans, plans.made(history), strict=True)
        ],
        latencies=figures.latencies(report.latency),
        heat=_heat(report),
        theirs_received={a: sum(row.get(a, 0) for row in paper.matrix.values()) for a in counts.AGENTS},
        houses=history.houses,
        against=VIOLATIONS,
        most_violations=MOST_VIOLATIONS,
    )


Row = tuple[float | None, float | None, str, str, str, float | None]


def _times(report: Report, paper: Paper) -> list[Row]:
    """Rows of Table 7: ours, simulated, event, why, channels, the paper's; its rows that we lack stay, empty."""
    rows: list[Row] = [
        (event.t, event.sim_s, event.name, event.text, ", ".join(event.channels), paper.times.get(event.name))
        for event in report.events
    ]
    ours = {event.name for event in report.events}
    rows += [(None, None, name, "", "", at) for name, at in paper.times.items() if name not in ours]
    return rows


def _heat(report: Report) -> dict[tuple[str, str], float]:
    """How strongly a cell of the count matrix is shaded: by the root, so that small counts show beside large ones."""
    counts = {(s, r): n for s, row in report.communicates.matrix.items() for r, n in row.items()}
    most = max(counts.values(), default=0) or 1
    return {pair: (n / most) ** 0.5 for pair, n in counts.items()}


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


def milliseconds(value: float | None) -> str:
    """A duration for people."""
    if value is None:
        return ABSENT
    return f"{value / 1000:.3g}\u00a0s" if value >= 1000 else f"{value:.3g}\u00a0ms"


def share(value: float | None) -> str:
    """A part of the whole in per cent."""
    return ABSENT if value is None else f"{100 * value:.0f}\u00a0%"
