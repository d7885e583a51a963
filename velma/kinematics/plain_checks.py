"""Checks of the collision world where there is no library of velma.compiled: by Pinocchio's broad phase and coal."""

from collections.abc import Sequence
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from velma.names import Array, Columns


class PlainChecks:
    """As `near.Near`, slower. `angle` (n,) [rad]: of all joints; `columns` (15,): those of a posture among them."""

    def __init__(self, model: Any, angle: Array, columns: Columns, solids: Sequence[Any], pairs: Columns) -> None:
        """Of coal's shapes, the pairs (2, m)."""
        self.solids, self.pairs = solids, pairs
        self._model, self._data, self._angle, self._columns = model, model.createData(), angle, columns
        self._shapes = pin.GeometryModel()
        for shape in solids:
            self._shapes.addGeometryObject(pin.GeometryObject("", 0, 0, pin.SE3.Identity(), shape))
        self._shapes.setCollisionPairs(self._whole(np.ones(pairs.shape[1], dtype=bool)), True)
        self._placed = self._shapes.createData()
        self._stop = pin.CollisionCallBackDefault(self._shapes, self._placed, True)
        self._margin: float | None = None
        self._active: Array | None = None

    def _whole(self, wanted: Array) -> Array:
        """Return which shapes are compared (n, n) where these pairs are wanted (m,)."""
        meets = np.zeros((len(self.solids), len(self.solids)), dtype=bool)
        first, second = self.pairs[:, wanted]
        meets[first, second] = meets[second, first] = True
        return meets

    def among(self, wanted: Array) -> Array:
        """Return those of the pairs that are `wanted` (m,)."""
        return np.array(wanted)

    def mount(self, shape: int, joint: int, pose: Any) -> None:
        """Fix a shape to a joint, 0 the world, at T_joint_shape."""
        one = self._shapes.geometryObjects[shape]
        one.parentJoint, one.placement = joint, pose

    def at(self, shape: int) -> Any:
        """Return T_world_shape, as coal has it, in the posture looked at last."""
        pose = self._placed.oMg[shape]
        return coal.Transform3s(pose.rotation, pose.translation)

    def free(self, among: Array, margin: float, q: Array) -> bool:
        """Whether no pair is nearer than the margin [m]; False where an angle is not finite."""
        if not np.isfinite(q).all():
            return False
        self._keep_apart(margin)
        if among is not self._active:
            self._active = among
            self._placed.setActiveCollisionPairs(self._shapes, self._whole(among), True)
        self._place(q)
        self._broad.update(False)
        return not pin.computeCollisions(self._broad, self._stop)

    def first(self, among: Array, margin: float, postures: Array, free: bool) -> int:
        """Return the number of the first posture (n, 15) that is free, or is not; n if there is none."""
        verdicts = (self.free(among, margin, q) is free for q in postures)
        return next((k for k, found in enumerate(verdicts) if found), len(postures))

    def close(self, among: Array, margin: float, q: Array) -> list[int]:
        """Return the numbers of pairs that are nearer than the margin, in order."""
        self._keep_apart(margin)
        self._place(q)
        return [k for k in np.flatnonzero(among).tolist() if pin.computeCollision(self._shapes, self._placed, k)]

    def _keep_apart(self, margin: float) -> None:
        """Have shapes meet that are nearer than the margin. Of Pinocchio's broad phases all boxes are quickest here."""
        if margin != self._margin:
            self._margin = margin
            self._placed.setSecurityMargins(self._shapes, np.full(2 * (len(self.solids),), margin), True, True)
            self._broad = pin.BroadPhaseManager_NaiveCollisionManager(self._model, self._shapes, self._placed)

    def _place(self, q: Array) -> None:
        self._angle[self._columns] = q
        pin.updateGeometryPlacements(self._model, self._data, self._shapes, self._placed, self._angle)
