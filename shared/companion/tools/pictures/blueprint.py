"""Layout of a run of the Robot Companion in the viewer: tabs for the run, conversations, numbers."""

import rerun.blueprint as rrb

from companion.tools.pictures.camera import CAMERA
from operate.pictures import blueprint as views

PAPER = (238, 242, 246)


def blueprint(end_s: float | None) -> rrb.Blueprint:
    """Of a run that lasted `end_s`; None: it goes on, plots show its last seconds; 0: it has just begun."""
    axis = views.axis(end_s)
    seen = rrb.Vertical(
        _space(),
        rrb.Horizontal(views.graph(), rrb.TextDocumentView(origin="plan", name="plan"), column_shares=(5, 3)),
        row_shares=(5, 3),
    )
    told = rrb.Vertical(
        views.states("agents, plan, act", axis),
        rrb.Horizontal(views.log(), _camera(), column_shares=(3, 2)),
        views.sizes(axis),
        views.bandwidth(axis),
        row_shares=(19, 11, 6, 5),
    )
    run = rrb.Horizontal(seen, told, column_shares=(1, 1), name="run")
    return views.whole(end_s, run, views.conversations(), _numbers(axis))


def _space() -> rrb.Spatial3DView:
    seen_from = rrb.EyeControls3D(position=(2.15, -1.7, 1.75), look_target=(0.5, -0.18, 0.9), eye_up=(0.0, 0.0, 1.0))
    return rrb.Spatial3DView(
        origin="world",
        name="Velma",
        background=rrb.Background(color=PAPER, kind=rrb.BackgroundKind.SolidColor),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=seen_from,
    )


def _camera() -> rrb.Spatial2DView:
    return rrb.Spatial2DView(origin=CAMERA, name="head camera")


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
