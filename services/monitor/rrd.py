"""run.rrd: the run for Rerun - Velma and the things, the communicates, the agents' states - with a blueprint.

Logged in columns, once, after the run. One timeline, `run`: seconds after the first communicate; the simulation's clock
is a second one, `simulation`, where the robot is concerned.
"""

from collections.abc import Iterable
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TextLogColumn, TextLogColumnKind, TimelineColumn

from companion.design import DESIGN
from companion.languages.values import Pose
from services.monitor import robot, things
from services.monitor.history import History
from services.monitor.placing import placed
from services.monitor.plans import acts
from services.monitor.records import Spoken
from services.monitor.story import steps, word_of
from services.monitor.wording import words

NAME = "robot_companion"
VELMA, THINGS, GRAINS = "world/velma", "world/things", "world/grains"
GRAIN_RADIUS = 0.008  # velma/model/objects.yaml
GRAIN_COLOUR = (245, 184, 41)
BIN_S = 0.25
"""Of the bandwidth over time; estimate: some ten queries of a search."""
CHANNEL_COLOURS = {
    "C1": (230, 159, 0),
    "C2": (214, 93, 130),
    "C3": (150, 120, 220),
    "C4": (38, 150, 180),
    "C5": (136, 148, 165),
    "C6": (76, 168, 92),
}
"""Readable on light and on dark: the viewer's theme is the user's."""
_GREY, _FRESH, _RED = (120, 130, 145), (38, 150, 180), (205, 60, 60)
REST = "\u2013"
RESTING = ("idle", "trigger", "listening")


def write(path: Path, history: History) -> None:
    """Write the file, so that a reader sees the old one or the new one."""
    beside = path.with_name(f".{path.name}")
    with rr.RecordingStream(NAME, recording_id=f"{NAME}-{history.begin:.3f}") as out:
        rr.save(beside, default_blueprint=blueprint(_end(history)), recording=out)
        _velma(out, history)
        _things(out, history)
        _traffic(out, history)
        _states(out, history)
    beside.replace(path)


def blueprint(end_s: float) -> rrb.Blueprint:
    """Robot on the left; states, communicates and their sizes over the whole run on the right."""
    seen_from = rrb.EyeControls3D(position=(2.15, -1.7, 1.75), look_target=(0.5, -0.18, 0.9), eye_up=(0.0, 0.0, 1.0))
    bounds = (rr.TimeRangeBoundary.absolute(seconds=at) for at in (-0.02 * end_s, 1.02 * end_s))
    axis = rrb.TimeAxis(view_range=rr.TimeRange(*bounds))
    kinds = {kind: kind is TextLogColumnKind.Body for kind in TextLogColumnKind}
    columns = rrb.TextLogColumns(
        timeline_columns=[TimelineColumn("run", visible=False)],
        text_log_columns=[TextLogColumn(kind, visible=shown) for kind, shown in kinds.items()],
    )
    space = rrb.Spatial3DView(
        origin="world",
        name="Velma",
        background=rrb.Background(color=(238, 242, 246), kind=rrb.BackgroundKind.SolidColor),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=seen_from,
    )
    told = rrb.Vertical(
        rrb.StateTimelineView(origin="agents", name="agents", time_view=axis),
        rrb.TextLogView(origin="communicates", name="communicates", columns=columns),
        rrb.TimeSeriesView(
            origin="sizes", name="size of each communicate, log10 bytes", axis_x=axis, plot_legend=rrb.Corner2D.RightTop
        ),
        rrb.TimeSeriesView(origin="bandwidth", name="C4, kbit/s", axis_x=axis),
        row_shares=(17, 9, 7, 5),
    )
    time = rrb.TimePanel(timeline="run", play_state="playing", state="collapsed")
    return rrb.Blueprint(rrb.Horizontal(space, told, column_shares=(5, 4)), time, collapse_panels=True)


# --- the robot --------------------------------------------------------------------------------------------------------


def _velma(out: rr.RecordingStream, history: History) -> None:
    out.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    out.log("world/floor", _floor(), static=True)
    indexes = _indexes(history, [(at, state.sim_time_s) for at, state in history.robot])
    positions = [robot.joints(state) for _, state in history.robot]
    for link in robot.links():
        entity = "/".join((VELMA, *link.path))
        for kind, shapes in groupby(sorted(link.shapes, key=lambda s: s.kind), key=lambda s: s.kind):
            out.log(f"{entity}/{kind}", _drawn(kind, list(shapes)), static=True)
        if link.joint and positions:
            q = np.array([position.get(link.joint, 0.0) for position in positions])
            quats = robot.turned(link, q)[:, [1, 2, 3, 0]]
            at = np.tile(link.at, (len(q), 1))
            columns = rr.Transform3D.columns(translation=at, quaternion=quats)
            rr.send_columns(entity, indexes=indexes, columns=columns, recording=out)
        else:
            out.log(
                entity,
                rr.Transform3D(translation=link.at, quaternion=rr.Quaternion(xyzw=_xyzw(link.quat_wxyz))),
                static=True,
            )


def _drawn(kind: str, shapes: list[robot.Shape]) -> rr.AsComponents:
    """The shapes of one kind on a link, in one batch."""
    at, turn = [s.at for s in shapes], [_xyzw(s.quat_wxyz) for s in shapes]
    look: dict[str, Any] = {"colors": [s.rgba for s in shapes], "quaternions": turn, "fill_mode": "solid"}
    if kind == "box":
        return rr.Boxes3D(half_sizes=[s.size for s in shapes], centers=at, **look)
    if kind == "ellipsoid":
        return rr.Ellipsoids3D(half_sizes=[s.size for s in shapes], centers=at, **look)
    radii, lengths = [s.size[0] for s in shapes], [s.size[1] for s in shapes]
    if kind == "cylinder":
        return rr.Cylinders3D(lengths=lengths, radii=radii, centers=at, **look)
    # A capsule of Rerun begins at its origin; ours are given by their centres.
    starts = [np.array(s.at) - robot.matrix(np.array(s.quat_wxyz))[:, 2] * s.size[1] / 2 for s in shapes]
    return rr.Capsules3D(lengths=lengths, radii=radii, translations=starts, **look)


def _floor() -> rr.AsComponents:
    return rr.Boxes3D(
        centers=[(0.5, 0.0, -0.01)], half_sizes=[(2.2, 2.2, 0.01)], colors=[(222, 226, 230)], fill_mode="solid"
    )


# --- the things -------------------------------------------------------------------------------------------------------


def _things(out: rr.RecordingStream, history: History) -> None:
    """What never moves is logged once."""
    for thing in placed(history):
        entity = f"{THINGS}/{thing.name}"
        for part, drawn in things.looks(thing.model):
            out.log(f"{entity}/{part}", drawn, static=True)
        if thing.moves:
            at = np.array([pose.xyz for pose in thing.poses])
            turn = np.array([_xyzw(pose.quat_wxyz) for pose in thing.poses])
            columns = rr.Transform3D.columns(translation=at, quaternion=turn)
            rr.send_columns(entity, indexes=_indexes(history, thing.times), columns=columns, recording=out)
        else:
            out.log(entity, _transform(thing.poses[0]), static=True)
    _grains(out, history)


def _grains(out: rr.RecordingStream, history: History) -> None:
    states = [truth for _, truth in history.truth]
    if not any(truth.grains_at for truth in states):
        return
    out.log(GRAINS, rr.Points3D.from_fields(radii=[GRAIN_RADIUS], colors=[GRAIN_COLOUR]), static=True)
    points = np.array([point for truth in states for point in truth.grains_at], dtype=np.float32).reshape(-1, 3)
    columns = rr.Points3D.columns(positions=points).partition([len(truth.grains_at) for truth in states])
    indexes = _indexes(history, [(at, truth.time_s) for at, truth in history.truth])
    rr.send_columns(GRAINS, indexes=indexes, columns=columns, recording=out)


# --- what was said ----------------------------------------------------------------------------------------------------


def _traffic(out: rr.RecordingStream, history: History) -> None:
    for channel in DESIGN.channels:
        said = [one for one in history.said if one.channel == channel]
        if said:
            indexes = _indexes(history, [(one.received, None) for one in said])
            _sizes(out, channel, said, indexes)
            texts = [_line(one) for one in said]
            colours = [CHANNEL_COLOURS.get(channel, _GREY)] * len(said)
            columns = rr.TextLog.columns(text=texts, level=["INFO"] * len(said), color=colours)
            rr.send_columns(f"communicates/{channel}", indexes=indexes, columns=columns, recording=out)
    _bandwidth(out, history, [one for one in history.said if one.channel == "C4"])


def _sizes(out: rr.RecordingStream, channel: str, said: list[Spoken], indexes: list[rr.TimeColumn]) -> None:
    colour = CHANNEL_COLOURS.get(channel, _GREY)
    entity = f"sizes/{channel}"
    out.log(
        entity, rr.SeriesPoints(colors=[colour], names=[channel], markers=["circle"], marker_sizes=[2.5]), static=True
    )
    columns = rr.Scalars.columns(scalars=[np.log10(one.size) for one in said])
    rr.send_columns(entity, indexes=indexes, columns=columns, recording=out)


def _bandwidth(out: rr.RecordingStream, history: History, said: list[Spoken]) -> None:
    if not said:
        return
    at = np.array([one.received - history.begin for one in said])
    edges = np.arange(at[0] - BIN_S, at[-1] + 2 * BIN_S, BIN_S)
    bits, _ = np.histogram(at, bins=edges, weights=[8.0 * one.size for one in said])
    out.log("bandwidth/C4", rr.SeriesLines(colors=[CHANNEL_COLOURS["C4"]], names=["C4"], widths=[1.5]), static=True)
    index = rr.TimeColumn("run", duration=edges[:-1])
    columns = rr.Scalars.columns(scalars=bits / BIN_S / 1000)
    rr.send_columns("bandwidth/C4", indexes=[index], columns=columns, recording=out)


def _line(one: Spoken) -> str:
    text = words(one.content)
    return f"{one.sender} > {one.receiver}  {one.performative}{'  ' + text if text else ''}  ({one.size} B)"


def _states(out: rr.RecordingStream, history: History) -> None:
    """A lane per agent; states of rest are grey, all others stand out."""
    for agent, entry in DESIGN.agents.items():
        changes = [change for change in history.entered if change.agent == agent and (change.state or not change.alive)]
        if not changes:
            continue
        states = [change.state if change.alive else "gone" for change in changes]
        names = list(dict.fromkeys([*(state.name for state in entry.state), *states]))
        colours = [_RED if name == "gone" else _GREY if name in RESTING else _FRESH for name in names]
        lane = f"agents/{agent}"
        out.log(lane, rr.StateConfiguration(values=names, labels=names, colors=colours), static=True)
        indexes = _indexes(history, [(change.at, None) for change in changes])
        rr.send_columns(lane, indexes=indexes, columns=rr.StateChange.columns(state=states), recording=out)
    _lane(out, history, "agents/ta/plan", [(bar.start, bar.end, bar.texts[0]) for bar in steps(history)])
    _lane(out, history, "agents/ex/act", [(act.agreed, act.end, word_of(act)) for act in acts(history)])


def _lane(
    out: rr.RecordingStream, history: History, lane: str, spans: list[tuple[float | None, float | None, str]]
) -> None:
    """Stretches of time, each with its word; between them the lane rests. One without an end goes on."""
    changes = [change for start, end, word in spans for change in ((start, word), (end, REST))]
    # Of two changes at the same time the later one is wanted: a stretch may begin where another one ends.
    at = {moment: word for moment, word in changes if moment is not None}
    if not at:
        return
    names = list(dict.fromkeys(at.values()))
    colours = [_GREY if name == REST else _FRESH for name in names]
    out.log(lane, rr.StateConfiguration(values=names, labels=names, colors=colours), static=True)
    indexes = _indexes(history, [(moment, None) for moment in at])
    rr.send_columns(lane, indexes=indexes, columns=rr.StateChange.columns(state=list(at.values())), recording=out)


# ----------------------------------------------------------------------------------------------------------------------


def _end(history: History) -> float:
    """How long the run was [s]."""
    times = [one.received for one in history.said[-1:]] + [at for at, _ in history.robot[-1:]]
    return max(times, default=history.begin) - history.begin or 1.0


def _indexes(history: History, times: Iterable[tuple[float, float | None]]) -> list[rr.TimeColumn]:
    """Columns of time for pairs of unix time and simulated time (None: it has none)."""
    pairs = list(times)
    indexes = [rr.TimeColumn("run", duration=[at - history.begin for at, _ in pairs])]
    simulated = [sim for _, sim in pairs if sim is not None]
    if pairs and len(simulated) == len(pairs):
        indexes.append(rr.TimeColumn("simulation", duration=simulated))
    return indexes


def _transform(pose: Pose) -> rr.Transform3D:
    return rr.Transform3D(translation=pose.xyz, quaternion=rr.Quaternion(xyzw=_xyzw(pose.quat_wxyz)))


def _xyzw(quat_wxyz: tuple[float, ...]) -> tuple[float, float, float, float]:
    """Rerun has w last."""
    w, x, y, z = quat_wxyz
    return x, y, z, w
