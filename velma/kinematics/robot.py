"""Forward kinematics of torso and arms by Pinocchio, from the robot file that MuJoCo simulates.

The 15 body joints in the order of `velma.names.BODY` are the configuration q; fingers and head are
locked. Grip frames are frames of *bodies*: Pinocchio 4.1 misplaces a site behind several welded
bodies. Knows no scene.
"""

import ctypes
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import eigenpy
import numpy as np
import pinocchio as pin

from velma import names
from velma.compiled import fields, library
from velma.names import Array, Columns

# --- Torso and one arm, as chain.c of velma.compiled computes with them and as Pinocchio does. Must
# not know: scenes, sampling, comfort


_MOST, ALL = 16, 15  # joints; columns of a posture; as in chain.c
_WORLD_AXES = pin.LOCAL_WORLD_ALIGNED


class _Chain(ctypes.Structure):
    """As in chain.c."""

    _fields_ = fields((ctypes.c_int, "joints"), (ctypes.c_void_p, "placed axis column"))


class _Limits(ctypes.Structure):
    """As in chain.c."""

    _fields_ = fields(
        (ctypes.c_int, "iterations"),
        (ctypes.c_double, "near turned damping largest_turn largest_error"),
        (ctypes.c_void_p, "lower upper moves"),
    )


class Limits:
    """Of `Chain.solve`: iterations, tolerances [m], [rad], damping, steps [rad] and errors at most,
    joints' limits.

    `lower`, `upper`: (15,) [rad]; `columns`: those of a posture that may move.
    """

    def __init__(self, numbers: Sequence[float], lower: Array, upper: Array, columns: Any) -> None:
        moves = np.zeros(len(lower), dtype=np.uint8)
        moves[columns] = 1
        self.numbers, self.lower, self.upper, self.columns = numbers, lower, upper, columns
        self._arrays = np.array(lower), np.array(upper), moves
        self.itself = _Limits(*numbers, *(array.ctypes.data for array in self._arrays))


class Chain:
    """The hinges from the world to a frame; postures are (15,) [rad]."""

    def __init__(self, built: ctypes.CDLL, model: Any, frame: int) -> None:
        joints: list[int] = []
        joint = model.frames[frame].parentJoint
        while joint:
            joints.insert(0, joint)
            joint = model.parents[joint]
        placed = [*(model.jointPlacements[k] for k in joints), model.frames[frame].placement]
        self._arrays = (
            np.array([[*pose.rotation.ravel(), *pose.translation] for pose in placed]),
            np.array([axis(model.joints[k]) for k in joints]),
            np.array([model.joints[k].idx_q for k in joints], dtype=np.int32),
        )
        if len(joints) > _MOST:
            raise ValueError(
                f"a chain of {len(joints)} joints, expected at most {_MOST}"
                " (velma/compiled/chain.c)"
            )
        self._chain = _Chain(len(joints), *(array.ctypes.data for array in self._arrays))
        self._itself = ctypes.byref(self._chain)
        self._track, self._solve, self._times, self._upward, self._line = _declared(built)

    def track(self, postures: Array) -> Array:
        """Return the positions (n, 3) [m] of the frame in postures (n, 15)."""
        given = np.ascontiguousarray(postures, dtype=np.float64)
        places = np.empty((len(postures), 3))
        self._track(self._itself, given.ctypes.data, len(given), places.ctypes.data)
        return places

    def upward(self, direction: Array) -> Callable[[Array], Array]:
        """Return the function from postures (n, 15) to the upward parts (n,) of a direction (3,)
        fixed to the frame.
        """
        along, one, part = np.array(direction, dtype=np.float64), np.empty(ALL), np.empty(1)
        single = one.ctypes.data, 1, along.ctypes.data, part.ctypes.data

        def parts(postures: Array) -> Array:
            # as a tree asks: numpy takes as long to tell an address as all the rest
            if len(postures) == 1:
                one[:] = postures[0]
                self._upward(self._itself, *single)
                return part.copy()
            given, found = np.ascontiguousarray(postures, dtype=np.float64), np.empty(len(postures))
            self._upward(
                self._itself, given.ctypes.data, len(given), along.ctypes.data, found.ctypes.data
            )
            return found

        return parts

    def times(
        self, q: Array, path: Array, columns: Columns, tool_speed: float, speed: Array
    ) -> Array:
        """Return the time (n - 1,) [s] of each step of a path (n, m) of some columns of q (15,):
        the frame at `tool_speed` [m/s], the columns at `speed` (m,) [rad/s].
        """
        arrays = [np.ascontiguousarray(one, dtype=np.float64) for one in (q, path, speed)]
        which, found = columns.astype(np.int32), np.empty(max(len(path) - 1, 0))
        given, along, fastest = (array.ctypes.data for array in arrays)
        words = len(path), len(columns), which.ctypes.data, tool_speed, fastest, found.ctypes.data
        self._times(self._itself, given, along, *words)
        return found

    def line(
        self, start: Any, target: Any, count: int, q: Array, limits: Limits, jump: float
    ) -> tuple[list[Array], bool]:
        """Return postures near q (15,) with the frame straight on from `start` to `target`, up to
        `count`; whether the last one is farther than `jump` [rad] from the one before.
        """
        path, given, jumps = np.empty((count, ALL)), np.array(q, dtype=np.float64), ctypes.c_int()
        ends = [
            (ctypes.c_double * 12)(*pose.rotation.ravel(), *pose.translation)
            for pose in (start, target)
        ]
        words = count, jump, given.ctypes.data, path.ctypes.data, ctypes.byref(jumps)
        solved = self._line(self._itself, ctypes.byref(limits.itself), *ends, *words)
        return list(path[:solved]), bool(jumps.value)

    def solve(self, target: Any, q: Array, limits: Limits) -> Array | None:
        """Return a posture near q with the frame at `target`; None if the iterations do not get
        there.
        """
        found = np.array(q, dtype=np.float64)
        goal = (ctypes.c_double * 12)(*target.rotation.ravel(), *target.translation)
        return (
            found
            if self._solve(self._itself, ctypes.byref(limits.itself), goal, found.ctypes.data)
            else None
        )


def _declared(built: ctypes.CDLL) -> tuple[Any, ...]:
    """Return the library's functions of a chain."""
    address, count, number = ctypes.c_void_p, ctypes.c_int, ctypes.c_double
    track, solve, times = built.chain_track, built.chain_solve, built.chain_times
    upward, line = built.chain_upward, built.chain_line
    track.argtypes, track.restype = [address, address, count, address], None
    solve.argtypes, solve.restype = [address, address, address, address], count
    times.argtypes = [address, address, address, count, count, address, number, address, address]
    upward.argtypes = [address, address, count, address, address]
    line.argtypes = [address, address, address, address, count, number, address, address, address]
    times.restype, upward.restype, line.restype = None, None, count
    return track, solve, times, upward, line


class PlainChain:
    """As Chain, by Pinocchio, slower."""

    def __init__(self, model: Any, frame: int) -> None:
        self._model, self._data, self._frame = model, model.createData(), frame

    def _pose(self, q: Array) -> Any:
        pin.forwardKinematics(self._model, self._data, q)
        return pin.updateFramePlacement(self._model, self._data, self._frame)

    def track(self, postures: Array) -> Array:
        """Return the positions (n, 3) [m] of the frame in postures (n, 15)."""
        places = np.empty((len(postures), 3))
        for k, q in enumerate(postures):
            places[k] = self._pose(q).translation
        return places

    def upward(self, direction: Array) -> Callable[[Array], Array]:
        """Return the function from postures (n, 15) to the upward parts (n,) of a direction."""
        return lambda postures: np.array([self._pose(q).rotation[2] @ direction for q in postures])

    def times(
        self, q: Array, path: Array, columns: Columns, tool_speed: float, speed: Array
    ) -> Array:
        """Return the time (n - 1,) [s] of each step of a path (n, m) of some columns of q (15,)."""
        postures = np.tile(q, (len(path), 1))
        postures[:, columns] = path
        moved = np.linalg.norm(np.diff(self.track(postures), axis=0), axis=1) / tool_speed
        turned = np.abs(np.diff(path, axis=0)) / speed
        return np.asarray(np.maximum(moved, turned.max(axis=1)))

    def line(
        self, start: Any, target: Any, count: int, q: Array, limits: Limits, jump: float
    ) -> tuple[list[Array], bool]:
        """Return postures near q (15,) on the straight line; whether the last one jumps."""
        path = [q]
        for pose in between(start, target, count):
            following = self.solve(pose, path[-1], limits)
            if following is None:
                break
            path.append(following)
            if np.abs(following - path[-2]).max() > jump:
                return path[1:], True
        return path[1:], False

    def solve(self, target: Any, q: Array, limits: Limits) -> Array | None:
        """Return a posture near q with the frame at `target`, by damped least squares; None if the
        iterations do not get there.
        """
        iterations, near, turned, damping, largest_turn, largest_error = limits.numbers
        model, data, columns = self._model, self._data, limits.columns
        lower, upper = limits.lower[columns], limits.upper[columns]
        error, q = np.empty(6), q.copy()
        for _ in range(int(iterations)):
            pin.computeJointJacobians(model, data, q)
            here = pin.updateFramePlacement(model, data, self._frame)
            error[:3] = target.translation - here.translation
            error[3:] = pin.log3(target.rotation @ here.rotation.T)
            size = np.abs(error)
            if size[:3].max() < near and size[3:].max() < turned:
                return q
            jacobian = pin.getFrameJacobian(model, data, self._frame, _WORLD_AXES).take(columns, 1)
            square = jacobian @ jacobian.T
            square.ravel()[::7] += damping
            part = np.minimum(np.maximum(error, -largest_error), largest_error)
            change = eigenpy.LLT(square).solve(part) @ jacobian
            largest = max(change.max(), -change.min())
            if largest > largest_turn:
                change = change * (largest_turn / largest)
            q[columns] = np.minimum(np.maximum(q.take(columns) + change, lower), upper)
        return None


def chain(model: Any, frame: int) -> Chain | PlainChain:
    """Return the chain to a frame of a model whose joints are hinges."""
    built = library()
    return PlainChain(model, frame) if built is None else Chain(built, model, frame)


def axis(joint: Any) -> Array:
    """Return the axis (3,) of a hinge in its own frame."""
    data = joint.createData()
    joint.calc(data, np.zeros(joint.idx_q + joint.nq))
    return np.asarray(data.S).ravel()[3:]


# --- Forward kinematics of torso and arms by Pinocchio, from the robot file that MuJoCo simulates -


ROBOT_XML = Path(__file__).parents[1] / "model" / "robot.xml"


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
    """`full` with every joint but `joints` fixed at zero; raises `names.JointsDiffer` on another
    order.
    """
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
        """Return T_world_grip (`pin.SE3`, a copy) of the hand of `side` at q (15,) [rad]; z is the
        approach axis.
        """
        pin.forwardKinematics(self.model, self.data, q)
        return pin.updateFramePlacement(self.model, self.data, self.frame[side]).copy()

    def camera(self, torso: float, pan: float, tilt: float) -> Any:
        """Return T_world_camera (`pin.SE3`) of the Kinect's optical frame: z forward, x right;
        angles in rad.
        """
        pin.forwardKinematics(self._sight, self._sight_data, np.array([torso, pan, tilt]))
        return pin.updateFramePlacement(self._sight, self._sight_data, self._camera).copy()


def between(start: Any, end: Any, count: int) -> list[Any]:
    """Return `count` poses on the straight line and shortest rotation from `start` (excluded) to
    `end` (included).
    """
    turn = pin.log3(end.rotation @ start.rotation.T)
    way = end.translation - start.translation
    return [
        pin.SE3(pin.exp3(turn * s) @ start.rotation, start.translation + s * way)
        for s in np.linspace(0.0, 1.0, count + 1)[1:]
    ]
