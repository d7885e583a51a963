"""Checks of readings: true, up to date, in the right units, order and sign."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from services.executor.conformance.judging import Measured
from services.executor.conformance.subject import Bench, Subject, bench
from velma.names import BODY, DISTAL_UPPER, FINGER_UPPER, HEAD_LOWER, HEAD_UPPER, LOWER, SIDES, SPREAD_UPPER, UPPER
from velma.sim.backend import State

Array = NDArray[np.float64]

SHAPES = {"q": (15,), "v": (15,), "head": (2,), "spread": (2,), "proximal": (2, 3), "distal": (2, 3)}
WRIST = (2, 6)
RANGES: dict[str, tuple[Array | float, Array | float]] = {
    "q": (LOWER, UPPER),
    "head": (HEAD_LOWER, HEAD_UPPER),
    "spread": (0.0, SPREAD_UPPER),
    "proximal": (0.0, FINGER_UPPER),
    "distal": (0.0, DISTAL_UPPER),
}
FINGERS = ("proximal", "distal", "spread")
WINDOW = 50  # cycles over which positions and speeds must agree: noise and quantisation average out
ROUNDING = 0.1  # of the distance: what a filter of the speed may cost


def copied(state: State) -> dict[str, Array]:
    """Return a copy of the arrays of a state and its time."""
    return {name: np.array(getattr(state, name), dtype=np.float64) for name in (*SHAPES, "time")}


def outside(state: State, names: Iterable[str] = RANGES) -> Measured:
    """Return how far the farthest reading is outside the range of its joint [rad]."""
    worst, where = 0.0, "all inside"
    for name in names:
        low, high = RANGES[name]
        value = getattr(state, name)
        excess = float(np.max(np.maximum(value - high, low - value)))
        if not excess <= worst:
            worst, where = excess, f"{name} at {state.time:.3f} s"
    return worst, where


def form(subject: Subject) -> Measured:
    """Return the number of fields that are not float64 arrays of their shape."""
    with bench(subject) as robot:
        state = robot.step()
        wrong = [
            f"{name} is {getattr(value, 'dtype', type(value).__name__)} {getattr(value, 'shape', '')}"
            for name, shape in SHAPES.items()
            if not isinstance(value := getattr(state, name), np.ndarray)
            or value.shape != shape
            or value.dtype != np.float64
        ]
        wrong += [] if isinstance(state.time, float) else [f"time is {type(state.time).__name__}"]
        if state.wrist is not None and np.shape(state.wrist) != WRIST:
            wrong.append(f"wrist is {np.shape(state.wrist)}")
        model = robot.backend.configuration()
        if model.ndim != 1 or model.dtype != np.float64:
            wrong.append(f"configuration is {model.dtype} {model.shape}")
    return len(wrong), "; ".join(wrong) or "all as documented"


def numbers(subject: Subject) -> Measured:
    """Return the number of cycles, in two seconds at rest and in motion, with a reading that is not a number."""
    with bench(subject) as robot:
        size = robot.backend.configuration().size
        good = [_finite(robot, state) for state in robot.steps(1.0)]
        good += [_finite(robot, state) for state in robot.wave(1.0)]
        same = robot.backend.configuration().size == size
    if not all(good):
        return good.count(False), f"first in cycle {good.index(False)}"
    return int(not same), "always numbers" if same else "the configuration changed its size"


def _finite(robot: Bench, state: State) -> bool:
    read = all(np.isfinite(getattr(state, name)).all() for name in (*SHAPES, "time"))
    felt = state.wrist is None or bool(np.isfinite(state.wrist).all())
    return read and felt and bool(np.isfinite(robot.backend.configuration()).all())


def inside(subject: Subject) -> Measured:
    """Return how far outside its joint ranges the robot says it starts [rad]."""
    with bench(subject) as robot:
        return outside(robot.backend.observe())


def looking(subject: Subject) -> Measured:
    """Return what observing twice changes."""
    with bench(subject) as robot:
        for _ in robot.wave(0.1):
            first = copied(robot.backend.observe())
            second = copied(robot.backend.observe())
            worst = max(float(np.abs(first[name] - second[name]).max()) for name in first)
            if not worst <= 0.0:
                return worst, f"at {float(first['time']):.3f} s"
    return 0.0, "nothing"


def resting(subject: Subject) -> Measured:
    """Return how far the body moves in a second without torque [rad]."""
    with bench(subject) as robot:
        began = robot.backend.observe().q.copy()
        moved = np.max([np.abs(state.q - began) for state in robot.steps(1.0)], axis=0)
    return float(moved.max()), BODY[int(moved.argmax())]


def own_joint(subject: Subject) -> Measured:
    """Return the number of joints that a positive torque does not move in the positive direction."""
    wrong = []
    with bench(subject) as robot:
        for joint, name in enumerate(BODY):
            began = float(robot.backend.observe().q[joint])
            for state in robot.push(joint, 0.1):  # noqa: B007  (the last one counts)
                pass
            if not (state.q[joint] - began > 1e-4 and state.v[joint] > 0.0):
                wrong.append(f"{name} by {state.q[joint] - began:+.4f} rad at {state.v[joint]:+.3f} rad/s")
            robot.calm()
    return len(wrong), "; ".join(wrong) or "all 15 joints"


def agreeing(subject: Subject) -> Measured:
    """Return how far positions and integrated speeds differ within a window, beyond the cost of a filter [rad]."""
    with bench(subject) as robot:
        rows = [(state.q.copy(), state.v.copy()) for state in robot.wave(1.0)]
        dt = robot.backend.period_s
    q, v = (np.array(column) for column in zip(*rows, strict=True))
    mean = (v[1:] + v[:-1]) / 2 * dt
    worst, where = 0.0, "all joints"
    for k in range(0, len(q) - WINDOW, WINDOW):
        part = mean[k : k + WINDOW]
        off = np.abs(q[k + WINDOW] - q[k] - part.sum(0)) - ROUNDING * np.abs(part).sum(0)
        if not off.max() <= worst:
            worst, where = float(off.max()), f"{BODY[int(off.argmax())]} after {k} cycles"
    return worst, where


def fresh(subject: Subject) -> Measured:
    """Return the number of cycles until a torque shows in the speed of its joint."""
    worst, where = 0, ""
    with bench(subject) as robot:
        for joint in (0, 1, 7, 8, 14):
            robot.calm()
            before = float(robot.backend.observe().v[joint])
            seen = next((k for k, s in enumerate(robot.push(joint, 0.1)) if s.v[joint] - before > 1e-3), 99)
            worst, where = max((worst, where), (seen + 1, BODY[joint]))
    return worst, where


def head(subject: Subject) -> Measured:
    """Return the error of pan and tilt, moved one after the other [rad]."""
    with bench(subject) as robot:
        goal = robot.command.head.copy()
        off = []
        for move in ((0.3, 0.0), (0.0, 0.2)):
            goal = goal + move
            off.append(np.abs(robot.towards("head", goal, 0.5).head - goal))
    return float(np.max(off)), ("pan", "tilt")[int(np.max(off, axis=0).argmax())]


def hands(subject: Subject) -> Measured:
    """Return the error of the fingers, hand by hand, while the other hand has to stay [rad]."""
    worst, where = 0.0, ""
    with bench(subject) as robot:
        goals = {name: getattr(robot.command, name).copy() for name in FINGERS}
        for row, side in enumerate(SIDES):
            for name, move, speed in (("spread", 0.3, 0.7), ("proximal", 0.6, 1.0), ("distal", 0.2, 0.33)):
                goals[name][row] += move
                state = robot.towards(name, goals[name], speed)
            for name, goal in goals.items():
                off = float(np.abs(getattr(state, name) - goal).max())
                worst, where = max((worst, where), (off, f"{name} after the {side} hand moved"))
    return worst, where


def locks(subject: Subject) -> Measured:
    """Return how far locked fingers move when commanded to close by 0.6 rad [rad]."""
    with bench(subject) as robot:
        robot.command.locked[:] = 1.0
        for _ in robot.steps(0.1):
            pass
        began = robot.backend.observe().proximal.copy()
        state = robot.towards("proximal", robot.command.proximal + 0.6, 1.0)
        moved = np.abs(state.proximal - began)
    return float(moved.max()), f"{SIDES[int(moved.max(axis=1).argmax())]} hand"


def work(subject: Subject) -> Measured:
    """Return the number of cycles in which the work fell or was not a number; one more if motion cost no work."""
    with bench(subject) as robot:
        told = [robot.backend.work_J, *(robot.backend.work_J for _ in robot.wave(0.5))]
    wrong = int((~(np.diff(told) >= 0.0)).sum())
    return wrong + (not told[-1] > told[0]), f"{told[0]:.3f} J to {told[-1]:.3f} J"
