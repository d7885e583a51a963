"""report.html: one file that needs nothing else - verdict, the paper's tables beside ours, figures, what is missing."""

import base64
from datetime import datetime
from pathlib import Path

from companion.design import DESIGN
from companion.sentences import happened
from companion.tools import telemetry
from companion.tools.beliefs import MOST_APART_MM
from companion.tools.report import planning, plans, story
from companion.tools.report.paper import PAPER, TABLE_8, Paper
from companion.tools.report.report import Report
from operate.recording.history import History
from operate.reports import figures
from operate.reports.page import ABSENT, STYLE, faults, heat, judged, latencies, template

TEMPLATE = Path(__file__).with_name("page.html.j2")


def rendered(history: History, report: Report, run: str, paper: Paper = PAPER) -> str:
    """The page of a run."""
    return template(TEMPLATE).render(
        run=run,
        began=datetime.fromtimestamp(report.began).strftime("%Y-%m-%d %H:%M:%S") if report.began else ABSENT,
        report=report,
        paper=paper,
        times=_times(report, paper),
        agents=TABLE_8,
        channels={name: "-".join(channel.ends) for name, channel in DESIGN.channels.items()},
        story=story.story(history),
        legend=story.LEGEND,
        room=_room(history),
        sizes=figures.sizes(history, DESIGN, _planned(report)),
        plans=[
            (plan, paper.made(plan.number), planning.planning(history, plan, made))
            for plan, made in zip(report.plans, plans.made(history), strict=True)
        ],
        latencies=latencies(report.latency),
        heat=heat(report.communicates),
        style=STYLE,
        theirs_received={a: sum(row.get(a, 0) for row in paper.matrix.values()) for a in TABLE_8},
        faults=faults(report.faults, history),
        houses=history.houses,
        judged=judged(report.judged),
        most_apart_mm=MOST_APART_MM,
    )


def _room(history: History) -> str:
    """Return the last picture of the robot in its room, a JPEG file in base64; "" without any."""
    rooms = [picture.room for _, picture in telemetry.pictures(history) if picture.room]
    return base64.b64encode(rooms[-1]).decode() if rooms else ""


Row = tuple[float | None, float | None, str, str, str, float | None]


def _times(report: Report, paper: Paper) -> list[Row]:
    """Rows of Table 7: ours, simulated, event, why, channels, the paper's; its rows that we lack stay, empty."""
    rows: list[Row] = [
        (event.t, event.sim_s, event.words, event.text, ", ".join(event.channels), paper.times.get(event.id))
        for event in report.events
    ]
    ours = {event.id for event in report.events}
    lacking = (one for one in paper.time if one.id not in ours)
    return [*rows, *((None, None, happened(one.event, one.of), "", "", one.t) for one in lacking)]


def _planned(report: Report) -> list[tuple[float, float, str]]:
    """Stretches in which a plan was made."""
    made = [(plan, plan.wall_s) for plan in report.plans if plan.wall_s is not None]
    return [(plan.t, plan.t + wall_s, f"plan {plan.number}") for plan, wall_s in made]
