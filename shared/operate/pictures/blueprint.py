"""Layout of a run in the viewer: the views that every system has, and their arrangement where it
has no others.
"""

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TextLogColumn, TextLogColumnKind, TimelineColumn

from operate.pictures.sheet import RUN
from operate.pictures.stage import HIGH, SEQUENCE, WIDE

LIVE_S = 90.0
"""Time span of live plots [s]; estimate: a minute and a half is what a person looks back."""
YOUNG = 0.0
"""Duration of a run that has just begun: plots show it from its beginning, so that they are not
empty.
"""


def blueprint(end_s: float | None) -> rrb.Blueprint:
    """Of a run that lasted `end_s`; None: it goes on, plots show its last LIVE_S; YOUNG: all of it
    so far.
    """
    time = axis(end_s)
    seen = rrb.Vertical(graph(), log(), row_shares=(3, 2))
    told = rrb.Vertical(states("agents", time), sizes(time), bandwidth(time), row_shares=(3, 1, 1))
    return whole(
        end_s, rrb.Horizontal(seen, told, column_shares=(1, 1), name="run"), conversations()
    )


def whole(end_s: float | None, *tabs: rrb.Container) -> rrb.Blueprint:
    """Tabs, the first one shown, above the time panel."""
    playing = rrb.components.PlayState.Playing if end_s else rrb.components.PlayState.Following
    time = rrb.TimePanel(timeline=RUN, play_state=playing, state="collapsed")
    return rrb.Blueprint(rrb.Tabs(*tabs, active_tab=0), time, collapse_panels=True)


def axis(end_s: float | None) -> rrb.TimeAxis:
    """The axis of all plots."""
    at, after = rr.TimeRangeBoundary.absolute, rr.TimeRangeBoundary.cursor_relative
    if end_s is None:
        bounds = [after(seconds=-LIVE_S), after(seconds=2)]
    elif end_s == YOUNG:
        bounds = [at(seconds=0), after(seconds=2)]
    else:
        bounds = [at(seconds=-0.02 * end_s), at(seconds=1.02 * end_s)]
    return rrb.TimeAxis(view_range=rr.TimeRange(*bounds))


def graph() -> rrb.GraphView:
    """Agents and channels."""
    bounds = rrb.VisualBounds2D(
        x_range=(-1.45 * WIDE, 1.45 * WIDE), y_range=(-1.3 * HIGH, 1.4 * HIGH)
    )
    return rrb.GraphView(origin="graph", name="who talks with whom", visual_bounds=bounds)


def states(name: str, time: rrb.TimeAxis) -> rrb.StateTimelineView:
    """A lane for each agent, and for whatever the system adds below them."""
    return rrb.StateTimelineView(origin="agents", name=name, time_view=time)


def log() -> rrb.TextLogView:
    """A line for each communicate."""
    shown = (TextLogColumnKind.LogLevel, TextLogColumnKind.Body)
    columns = rrb.TextLogColumns(
        timeline_columns=[TimelineColumn(RUN, visible=False)],
        text_log_columns=[TextLogColumn(kind, visible=kind in shown) for kind in TextLogColumnKind],
    )
    return rrb.TextLogView(origin="communicates", name="communicates", columns=columns)


def conversations() -> rrb.Container:
    """A tab: the newest communicates as a sequence diagram, beside the log of all."""
    lanes = rrb.Spatial2DView(origin=SEQUENCE, name="who says what to whom, newest below")
    return rrb.Horizontal(lanes, log(), column_shares=(3, 2), name="conversations")


def sizes(time: rrb.TimeAxis) -> rrb.TimeSeriesView:
    """A point for each communicate."""
    # the viewer has no logarithmic axis
    name = "size of each communicate; 2: 100 B, 3: 1 kB, 4: 10 kB"
    return rrb.TimeSeriesView(
        origin="sizes", name=name, axis_x=time, plot_legend=rrb.Corner2D.RightTop
    )


def bandwidth(time: rrb.TimeAxis) -> rrb.TimeSeriesView:
    """A line for each channel; its colours are those of the sizes."""
    return rrb.TimeSeriesView(
        origin="bandwidth",
        name="bandwidth of each channel, kbit/s",
        axis_x=time,
        plot_legend=rrb.PlotLegend(visible=False),
    )
