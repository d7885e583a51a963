"""The things in 3D: where the simulation truly has them, else where they were seen; grains; forces
of contact.

A truth without orientations (vessels' origins only, older recordings) gets the turn that was
observed last.
"""

import numpy as np
import rerun as rr

from companion.languages import wm
from companion.languages.values import Box, Cylinder, Pose, Sphere
from companion.models import KNOWN_AS, MODELS
from companion.telemetry import TrueState
from companion.tools.pictures.velma import xyzw
from operate.pictures.sheet import RED, Sheet, arrows, points, transforms
from operate.pictures.stage import Happening
from operate.recording.records import Spoken
from velma.model.surfaces import MATERIALS, VESSELS, Part, turned

# --- Shapes of things in Rerun: smooth vessels of velma/model/surfaces.py, else the shapes that km
# knows them by


# Names of companion.models -> those of the drawn surfaces, where they differ.
SURFACES = {"bowl_high": "bowl"}
# How a model's shapes are drawn that has no surface of its own: a colour, and a thinner one for
# what hides the story.
COLOURS = {"table": MATERIALS["wood_light"][0], "cabinet": MATERIALS["wood_thin"][0]}
OTHER = (0.62, 0.64, 0.66, 1.0)
Drawn = tuple[str, rr.AsComponents]


def looks(model: str, colour: tuple[float, ...] | None = None) -> list[Drawn]:
    """Named parts of a thing of this model, in its own frame; nothing for a model that nobody
    knows.

    `colour`: red, green, blue and opacity, 0 to 1, of all parts; None: its own.
    """
    vessel = VESSELS.get(SURFACES.get(model, model))
    if vessel is not None:
        return [(vessel.mesh, _mesh(vessel, colour or MATERIALS[vessel.material][0]))]
    if model not in MODELS:
        return []
    fitting = (rgba for kind, rgba in COLOURS.items() if model.startswith(kind))
    colour = colour or next(fitting, OTHER)
    shapes = MODELS[model].shapes
    boxes = [shape for shape in shapes if isinstance(shape, Box)]
    round_ones = [shape for shape in shapes if isinstance(shape, Cylinder)]
    balls = [shape for shape in shapes if isinstance(shape, Sphere)]
    parts: list[Drawn] = []
    if boxes:
        at = [box.at.xyz for box in boxes]
        turns = [xyzw(box.at.quat_wxyz) for box in boxes]
        sizes = [box.size for box in boxes]
        boards = rr.Boxes3D(
            sizes=sizes, centers=at, quaternions=turns, colors=[colour], fill_mode="solid"
        )
        parts.append(("boards", boards))
    if round_ones:
        rounds = rr.Cylinders3D(
            lengths=[one.length for one in round_ones],
            radii=[one.radius for one in round_ones],
            centers=[one.at.xyz for one in round_ones],
            quaternions=[xyzw(one.at.quat_wxyz) for one in round_ones],
            colors=[colour],
            fill_mode="solid",
        )
        parts.append(("rounds", rounds))
    if balls:
        at, radii = [ball.at.xyz for ball in balls], [ball.radius for ball in balls]
        parts.append(
            ("balls", rr.Ellipsoids3D(radii=radii, centers=at, colors=[colour], fill_mode="solid"))
        )
    return parts


def _mesh(part: Part, colour: tuple[float, ...]) -> rr.Mesh3D:
    """A surface of revolution, with a normal for each corner of each face: edges of the outline
    stay sharp enough.
    """
    words = turned(part.outline)
    points = np.array(words["vertex"].split(), dtype=np.float64).reshape(-1, 3)
    faces = np.array(words["face"].split(), dtype=np.int64).reshape(-1, 3)
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
GRAIN_RADIUS = 0.008  # velma/model/objects.yaml
GRAIN_COLOUR = (245, 184, 41)


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
                    GRAINS, rr.Points3D.from_fields(radii=[GRAIN_RADIUS], colors=[GRAIN_COLOUR])
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
