"""The end that a plan imagines, as a ghost while it is carried out: arms, what is put down, what is
held.

It is known as far as the plan says it: arms after their last free motion. What ex solves itself
(approach, pouring) is not drawn.
"""

from companion.languages import hfsm, rc, sw
from companion.languages.values import Pose, Side
from companion.telemetry import RobotState
from companion.tools.pictures import robot, scene
from companion.tools.pictures.scene import Scene
from companion.tools.pictures.velma import entity, placed, shaped
from companion.world.geometry import compose, inverse
from operate.pictures.sheet import HIDDEN, PLANNED, Sheet, transforms
from operate.pictures.stage import Happening
from operate.recording.records import Spoken
from velma.names import ARM, BODY, COLUMNS, GRIP_BODY, START

IMAGINED = "world/imagined"
ROBOT, THINGS = f"{IMAGINED}/velma", f"{IMAGINED}/things"
PALE: robot.Four = (PLANNED[0] / 255, PLANNED[1] / 255, PLANNED[2] / 255, 0.3)
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
        frames = robot.world_frames(robot.links(), self.q)
        for side, (name, grip) in held.items():
            self.places[name] = compose(frames[GRIP_BODY[side]], inverse(grip))


class Imagined:
    """Draws the ghost when ta gets a plan, and takes it away when the plan has ended."""

    def __init__(self, sheet: Sheet, scene: Scene) -> None:
        self._sheet, self._scene = sheet, scene
        self._links = [link for link in robot.links() if not link.name.startswith("head")]
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
