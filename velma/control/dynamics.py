"""The rigid-body terms of the control laws: mass matrix, Jacobians and poses of both grip frames.

The only module of this package with a model in it (Pinocchio, reduced to the 15 body joints, hands
and head fixed at zero). Sides are rows: 0 right, 1 left. Frames are those of the grip BODIES:
Pinocchio 4.1 misplaces sites behind a chain of welded bodies.
"""

from pathlib import Path

import msgspec
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from velma.names import BODY, GRIP_BODY, SIDES, check_joints

Array = NDArray[np.float64]


class Terms(msgspec.Struct):
    """Terms at one state. Arrays belong to Dynamics, whose next call overwrites them.

    `mass` (15, 15) kg m2 with armature; `jacobian` (12, 15), rows 0-5 right and 6-11 left, linear
    before angular, of the grip frame's origin in world axes; `rotation` (2, 3, 3) and `position`
    (2, 3) of T_world_grip.
    """

    mass: Array
    jacobian: Array
    rotation: Array
    position: Array


class Dynamics:
    """Velma's body from an MJCF file that holds the robot alone."""

    def __init__(self, robot_xml: Path) -> None:
        full = pin.buildModelFromMJCF(str(robot_xml))
        fixed = [full.getJointId(name) for name in list(full.names)[1:] if name not in BODY]
        self.model = pin.buildReducedModel(full, fixed, pin.neutral(full))
        check_joints(str(robot_xml), list(self.model.names)[1:])
        self._data, self._goal = self.model.createData(), self.model.createData()
        self._grips = [self.model.getFrameId(GRIP_BODY[side], pin.FrameType.BODY) for side in SIDES]
        self._terms = Terms(np.eye(15), np.zeros((12, 15)), np.zeros((2, 3, 3)), np.zeros((2, 3)))
        self._goal_rotation, self._goal_position = np.zeros((2, 3, 3)), np.zeros((2, 3))
        self._lower = np.tril_indices(15, -1)

    def terms(self, q: Array) -> Terms:
        """Return mass matrix, Jacobians and grip poses at `q` (15,)."""
        model, data, terms = self.model, self._data, self._terms
        pin.crba(model, data, q)
        pin.computeJointJacobians(model, data, q)
        mass = terms.mass
        mass[:] = data.M
        mass[self._lower] = mass.T[self._lower]
        for row, frame in enumerate(self._grips):
            pose = pin.updateFramePlacement(model, data, frame)
            terms.rotation[row], terms.position[row] = pose.rotation, pose.translation
            terms.jacobian[6 * row : 6 * row + 6] = pin.getFrameJacobian(
                model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )
        return terms

    def grips(self, q: Array) -> tuple[Array, Array]:
        """Return rotation (2, 3, 3) and position (2, 3) of the grip frames at `q`, apart from
        `terms`.
        """
        pin.forwardKinematics(self.model, self._goal, q)
        for row, frame in enumerate(self._grips):
            pose = pin.updateFramePlacement(self.model, self._goal, frame)
            self._goal_rotation[row], self._goal_position[row] = pose.rotation, pose.translation
        return self._goal_rotation, self._goal_position
