"""Pictures of this robot beside those of any system: robot, things, beliefs, acts, camera, plan,
numbers, lanes.

The head camera is a part of the robot, so the 3D view has its field of view, with the picture and
the markers found in it across it. Older recordings have none.
"""

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from companion.languages import hfsm, rc, sw
from companion.sentences import Reader, does, plain, spaced
from companion.sentences import step as worded
from companion.telemetry import Lateness, Picture, RobotState, TrueState
from companion.tools.pictures.acts import Acts, Imagined
from companion.tools.pictures.scene import Believed, Contacts, Scene
from companion.tools.pictures.velma import Velma, entity
from companion.tools.telemetry import PICTURE_FOCAL, PICTURE_SIZE
from fipa_codec.performatives import Performative
from operate.pictures import blueprint as views
from operate.pictures.sheet import GREY, Sheet, documents, images, outlines, scalars
from operate.pictures.stage import REST, Drawer, Lane
from operate.recording.happenings import Happening
from operate.recording.records import Spoken
from velma.model import tree
from velma.names import ARM, BODY, CAMERA_BODY, TORSO

PLAN_TEXT = "plan"
Path = tuple[str, ...]


class Plan:
    """Writes the plan again when it or ta's place in it changes."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet = sheet
        self._plan: hfsm.HierarchicalPlan | None = None
        self._number = 0
        self._behind: set[Path] = set()
        self._at: Path = ()
        self._outcome = ""
        sheet.add(PLAN_TEXT, documents, sheet.begin, "No plan yet.")

    def take(self, happening: Happening) -> None:
        """Note a plan given to ta, and ta's reports."""
        match happening.what:
            case Spoken(channel="C1", content=hfsm.HierarchicalPlan() as plan):
                self._plan, self._at, self._outcome, self._behind = plan, (), "", set()
                self._number += 1
            case Spoken(content=sw.Report() as report) if self._plan is not None:
                self._report(report)
            case _:
                return
        if (plan := self._plan) is None:
            return
        head = f"**Plan {self._number}: {plain(plan.task)}** – {self._outcome or 'under way'}"
        self._sheet.add(
            PLAN_TEXT, documents, happening.at, "\n".join((head, "", *self._lines(plan.root, ())))
        )

    def _report(self, report: sw.Report) -> None:
        if report.at is not None and report.at.path != self._at:
            if self._at:
                self._behind.add(self._at)
                if self._at[0] != report.at.path[0]:
                    self._behind.add(self._at[:1])
            self._at = report.at.path
        if report.state in sw.FINAL:
            self._outcome, self._at = report.state.lower(), ()

    def _lines(self, machine: hfsm.Machine, path: Path) -> list[str]:
        lines: list[str] = []
        for state in machine.states:
            here = (*path, state.name)
            lines.append("  " * len(path) + "- " + self._line(here, does(state)))
            if isinstance(state, hfsm.Machine) and self._at[: len(here)] == here:
                lines += self._lines(state, here)
        return lines

    def _line(self, here: Path, name: str) -> str:
        """`here` is behind, the leaf ta is in, around it, or not yet begun."""
        if here == self._at:
            return f"**▶ {name}**"
        if self._at[: len(here)] == here:
            return f"**{name}**"
        return f"✓ {name}" if here in self._behind else name


CAMERA = f"{entity(next(link for link in tree.links() if link.name == CAMERA_BODY))}/camera"
MARKERS = f"{CAMERA}/markers"
BEFORE_M = 0.22
"""Distance of the picture from the camera in the 3D view; estimate: readable, and before the head,
not the hands.
"""
MARKED = (64, 220, 120)  # a green that neither wood, glass nor the bowl has


class Camera:
    """Draws the pictures."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet = sheet
        self._any = False

    def take(self, happening: Happening) -> None:
        """Draw a picture."""
        picture = happening.what
        if not isinstance(picture, Picture):
            return
        if not self._any:  # enlarged smoothly: its pixels are larger than the screen's
            self._any = True
            linear = rr.components.MagnificationFilter.Linear
            self._sheet.static(CAMERA, rr.EncodedImage.from_fields(magnification_filter=linear))
            # A negative radius is in points of the screen.
            lens = rr.Pinhole(
                resolution=PICTURE_SIZE,
                focal_length=PICTURE_FOCAL,
                image_plane_distance=BEFORE_M,
                color=GREY,
            )
            self._sheet.static(CAMERA, lens)
            look = rr.LineStrips2D.from_fields(colors=[MARKED], radii=[-1.0], show_labels=False)
            self._sheet.static(MARKERS, look)
        self._sheet.add(CAMERA, images, happening.at, picture.jpeg, picture.sim_time_s)
        found = [(one.thing, np.array(one.corners).reshape(4, 2)) for one in picture.markers]
        self._sheet.add(MARKERS, outlines, happening.at, found, picture.sim_time_s)


# --- The robot in numbers: joint positions, torques, wrenches at the wrists, how late the loop is -


ARMS = ("right", "left")
WRENCH = ("force x", "force y", "force z", "torque x", "torque y", "torque z")
QUANTILES = ("p50", "p99", "p99.9", "max")


class Signals:
    """Draws numbers of telemetry and truth."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet = sheet
        self._named: set[str] = set()

    def take(self, happening: Happening) -> None:
        """Draw them."""
        match happening.what:
            case RobotState() as state:
                self._joints(happening.at, "position", state.body, state.sim_time_s)
                t, at = state.sim_time_s, happening.at
                self._draw(at, "signals/position/head", ("pan", "tilt"), state.head, t)
                self._draw(at, "loop/late", QUANTILES, _numbers(state.lateness_us), t)
                self._draw(at, "loop/computes", QUANTILES, _numbers(state.compute_us), t)
                self._draw(at, "loop/missed", ("missed cycles",), (state.missed,), t)
            case TrueState() as truth:
                if len(truth.torque_Nm) == len(BODY):
                    self._joints(happening.at, "torque", truth.torque_Nm, truth.time_s)
                for side, wrench in truth.wrench.items():
                    self._draw(happening.at, f"signals/wrench/{side}", WRENCH, wrench, truth.time_s)

    def _joints(self, at: float, kind: str, body: Sequence[float], sim: float) -> None:
        """Torso and arms; `body` in the order of velma.names.BODY."""
        self._draw(at, f"signals/{kind}/torso", ("torso",), (body[TORSO],), sim)
        for side in ARMS:
            values = [body[column] for column in ARM[side]]
            curves = tuple(f"{side} {k}" for k in range(len(values)))
            self._draw(at, f"signals/{kind}/{side}", curves, values, sim)

    def _draw(
        self, at: float, entity: str, names: Sequence[str], values: Sequence[float], sim: float
    ) -> None:
        if entity not in self._named:
            self._named.add(entity)
            self._sheet.static(entity, rr.SeriesLines(names=list(names), widths=[1.2] * len(names)))
        self._sheet.add(entity, scalars, at, tuple(values), sim)


def _numbers(one: Lateness) -> tuple[float, ...]:
    return one.p50, one.p99, one.p999, one.max


# --- Lanes of states of this robot beside those of any system: the plan's step, ex's act, the
# loop's mode


PLAN, ACT, LOOP = "agents/ta/plan", "agents/ex/act", "agents/ex/loop"


class ActLanes:
    """Draws each change."""

    def __init__(self, sheet: Sheet) -> None:
        self._plan, self._acts, self._loop = (Lane(sheet, place) for place in (PLAN, ACT, LOOP))
        self._act = ""

    def take(self, happening: Happening) -> None:
        """Draw what changed."""
        at = happening.at
        match happening.what:
            case RobotState() as robot:
                self._loop.enter(at, robot.mode or REST)
            case Spoken(content=sw.Report() as report):
                begun = report.at.step if report.at else None
                step = worded(begun, Reader.OPERATOR) if begun else self._plan.now
                self._plan.enter(at, REST if report.state in sw.FINAL else step or REST)
            case Spoken(channel="C5") as one:
                self._acting(at, one)

    def _acting(self, at: float, one: Spoken) -> None:
        """ex's lane: from agree, when the robot begins to move, to the end of the act."""
        if isinstance(one.content, rc.Command):
            self._act = spaced(type(one.content).__name__)
        elif isinstance(one.content, rc.Accepted) or one.performative == Performative.AGREE:
            self._acts.enter(at, self._act or REST)
        elif isinstance(one.content, rc.Done | rc.NotDone):
            self._acts.enter(at, REST)


# --- Pictures of this robot beside those of any system --------------------------------------------


def drawers(sheet: Sheet) -> tuple[Drawer, ...]:
    """All of them, in the order in which they draw."""
    scene = Scene(sheet)
    things = (Contacts(sheet), Believed(sheet, scene), Acts(sheet, scene), Imagined(sheet, scene))
    more = (Camera(sheet), ActLanes(sheet), Plan(sheet), Signals(sheet))
    return (Velma(sheet), scene, *things, *more)


# --- Layout of a run of the Robot Companion in the viewer: tabs for the run, conversations, numbers


PAPER = (238, 242, 246)
PLOTS = (
    (("signals/position", "joint positions, rad"), ("signals/torque", "joint torques, Nm")),
    (
        ("signals/wrench/right", "right wrist: force N, torque Nm"),
        ("signals/wrench/left", "left wrist: force N, torque Nm"),
        ("loop/late", "the loop begins late by, us"),
        ("loop/missed", "missed cycles"),
    ),
)
"""Origin and title of each plot of the tab "numbers", a tuple for each column."""


def blueprint(end_s: float | None) -> rrb.Blueprint:
    """Of a run that lasted `end_s`; None: it goes on, plots show its last seconds; 0: it has just
    begun.
    """
    axis = views.axis(end_s)
    space = rrb.Spatial3DView(
        origin="world",
        name="Velma",
        background=rrb.Background(color=PAPER, kind=rrb.BackgroundKind.SolidColor),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            position=(2.15, -1.7, 1.75), look_target=(0.5, -0.18, 0.9), eye_up=(0.0, 0.0, 1.0)
        ),
    )
    plan = rrb.TextDocumentView(origin="plan", name="plan")
    below = rrb.Horizontal(views.graph(), plan, column_shares=(5, 3))
    seen = rrb.Vertical(space, below, row_shares=(5, 3))
    told = rrb.Vertical(
        views.states("agents, plan, act", axis),
        rrb.Horizontal(
            views.log(), rrb.Spatial2DView(origin=CAMERA, name="head camera"), column_shares=(3, 2)
        ),
        views.sizes(axis),
        views.bandwidth(axis),
        row_shares=(19, 11, 6, 5),
    )
    run = rrb.Horizontal(seen, told, column_shares=(1, 1), name="run")
    left, right = (
        rrb.Vertical(
            *(
                rrb.TimeSeriesView(
                    origin=origin, name=name, axis_x=axis, plot_legend=rrb.Corner2D.RightTop
                )
                for origin, name in column
            )
        )
        for column in PLOTS
    )
    return views.whole(
        end_s, run, views.conversations(), rrb.Horizontal(left, right, name="numbers")
    )
