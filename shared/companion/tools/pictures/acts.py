"""The act under way in 3D: the path that is planned for the hand, the frames of a grasp; and the
path each hand took.

Free motions come with their path. Straight ones are drawn from where the hand is; a grasp's points
stand in the frame of the thing. What ex solves again by itself (approach, levelling, pouring) is
not known beforehand, and not drawn.
"""

from collections import deque

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from companion.languages import rc
from companion.languages.values import Pose
from companion.telemetry import RobotState
from companion.tools.pictures import robot
from companion.tools.pictures.scene import Scene
from companion.tools.shown import SHOWN
from companion.world.geometry import compose, rotate
from operate.pictures.sheet import AXES, ORANGE, SIDES, Sheet, arrows, strips
from operate.pictures.stage import Happening
from operate.recording.records import Spoken
from velma.names import BODY, COLUMNS, GRIP_BODY

Array = NDArray[np.float64]
PLANNED, FRAMES, DONE = "world/planned", "world/grasp_frames", "world/done"
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
        self._links = robot.links()
        self._chains = {side: robot.chain(self._links, name) for side, name in GRIP_BODY.items()}
        self._q: dict[str, float] = {}
        self._followed = 0.0
        self._trails: dict[str, deque[Array]] = {
            side: deque(maxlen=TRAIL_POINTS) for side in GRIP_BODY
        }
        sheet.static(PLANNED, rr.LineStrips3D.from_fields(colors=[ORANGE], radii=[0.004]))
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
        self._sheet.add(PLANNED, strips, at, paths)
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
