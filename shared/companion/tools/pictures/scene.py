"""The things in 3D: where the simulation truly has them, else where they were seen; grains; forces of contact.

A truth without orientations (vessels' origins only, older recordings) gets the turn that was observed last.
"""

import rerun as rr

from companion.languages import wm
from companion.languages.values import Pose
from companion.models import KNOWN_AS
from companion.telemetry import TrueState
from companion.tools.pictures import things
from operate.pictures.colours import RED
from operate.pictures.happenings import Happening
from operate.pictures.sheet import Sheet, arrows, points, transforms
from operate.recording.records import Spoken

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
        poses = {name: Pose(xyz, self._turns.get(name, upright)) for name, xyz in truth.at.items()} | truth.poses
        self._true.update(poses)
        for name, pose in poses.items():
            kind = truth.models.get(name, self.models.get(name, ""))
            self._place(at, name, KNOWN_AS.get(kind, kind), pose, truth.time_s)
        if truth.grains_at != self._grains:
            if not self._grains:
                self._sheet.static(GRAINS, rr.Points3D.from_fields(radii=[GRAIN_RADIUS], colors=[GRAIN_COLOUR]))
            self._grains = truth.grains_at
            self._sheet.add(GRAINS, points, at, truth.grains_at, truth.time_s)

    def _place(self, at: float, name: str, model: str, pose: Pose, sim: float | None = None) -> None:
        entity = f"{THINGS}/{name}"
        if model and self.models.get(name) != model:
            self.models[name] = model
            for part, drawn in things.looks(model):
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
