"""The act under way in 3D: the path that is planned for the hand, the frames of a grasp; and the
path each hand took.

Free motions come with their path. Straight ones are drawn from where the hand is; a grasp's points
stand in the frame of the thing. What ex solves again by itself (approach, levelling, pouring) is
not known beforehand, and not drawn. Nor is it in the end that a plan imagines, a ghost that is
shown while it is carried out: arms after their last free motion, what is put down, what is held.
"""

from collections import deque

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from companion.acts import SHOWN
from companion.languages import hfsm, rc, sw
from companion.languages.values import Pose, Side
from companion.telemetry import RobotState
from companion.tools.pictures import robot, scene
from companion.tools.pictures.scene import Scene
from companion.tools.pictures.velma import entity, placed, shaped
from companion.world.geometry import compose, inverse, rotate
from operate.pictures.sheet import (
    AXES,
    HIDDEN,
    ORANGE,
    PLANNED,
    SIDES,
    Sheet,
    arrows,
    strips,
    transforms,
)
from operate.recording.happenings import Happening
from operate.recording.records import Spoken
from velma.model import tree
from velma.names import ARM, BODY, COLUMNS, GRIP_BODY, START

Array = NDArray[np.float64]
WAY, FRAMES, DONE = "world/planned", "world/grasp_frames", "world/done"
MOST_POINTS = 24
"""Of a path that are drawn; estimate: smooth for the eye."""
TRAIL_POINTS, TRAIL_STEP_M = 120, 0.012
"""Of the path a hand took: its last 1.4 m. Estimate."""
TRAIL_S = 0.2
"""Between two looks at where the hands are: kinematics in Python cost 1 ms. Estimate: 7 cm of the
fastest hand.
"""
FRAME_M = 0.05
EDGES = ((FRAME_M, 0.0, 0.0), (0.0, FRAME_M, 0.0), (0.0, 0.0, FRAME_M))


class Acts:
    """Draws what ta asks of ex, until it is answered, and where the hands went."""

    def __init__(self, sheet: Sheet, scene: Scene) -> None:
        self._sheet, self._scene = sheet, scene
        self._links = tree.links()
        self._chains = {side: tree.chain(self._links, name) for side, name in GRIP_BODY.items()}
        self._q: dict[str, float] = {}
        self._followed = 0.0
        self._trails: dict[str, deque[Array]] = {
            side: deque(maxlen=TRAIL_POINTS) for side in GRIP_BODY
        }
        sheet.static(WAY, rr.LineStrips3D.from_fields(colors=[ORANGE], radii=[0.004]))
        sheet.static(FRAMES, rr.Arrows3D.from_fields(radii=[0.0025], colors=list(AXES) * 8))
        for side, colour in SIDES.items():
            sheet.static(
                f"{DONE}/{side}", rr.LineStrips3D.from_fields(colors=[colour], radii=[0.003])
            )

    def take(self, happening: Happening) -> None:
        """Draw a command's path, take it away with its answer, lengthen the trails."""
        match happening.what:
            case RobotState() as state:
                q = robot.joints(state)
                if q != self._q and happening.at - self._followed > TRAIL_S:
                    self._q, self._followed = q, happening.at
                    for side in self._trails:
                        self._lengthen(happening.at, side, state.sim_time_s)
            case Spoken(content=rc.Command() as command):
                self._draw(happening.at, *self._planned(command))
            case Spoken(content=rc.Done() | rc.NotDone()):
                self._draw(happening.at, [], [])

    def _draw(self, at: float, paths: list[Array], frames: list[Pose]) -> None:
        self._sheet.add(WAY, strips, at, paths)
        origins = [frame.xyz for frame in frames for _ in EDGES]
        vectors = [rotate(frame.quat_wxyz, edge) for frame in frames for edge in EDGES]
        self._sheet.add(FRAMES, arrows, at, (origins, vectors))

    def _planned(self, command: rc.Command) -> tuple[list[Array], list[Pose]]:
        """Paths (n, 3) of the grip frame in the world, and frames worth seeing."""
        match command:
            case rc.MoveJoint(side=side, path=path):
                steps = np.linspace(0, len(path) - 1, min(len(path), MOST_POINTS))
                chosen = np.unique(steps.astype(int))
                columns = [BODY[column] for column in COLUMNS[side]]
                postures = (dict(zip(columns, path[k], strict=True)) for k in chosen)
                frames = [self._grip(side, posture) for posture in postures]
                return [np.array([frame.xyz for frame in frames])], frames[-1:]
            case rc.MoveCartesian(side=side, segments=segments):
                start = self._grip(side, {}).xyz
                return [np.cumsum([start, *(np.array(one.offset) for one in segments)], axis=0)], []
            case rc.Release(place=Pose() as place):
                return [], [place]
        row = SHOWN.get(type(command))  # a hand that comes to an object as it stands now
        of = getattr(command, row.points_on) if row and row.points_on else ""
        if of not in self._scene.poses:
            return [], []
        approach = getattr(command, "approach", ())[-8:]
        frames = [compose(self._scene.poses[of], point.at) for point in approach]
        return [np.array([frame.xyz for frame in frames])], frames

    def _grip(self, side: str, instead: dict[str, float]) -> Pose:
        """T_world_grip of a hand at the present joints, some of them others."""
        return robot.world_frames(self._chains[side], self._q | instead)[GRIP_BODY[side]]

    def _lengthen(self, at: float, side: str, sim: float) -> None:
        here, trail = np.array(self._grip(side, {}).xyz), self._trails[side]
        if not trail or np.linalg.norm(here - trail[-1]) > TRAIL_STEP_M:
            trail.append(here)
            if len(trail) > 1:
                self._sheet.add(f"{DONE}/{side}", strips, at, [np.array(trail)], sim)


IMAGINED = "world/imagined"
ROBOT, THINGS = f"{IMAGINED}/velma", f"{IMAGINED}/things"
PALE: tree.Four = (PLANNED[0] / 255, PLANNED[1] / 255, PLANNED[2] / 255, 0.3)
Place = tuple[tuple[float, ...], tuple[float, ...]]
"""Translation [m] and quaternion, w first."""
STILL_RAD = 0.02
"""An arm whose joints turn less has no ghost: it would lie upon the arm. Estimate."""


class End:
    """Joints [rad] by name, places of things that were put down, and T_grip_thing of what hands
    hold, by a plan.
    """

    def __init__(self, plan: hfsm.HierarchicalPlan, q: dict[str, float]) -> None:
        self.q = dict(q)
        self.places: dict[str, Pose] = {}
        held: dict[Side, tuple[str, Pose]] = {}
        for command in hfsm.acts(plan.root):
            match command:
                case rc.MoveJoint(side=side, path=path) if path:
                    self.q |= dict(zip((BODY[k] for k in COLUMNS[side]), path[-1], strict=True))
                case rc.Home(side=side):
                    self.q |= {BODY[k]: float(START[k]) for k in ARM[side]}
                case rc.Grasp(side=side, object=name, approach=approach) if approach:
                    held[side] = name, approach[-1].at
                    self.places.pop(name, None)
                case rc.Release(side=side, object=name, place=place):
                    held.pop(side, None)
                    if place is not None:
                        self.places[name] = place
        frames = robot.world_frames(tree.links(), self.q)
        for side, (name, grip) in held.items():
            self.places[name] = compose(frames[GRIP_BODY[side]], inverse(grip))


class Imagined:
    """Draws the ghost when ta gets a plan, and takes it away when the plan has ended."""

    def __init__(self, sheet: Sheet, scene: Scene) -> None:
        self._sheet, self._scene = sheet, scene
        self._links = [link for link in tree.links() if not link.name.startswith("head")]
        self._q: dict[str, float] = {}
        self._looks: set[str] = set()
        self._shown: dict[str, Place] = {}

    def take(self, happening: Happening) -> None:
        """Draw the end of a plan, or nothing after it."""
        match happening.what:
            case RobotState() as state:
                self._q = robot.joints(state)
            case Spoken(channel="C1", content=hfsm.HierarchicalPlan() as plan) if self._q:
                end = End(plan, self._q)
                self._show(happening.at, self._arms(end) | self._objects(end))
            case Spoken(content=sw.Report() as report) if report.state in sw.FINAL:
                self._show(happening.at, {})

    def _arms(self, end: End) -> dict[str, Place]:
        """The place of each link that moves; the trunk has no shape here, it stands where the
        robot's does.
        """
        turns = {name for name, q in end.q.items() if abs(q - self._q.get(name, 0.0)) > STILL_RAD}
        moved = {side for side in ARM if turns & {BODY[k] for k in COLUMNS[side]}}
        places: dict[str, Place] = {}
        for link in self._links if moved else ():
            side = next((side for side in ARM if f"{side}_arm_0_joint" == link.joint), None)
            turned: Place = (link.at, robot.turned(link, end.q.get(link.joint, 0.0)))
            if link.joint:
                places[entity(link, ROBOT)] = HIDDEN if side and side not in moved else turned
            if link.name not in self._looks:
                self._looks.add(link.name)
                placed(self._sheet, link, ROBOT)
                if any(f"{side}_arm_1_link" in link.path for side in ARM):
                    shaped(self._sheet, link, ROBOT, PALE)
        return places

    def _objects(self, end: End) -> dict[str, Place]:
        for name in end.places:
            for part, drawn in scene.looks(self._scene.models.get(name, ""), PALE):
                self._sheet.static(f"{THINGS}/{name}/{part}", drawn)
        return {f"{THINGS}/{name}": (pose.xyz, pose.quat_wxyz) for name, pose in end.places.items()}

    def _show(self, at: float, places: dict[str, Place]) -> None:
        """Draw these entities and hide all others."""
        for where in {**self._shown, **places}:
            place = places.get(where, HIDDEN)
            if where not in self._shown:
                self._sheet.add(where, transforms, self._sheet.begin, HIDDEN)
            if self._shown.get(where) != place:
                self._shown[where] = place
                self._sheet.add(where, transforms, at, place)
