"""Cartesian impedance of both hands together: the torso and two arms as one 15-joint system with a
12-dimensional task.

The law of Velma's core (RCPRG common_controllers, cartesian_impedance.h; Albu-Schaeffer and Ott)
with four changes that pouring runs needed: the full mass matrix instead of three blocks, the true
rotation vector as error (Velma uses a quaternion part, which is half of it), velocity feed-forward,
and a posture spring in the null space.

    e_i   = [p_des - p ; log(R_des R^T)]                            world axes, at grip i
    Lam   = (J M^-1 J^T + r I)^-1
    D_i   = Q_i diag(2 zeta sqrt(w)) Q_i^T,  Lam_ii = Q_i Q_i^T,  K = Q_i diag(w) Q_i^T
    tau   = J^T (K e - D J (v - v_des) + h)  +  N^T (Kn (q_des - q) - Dn (v - v_des))
    N^T   = I - J^T Lam J M^-1                                      dynamically consistent
    h_i   = [m g ; (R_i r) x m g]                          upwards: the weight of a held thing

Closed loop in the task: Lam e'' + D e' + K e = external wrench, since the drives already hold the
robot's own weight. All torques are beyond gravity. Functions are pure; sides are rows (0 right, 1
left), 12-vectors are (right, left).
"""

import ctypes
import math
from collections.abc import Callable, Mapping
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from velma import ranges
from velma.compiled import library
from velma.control.dynamics import Terms
from velma.ranges import Cycles, DampingRatio, Stiffness, Viscosity

Array = NDArray[np.float64]

GRAVITY = 9.81  # m/s2
REGULARISATION = 1e-3
"""r [1/kg, 1/(kg m2)]: gives directions in which a hand can hardly move to the posture spring.
Elsewhere J M^-1 J^T is 0.04 and more; with a straight elbow it is 0.0006. With r = 1e-6 no spring
held the elbow on its way through there, and an arm bent to the other side than its set-point (0.4
rad off in the test; in a run 2 rad, until it was too fast). With 1e-3 it is 0.1 rad off, and a hand
is up to 10 % stiffer than K (0.3 % in the median of 900 pushes at 300 postures).
"""


class CartesianGains(msgspec.Struct, frozen=True):
    """Gains of the law. Stiffness is Velma's default (velma_system), the others are estimates from
    pouring runs.

    Damping ratio: Velma's 0.35 acts as 0.175, which overshoots a step by half; 0.7 is the textbook
    value.
    """

    stiffness: tuple[Stiffness, Stiffness] = (1500.0, 150.0)  # N/m, Nm/rad
    damping_ratio: DampingRatio = 0.7
    posture_stiffness: tuple[Stiffness, Stiffness] = (400.0, 20.0)  # torso, arm joints, Nm/rad
    posture_damping: tuple[Viscosity, Viscosity] = (120.0, 4.0)  # torso, arm joints, Nms/rad
    # cycles between two damping designs: it changes as slowly as the posture
    renewed_every: Cycles = 5

    def task(self) -> Array:
        """Return diagonal of K, (6,)."""
        linear, angular = self.stiffness
        return np.array([linear] * 3 + [angular] * 3)

    def posture(self) -> tuple[Array, Array]:
        """Return Kn and Dn, (15,) each."""
        (kt, ka), (dt, da) = self.posture_stiffness, self.posture_damping
        return np.array([kt] + [ka] * 14), np.array([dt] + [da] * 14)


def rotation_vector(rotation: Array) -> Array:
    """Return log(R), (3,) rad, for R (3, 3). At half a turn the sign of the axis is arbitrary."""
    # Plain floats: six of these a cycle cost less than one small array.
    (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
    x, y, z = h - f, c - g, d - b
    length, cosine = 0.5 * math.sqrt(x * x + y * y + z * z), 0.5 * (a + e + i - 1.0)
    angle = math.atan2(length, cosine)
    if length > 1e-8 or cosine > 0:
        scale = 0.5 * angle / length if length > 1e-8 else 0.5
        return np.array((scale * x, scale * y, scale * z))
    # Half a turn: R = 2 a a^T - I, the axis is the longest column of R + I.
    outer = rotation + np.eye(3)
    axis = outer[:, int(np.argmax(np.diag(outer)))]
    return np.asarray(math.pi * axis / math.sqrt(axis @ axis))


def task_error(terms: Terms, goal_rotation: Array, goal_position: Array) -> Array:
    """Return e (12,): m and rad in world axes, for goals (2, 3, 3) and (2, 3)."""
    error = np.empty(12)
    for row in (0, 1):
        error[6 * row : 6 * row + 3] = goal_position[row] - terms.position[row]
        error[6 * row + 3 : 6 * row + 6] = rotation_vector(
            goal_rotation[row] @ terms.rotation[row].T
        )
    return error


def task_inertia(jacobian: Array, inverse_mass: Array) -> tuple[Array, Array]:
    """Return Lam (12, 12) and J M^-1 (12, 15), for J (12, 15) and M^-1 (15, 15)."""
    through = jacobian @ inverse_mass
    mobility = through @ jacobian.T
    mobility[np.diag_indices(12)] += REGULARISATION
    inertia: Array = np.asarray(np.linalg.inv(mobility), dtype=np.float64)
    return inertia, through


def damping(inertia: Array, stiffness: Array, ratio: float) -> Array:
    """Return D (n, n), symmetric and positive semi-definite: every mode of (inertia, stiffness) is
    damped by `ratio`.

    `inertia` (n, n) is positive definite, `stiffness` (n,) the diagonal of K. With D, inertia = Q
    Q^T and K = Q diag(w) Q^T are diagonal in the same coordinates: x'' + 2 ratio sqrt(w) x' + w x =
    0 in each.
    """
    lower = np.linalg.cholesky(inertia)
    inverse = np.linalg.inv(lower)
    w, modes = np.linalg.eigh((inverse * stiffness) @ inverse.T)
    q = lower @ modes
    return np.asarray((q * (2.0 * ratio * np.sqrt(np.maximum(w, 0.0)))) @ q.T)


def task_damping(inertia: Array, stiffness: Array, ratio: float) -> Array:
    """Return D (12, 12), block diagonal: each hand's own inertia block (6, 6) is damped."""
    out = np.zeros((12, 12))
    for block in (slice(0, 6), slice(6, 12)):
        out[block, block] = damping(inertia[block, block], stiffness, ratio)
    return out


def payload_wrench(rotation: Array, mass: Array, lever: Array) -> Array:
    """Return h (12,): force and moment at the grips that carry masses (2,) kg at levers (2, 3) m in
    the grip frames.
    """
    wrench = np.zeros(12)
    for row in (0, 1):
        weight = mass[row] * GRAVITY
        if weight:
            arm = rotation[row] @ lever[row]
            wrench[6 * row + 2] = weight
            wrench[6 * row + 3], wrench[6 * row + 4] = arm[1] * weight, -arm[0] * weight
    return wrench


def null_space(torque: Array, jacobian: Array, through: Array, inertia: Array) -> Array:
    """Return N^T torque (15,): the part of a torque that does not accelerate the hands."""
    return np.asarray(torque - jacobian.T @ (inertia @ (through @ torque)))


# --- Memory that is shared with velma.compiled ----------------------------------------------------


Shapes = Mapping[str, tuple[int, ...]]


class Record:
    """Memory that C code of velma.compiled and numpy read and write: a struct of doubles.

    `values`: all of it; `part`: arrays of these shapes, in the order of the C struct; `at`: its
    address.
    """

    def __init__(self, shapes: Shapes, values: Any = None) -> None:
        """`values`: of another record of these shapes, which are taken over; None: zeros."""
        kind = np.dtype([(name, np.float64, shape) for name, shape in shapes.items()])
        self._shapes = shapes
        self.values: Any = np.zeros((), kind) if values is None else values
        self.part: dict[str, Array] = {name: self.values[name] for name in shapes}
        self.at = ctypes.c_void_p(self.values.ctypes.data)

    def take(self, saved: bytes) -> None:
        """Take the bytes of another record of these shapes."""
        self.values[...] = np.frombuffer(saved, dtype=self.values.dtype).reshape(())

    def __reduce__(self) -> tuple[Any, ...]:
        return Record, (self._shapes, self.values.copy())


# --- The same as torque.c and error.c of velma.compiled compute it --------------------------------

_LAW = {
    "mass": (15, 15), "jacobian": (12, 15), "error": (12,), "slip": (15,), "stray": (15,),
    "wrench": (12,),
    "stiffness": (12,), "posture_stiffness": (15,), "posture_damping": (15,),
    "regularisation": (1,),
    "twice_ratio": (1,), "damping": (12, 12), "inertia": (12, 12), "through": (12, 15),
    "torque": (15,),
}  # fmt: skip
"""As in torque.c."""
_ERROR = {
    "rotation": (2, 3, 3), "position": (2, 3), "goal_rotation": (2, 3, 3), "goal_position": (2, 3),
    "error": (12,),
}  # fmt: skip
"""As in error.c."""
_NO_INVERSE = "the mass matrix of the body or of its hands is not positive definite"


class _Law:
    """The torque law of both hands: what it acts on, its three calls."""

    def __init__(self, built: ctypes.CDLL, record: Record) -> None:
        self._record, self._part, self._at = record, record.part, record.at
        self._inertia = built.law_inertia
        self._design = built.law_damping
        self._torque = built.law_torque
        self._inertia.restype = ctypes.c_int
        self._design.restype = ctypes.c_int
        self._torque.restype = None

    def __reduce__(self) -> tuple[Any, ...]:
        return _law, (self._record,)

    def set(self, **parts: Array | float) -> None:
        """Write parts that stay: stiffness, posture_stiffness, posture_damping, regularisation,
        twice_ratio.
        """
        for name, value in parts.items():
            self._part[name][:] = value

    def inertia(self, terms: Terms, error: Array, slip: Array, stray: Array, wrench: Array) -> None:
        """Take what the law acts on; compute Lam (12, 12). Raise LinAlgError, as numpy's inv
        does.
        """
        part = self._part
        part["mass"][:], part["jacobian"][:] = terms.mass, terms.jacobian
        part["error"][:] = error
        part["slip"][:] = slip
        part["stray"][:] = stray
        part["wrench"][:] = wrench
        if not self._inertia(self._at):
            raise np.linalg.LinAlgError(_NO_INVERSE)

    def damping(self) -> Array:
        """Return D (12, 12) for Lam as it is now. Raise LinAlgError, as numpy's cholesky does."""
        if not self._design(self._at):
            raise np.linalg.LinAlgError(_NO_INVERSE)
        return self._part["damping"].copy()

    def torque(self, damping: Array) -> Array:
        """Return tau (15,) for the damping D (12, 12)."""
        self._part["damping"][:] = damping
        self._torque(self._at)
        return self._part["torque"].copy()


class _Error:
    """The error of both hands: call it with terms and goals."""

    def __init__(self, built: ctypes.CDLL, record: Record) -> None:
        self._record, self._part, self._at = record, record.part, record.at
        self._error = built.task_error
        self._error.restype = None

    def __reduce__(self) -> tuple[Any, ...]:
        return error, (self._record,)

    def __call__(self, terms: Terms, goal_rotation: Array, goal_position: Array) -> Array:
        """Return e (12,) [m, rad], for goals (2, 3, 3) and (2, 3) [m]."""
        part = self._part
        part["rotation"][:], part["position"][:] = terms.rotation, terms.position
        part["goal_rotation"][:], part["goal_position"][:] = goal_rotation, goal_position
        self._error(self._at)
        return part["error"].copy()


def _law(record: Record | None = None) -> _Law | None:
    built = library()
    return _Law(built, record or Record(_LAW)) if built is not None else None


def error(record: Record | None = None) -> Callable[[Terms, Array, Array], Array]:
    """Return `task_error`, in C where velma.compiled is built; with the memory of another one."""
    built = library()
    return _Error(built, record or Record(_ERROR)) if built is not None else task_error


# --- The law with its state -----------------------------------------------------------------------


class CartesianImpedance:
    """The law with its gains and the last damping design; it has no other state."""

    def __init__(self, gains: CartesianGains | None = None) -> None:
        self.gains = ranges.checked(gains or CartesianGains())
        self._stiffness = self.gains.task()
        self._twice = np.concatenate((self._stiffness, self._stiffness))
        self._posture_stiffness, self._posture_damping = self.gains.posture()
        self._damping = np.zeros((12, 12))
        self._age = self.gains.renewed_every
        self._law = _law()
        if self._law is not None:
            self._law.set(stiffness=self._twice, regularisation=REGULARISATION)
            self._law.set(twice_ratio=2.0 * self.gains.damping_ratio)
            self._law.set(
                posture_stiffness=self._posture_stiffness, posture_damping=self._posture_damping
            )

    def torque(self, terms: Terms, error: Array, slip: Array, stray: Array, wrench: Array) -> Array:
        """Return tau (15,) for error e (12,), slip v - v_des (15,), stray q_des - q (15,), added
        wrench h (12,).
        """
        if self._law is not None:
            self._law.inertia(terms, error, slip, stray, wrench)
            if self._is_due():
                self._damping = self._law.damping()
            return self._law.torque(self._damping)
        jacobian = terms.jacobian
        inertia, through = task_inertia(
            jacobian, np.asarray(np.linalg.inv(terms.mass), dtype=np.float64)
        )
        if self._is_due():
            self._damping = task_damping(inertia, self._stiffness, self.gains.damping_ratio)
        force = self._twice * error - self._damping @ (jacobian @ slip) + wrench
        posture = self._posture_stiffness * stray - self._posture_damping * slip
        return np.asarray(jacobian.T @ force + null_space(posture, jacobian, through, inertia))

    def renew(self) -> None:
        """Design the damping in the next cycle: the posture may be another one, or the last design
        no number.
        """
        self._age = self.gains.renewed_every

    def _is_due(self) -> bool:
        """Count a cycle; return whether the damping is to be designed in it."""
        due = self._age >= self.gains.renewed_every
        self._age = 1 if due else self._age + 1
        return due
