"""Forward kinematics of torso and arms by Pinocchio, from the robot file that MuJoCo simulates.

The 15 body joints in the order of `velma.names.BODY` are the configuration q; fingers and head are locked. Grip
frames are frames of *bodies*: Pinocchio 4.1 misplaces a site behind several welded bodies. Knows no scene.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from velma import names
from velma.kinematics.chain import chain
from velma.names import Array

ROBOT_XML = Path(__file__).parents[1] / "model" / "robot.xml"
_WORLD_AXES = pin.LOCAL_WORLD_ALIGNED


class FrameMissing(LookupError):
    """The model has no body of that name."""

    def __init__(self, frame: str, bodies: list[str]) -> None:
        self.frame, self.bodies = frame, bodies
        super().__init__(f"the model has no body {frame!r}; its bodies are {', '.join(bodies)}")


def body_frame(model: Any, body: str) -> int:
    """Return index of the frame of a body (not of the joint or site that may share its name)."""
    for index, frame in enumerate(model.frames):
        if frame.name == body and frame.type == pin.FrameType.BODY:
            return index
    raise FrameMissing(body, [f.name for f in model.frames if f.type == pin.FrameType.BODY])


def locked_to(full: Any, joints: tuple[str, ...]) -> Any:
    """`full` with every joint but `joints` fixed at zero; raises `names.JointsDiffer` on another order."""
    others = [full.getJointId(name) for name in list(full.names)[1:] if name not in joints]
    model = pin.buildReducedModel(full, others, pin.neutral(full))
    names.check_joints("the robot model", list(model.names)[1:], joints)
    return model


class Robot:
    """Forward kinematics of the 15 body joints; not thread-safe."""

    def __init__(self, path: Path | str = ROBOT_XML) -> None:
        self.path = Path(path)
        full = pin.buildModelFromMJCF(str(path))
        self.model = locked_to(full, names.BODY)
        self.data = self.model.createData()
        self.lower, self.upper, self.speed = names.LOWER, names.UPPER, names.SPEED
        self.frame = {side: body_frame(self.model, names.GRIP_BODY[side]) for side in names.SIDES}
        self.chain = {side: chain(self.model, self.frame[side]) for side in names.SIDES}
        self._sight = locked_to(full, (names.BODY[names.TORSO], *names.HEAD))
        self._sight_data = self._sight.createData()
        self._camera = body_frame(self._sight, names.CAMERA_BODY)

    def grip(self, q: Array, side: str) -> Any:
        """Return T_world_grip (`pin.SE3`, a copy) of the hand of `side` at q (15,) [rad]; z is the approach axis."""
        pin.forwardKinematics(self.model, self.data, q)
        return pin.updateFramePlacement(self.model, self.data, self.frame[side]).copy()

    def track(self, postures: Array, side: str) -> Array:
        """Return the positions (n, 3) [m] of the grip of `side` in postures (n, 15)."""
        compiled = self.chain[side]
        if compiled is not None:
            return compiled.track(postures)
        model, data, frame = self.model, self.data, self.frame[side]
        places = np.empty((len(postures), 3))
        for k, q in enumerate(postures):
            pin.forwardKinematics(model, data, q)
            places[k] = pin.updateFramePlacement(model, data, frame).translation
        return places

    def upward(self, side: str, direction: Array) -> Callable[[Array], Array]:
        """Return the function from postures (n, 15) to the upward parts (n,) of a direction (3,) fixed to a grip."""
        compiled = self.chain[side]
        if compiled is not None:
            return compiled.upward(direction)
        return lambda postures: np.array([self.grip(q, side).rotation[2] @ direction for q in postures])

    def jacobian(self, q: Array, side: str) -> Array:
        """Return J (6, 15): joint speeds [rad/s] to velocity [m/s] and rotation [rad/s] of the grip, world axes."""
        return np.asarray(pin.computeFrameJacobian(self.model, self.data, q, self.frame[side], _WORLD_AXES))

    def camera(self, torso: float, pan: float, tilt: float) -> Any:
        """Return T_world_camera (`pin.SE3`) of the Kinect's optical frame: z forward, x right; angles in rad."""
        pin.forwardKinematics(self._sight, self._sight_data, np.array([torso, pan, tilt]))
        return pin.updateFramePlacement(self._sight, self._sight_data, self._camera).copy()


def between(start: Any, end: Any, count: int) -> list[Any]:
    """Return `count` poses on the straight line and shortest rotation from `start` (excluded) to `end` (included)."""
    turn = pin.log3(end.rotation @ start.rotation.T)
    way = end.translation - start.translation
    return [
        pin.SE3(pin.exp3(turn * s) @ start.rotation, start.translation + s * way)
        for s in np.linspace(0.0, 1.0, count + 1)[1:]
    ]
