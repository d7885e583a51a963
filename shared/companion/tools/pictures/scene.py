"""The things in 3D: where the simulation truly has them, else where they were seen; grains; forces
of contact.

A truth without orientations (vessels' origins only, older recordings) gets the turn that was
observed last. Of what km believes there is a label on each thing, and a ghost where it believes a
thing that is elsewhere in truth; where nobody knows the truth there are no ghosts.
"""

import math
from collections import deque
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import rerun as rr

from companion.languages import wm
from companion.languages.values import Pose, Vector
from companion.models import KNOWN_AS, MODELS
from companion.telemetry import RobotState, TrueState
from companion.tools.pictures import robot, things
from companion.tools.pictures.velma import drawn
from companion.tools.report.believed import MOST_APART_MM, Belief, Beliefs
from companion.world.geometry import compose
from operate.pictures.sheet import (
    GHOST,
    HIDDEN,
    INK,
    RED,
    Sheet,
    arrows,
    labels,
    points,
    strips,
    transforms,
)
from operate.recording.happenings import Happening
from operate.recording.records import Spoken
from velma.model import tree
from velma.model.surfaces import Part
from velma.names import GRIP_BODY

# --- Looks of things in Rerun


PARTS = {"box": "boards", "cylinder": "rounds", "ellipsoid": "balls"}
Drawn = tuple[str, rr.AsComponents]


def looks(model: str, colour: tuple[float, ...] | None = None) -> list[Drawn]:
    """Named parts of a thing of this model, in its own frame; nothing for a model that nobody
    knows.

    `colour`: red, green, blue and opacity, 0 to 1, of all parts; None: its own.
    """
    found = things.looks(model, colour)
    if found.surface is not None:
        return [(found.surface.mesh, _mesh(found.surface, found.rgba))]
    kinds = {kind: [one for one in found.shapes if one.kind == kind] for kind in PARTS}
    return [(PARTS[kind], drawn(kind, some)) for kind, some in kinds.items() if some]


def _mesh(part: Part, colour: tuple[float, ...]) -> rr.Mesh3D:
    """A surface of revolution, with a normal for each corner of each face: edges of the outline
    stay sharp enough.
    """
    points, faces = things.triangles(part)
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    smooth = np.zeros_like(points)
    for corner in range(3):
        np.add.at(smooth, faces[:, corner], normals)
    length = np.linalg.norm(smooth, axis=1, keepdims=True)
    smooth /= np.where(length > 0, length, 1.0)
    return rr.Mesh3D(
        vertex_positions=points, triangle_indices=faces, vertex_normals=smooth, albedo_factor=colour
    )


# --- The things in 3D -----------------------------------------------------------------------------


THINGS, GRAINS = "world/things", "world/grains"


class Scene:
    """Draws the things. `poses`: where each was drawn last; `models`: of which model each is."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet = sheet
        self.poses: dict[str, Pose] = {}
        self._turns: dict[str, tuple[float, float, float, float]] = {}
        self.models: dict[str, str] = {}
        self._true: set[str] = set()
        self._grains: tuple[object, ...] = ()

    def take(self, happening: Happening) -> None:
        """Draw what moved."""
        match happening.what:
            case TrueState() as truth:
                self._truth(happening.at, truth)
            case Spoken(content=wm.SeenObject() as seen):
                self._turns[seen.object] = seen.pose.quat_wxyz
                if seen.object not in self._true:
                    self._place(happening.at, seen.object, seen.model, seen.pose)

    def _truth(self, at: float, truth: TrueState) -> None:
        upright = (1.0, 0.0, 0.0, 0.0)
        poses = {
            name: Pose(xyz, self._turns.get(name, upright)) for name, xyz in truth.at.items()
        } | truth.poses
        self._true.update(poses)
        for name, pose in poses.items():
            kind = truth.models.get(name, self.models.get(name, ""))
            self._place(at, name, KNOWN_AS.get(kind, kind), pose, truth.time_s)
        if truth.grains_at != self._grains:
            if not self._grains:
                self._sheet.static(
                    GRAINS,
                    rr.Points3D.from_fields(
                        radii=[things.GRAIN_RADIUS], colors=[things.GRAIN_RGBA]
                    ),
                )
            self._grains = truth.grains_at
            self._sheet.add(GRAINS, points, at, truth.grains_at, truth.time_s)

    def _place(
        self, at: float, name: str, model: str, pose: Pose, sim: float | None = None
    ) -> None:
        entity = f"{THINGS}/{name}"
        if model and self.models.get(name) != model:
            self.models[name] = model
            for part, drawn in looks(model):
                self._sheet.static(f"{entity}/{part}", drawn)
        if self.poses.get(name) != pose:
            self.poses[name] = pose
            self._sheet.add(entity, transforms, at, (pose.xyz, pose.quat_wxyz), sim)


CONTACTS = "world/contacts"
M_PER_N = 0.01
"""Length of a drawn force; estimate: what a hand squeezes with is as long as the hand."""


class Contacts:
    """Draws the forces between robot and things, as arrows on what is touched."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet = sheet
        self._any = False

    def take(self, happening: Happening) -> None:
        """Draw the forces; none, once, where there were some."""
        truth = happening.what
        if not isinstance(truth, TrueState) or not (truth.contacts or self._any):
            return
        if not self._any:
            self._sheet.static(CONTACTS, rr.Arrows3D.from_fields(colors=[RED], radii=[0.003]))
        self._any = bool(truth.contacts)
        origins = [contact.at for contact in truth.contacts]
        forces = [tuple(M_PER_N * x for x in contact.force_N) for contact in truth.contacts]
        self._sheet.add(CONTACTS, arrows, happening.at, (origins, forces), truth.time_s)


BELIEVED, LABELS, APART = "world/believed", "world/believed/labels", "world/believed/apart"
GHOSTLY = (*(part / 255 for part in GHOST), 0.45)
ABOVE_M = 0.3
"""Of a label over the origin of its thing; estimate: the jar, the tallest one that is taken, is
still seen below it.
"""
KEPT = 4
"""Number of states of the robot kept. Estimate: the truth is at most three periods of telemetry
old.
"""
SAME_S = 0.01
"""Between a state and the truth of the same moment; estimate: a hand moves by 4 mm."""
OFTEN_S, SELDOM_S = 0.2, 1.0
"""Between two drawings: when something has changed, and else, since labels count seconds. Estimates
for an eye.
"""


class Believed:
    """Draws what km believes, by what it was told."""

    def __init__(self, sheet: Sheet, scene: Scene) -> None:
        self._sheet, self._scene, self._beliefs = sheet, scene, Beliefs()
        links = tree.links()
        self._chains = {side: tree.chain(links, name) for side, name in GRIP_BODY.items()}
        self._states: deque[RobotState] = deque(maxlen=KEPT)
        self._q: dict[str, float] = {}
        self._true_s: float | None = None
        self._changed, self._drawn = False, 0.0
        self._ghosts: dict[str, Pose | None] = {}
        self._lines: list[tuple[Vector, Vector]] = []
        look = rr.Points3D.from_fields(radii=[0.003], colors=[INK], show_labels=True)
        sheet.static(LABELS, look)
        sheet.static(APART, rr.LineStrips3D.from_fields(colors=[GHOST], radii=[0.003]))

    def take(self, happening: Happening) -> None:
        """Note what km hears and how the robot stands; draw when it is time."""
        match happening.what:
            case RobotState() as state:
                self._states.append(state)
                if self._true_s is None:
                    self._stand(robot.joints(state))
            case TrueState(time_s=time_s):
                if time_s != self._true_s and self._states:
                    self._true_s = time_s
                    self._stand(joints_at(self._states, time_s))
            case Spoken() as one:
                self._changed |= self._beliefs.hear(one)
            case _:
                return
        if happening.at - self._drawn > (OFTEN_S if self._changed else SELDOM_S):
            self._changed, self._drawn = False, happening.at
            self._draw(happening.at)

    def _stand(self, q: dict[str, float]) -> None:
        """Note how the robot stands, at the time of the truth where there is one: what it holds
        moves along.
        """
        holds = any(self._beliefs.about(name).side for name in self._beliefs.objects)
        self._changed |= holds and q != self._q
        self._q = q

    def _draw(self, at: float) -> None:
        told, lines = [], []
        for name in sorted(self._beliefs.objects | set(self._scene.poses)):
            belief, here = self._beliefs.about(name), self._scene.poses.get(name)
            pose = self._pose(belief)
            off = 1000 * math.dist(pose.xyz, here.xyz) if pose and here else 0.0
            self._ghost(at, belief, pose if off > MOST_APART_MM else None)
            if pose and here and off > MOST_APART_MM:
                lines.append((pose.xyz, here.xyz))
            model = MODELS.get(belief.model or self._scene.models.get(name, ""))
            place = pose or here
            if place and (off > MOST_APART_MM or (model is not None and model.moveable)):
                x, y, z = place.xyz
                told.append(((x, y, z + ABOVE_M), label_text(belief, at, off)))
        self._sheet.add(LABELS, labels, at, told)
        if lines != self._lines:
            self._lines = lines
            self._sheet.add(APART, strips, at, lines)

    def _pose(self, belief: Belief) -> Pose | None:
        """T_world_thing; what is held goes where the hand is."""
        if belief.side is None or belief.in_grip is None:
            return belief.pose
        if not self._q:
            return None
        frames = robot.world_frames(self._chains[belief.side], self._q)
        return compose(frames[GRIP_BODY[belief.side]], belief.in_grip)

    def _ghost(self, at: float, belief: Belief, pose: Pose | None) -> None:
        entity = f"{BELIEVED}/{belief.object}"
        if self._ghosts.get(belief.object) == pose:
            return
        if belief.object not in self._ghosts:
            for part, drawn in looks(belief.model, GHOSTLY):
                self._sheet.static(f"{entity}/{part}", drawn)
            self._sheet.add(entity, transforms, self._sheet.begin, HIDDEN)
        self._ghosts[belief.object] = pose
        self._sheet.add(entity, transforms, at, (pose.xyz, pose.quat_wxyz) if pose else HIDDEN)


def joints_at(states: Sequence[RobotState], time_s: float) -> dict[str, float]:
    """The joints [rad] at a simulated time, between two of these states or in the last one; {}: not
    known.

    The newest truth is up to 0.1 s older than the newest state: a hand moves by 4 cm meanwhile.
    """
    for one, other in pairwise(states):
        if one.sim_time_s <= time_s < other.sim_time_s:
            share = (time_s - one.sim_time_s) / (other.sim_time_s - one.sim_time_s)
            before, after = robot.joints(one), robot.joints(other)
            return {
                name: q + share * (after[name] - q) for name, q in before.items() if name in after
            }
    return robot.joints(states[-1]) if abs(states[-1].sim_time_s - time_s) < SAME_S else {}


def label_text(belief: Belief, now: float, off_mm: float = 0.0) -> str:
    """The text of a label, a line for each part: how the thing is known, by whom and since when
    [unix s].

    `off_mm`: distance from the truth [mm]; the label has it above MOST_APART_MM.
    """
    sure = f", ± {1000 * belief.deviation:.1f} mm" if belief.deviation is not None else ""
    lines = [f"{belief.object}: {belief.how}{sure}"]
    if belief.told is not None:
        whole = int(max(now - belief.told.received, 0.0))
        ago = f"{whole} s" if whole < 120 else f"{whole // 60} min"
        lines.append(f"{ago} ago, told by {belief.told.sender}")
    if off_mm > MOST_APART_MM:
        lines.append(f"in truth {off_mm:.0f} mm away")
    return "\n".join(lines)
