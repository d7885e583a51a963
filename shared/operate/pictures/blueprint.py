"""How the viewer lays it out: a tab for the run (robot, graph, plan, camera, states, traffic), one for numbers."""

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TextLogColumn, TextLogColumnKind, TimelineColumn

from companion.tools.pictures.camera import CAMERA
from operate.pictures.graph import HIGH, WIDE
from operate.pictures.sheet import RUN

PAPER = (238, 242, 246)
LIVE_S = 90.0
"""What live plots show; estimate: a pour in real time."""


def blueprint(end_s: float | None) -> rrb.Blueprint:
    """Of a run that lasted `end_s`; None: it goes on, plots show its last LIVE_S and the cursor follows."""
    axis = _axis(end_s)
    seen = rrb.Vertical(
        _space(),
        rrb.Horizontal(_graph(), rrb.TextDocumentView(origin="plan", name="plan"), column_shares=(5, 3)),
        row_shares=(5, 3),
    )
    told = rrb.Vertical(
        rrb.StateTimelineView(origin="agents", name="agents, plan, act", time_view=axis),
        rrb.Horizontal(_log(), _camera(), column_shares=(3, 2)),
        rrb.TimeSeriesView(
            origin="sizes", name="size of each communicate, log10 bytes", axis_x=axis, plot_legend=rrb.Corner2D.RightTop
        ),
        rrb.TimeSeriesView(
            origin="bandwidth",
            name="bandwidth of each channel, kbit/s",
            axis_x=axis,
            plot_legend=rrb.PlotLegend(visible=False),  # colours are those of the sizes above
        ),
        row_shares=(19, 11, 6, 5),
    )
    run = rrb.Horizontal(seen, told, column_shares=(1, 1), name="run")
    playing = rrb.components.PlayState.Playing if end_s is not None else rrb.components.PlayState.Following
    time = rrb.TimePanel(timeline=RUN, play_state=playing, state="collapsed")
    return rrb.Blueprint(rrb.Tabs(run, _numbers(axis), active_tab=0), time, collapse_panels=True)


def _axis(end_s: float | None) -> rrb.TimeAxis:
    if end_s is None:
        bounds = [
            rr.TimeRangeBoundary.cursor_relative(seconds=-LIVE_S),
            rr.TimeRangeBoundary.cursor_relative(seconds=2),
        ]
    else:
        bounds = [rr.TimeRangeBoundary.absolute(seconds=at) for at in (-0.02 * end_s, 1.02 * end_s)]
    return rrb.TimeAxis(view_range=rr.TimeRange(*bounds))


def _space() -> rrb.Spatial3DView:
    seen_from = rrb.EyeControls3D(position=(2.15, -1.7, 1.75), look_target=(0.5, -0.18, 0.9), eye_up=(0.0, 0.0, 1.0))
    return rrb.Spatial3DView(
        origin="world",
        name="Velma",
        background=rrb.Background(color=PAPER, kind=rrb.BackgroundKind.SolidColor),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=seen_from,
    )


def _graph() -> rrb.GraphView:
    bounds = rrb.VisualBounds2D(x_range=(-1.45 * WIDE, 1.45 * WIDE), y_range=(-1.3 * HIGH, 1.4 * HIGH))
    return rrb.GraphView(origin="graph", name="who talks with whom", visual_bounds=bounds)


def _camera() -> rrb.Spatial2DView:
    return rrb.Spatial2DView(origin=CAMERA, name="head camera")


def _log() -> rrb.TextLogView:
    shown = (TextLogColumnKind.LogLevel, TextLogColumnKind.Body)
    columns = rrb.TextLogColumns(
        timeline_columns=[TimelineColumn(RUN, visible=False)],
        text_log_columns=[TextLogColumn(kind, visible=kind in shown) for kind in TextLogColumnKind],
    )
    return rrb.TextLogView(origin="communicates", name="communicates", columns=columns)


def _numbers(axis: rrb.TimeAxis) -> rrb.Horizontal:
    left = rrb.Vertical(
        _series("signals/position", "joint positions, rad", axis),
        _series("signals/torque", "joint torques, Nm", axis),
    )
    right = rrb.Vertical(
        _series("signals/wrench/right", "right wrist: force N, torque Nm", axis),
        _series("signals/wrench/left", "left wrist: force N, torque Nm", axis),
        _series("loop/late", "the loop begins late by, us", axis),
        _series("loop/missed", "missed cycles", axis),
    )
    return rrb.Horizontal(left, right, name="numbers")


def _series(origin: str, name: str, axis: rrb.TimeAxis) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(origin=origin, name=name, axis_x=axis, plot_legend=rrb.Corner2D.RightTop)
