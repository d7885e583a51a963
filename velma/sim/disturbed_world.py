"""The simulated world as disturbances.py disturbs it: things that somebody pushes, tips, takes away
or brings, joints and fingers that stick, hands without friction, heavy grains, furniture that is
moved.

Somebody's hand that pushes is a force near the thing's foot that follows a moving point, with a
limit: what stands in the way stops it, and nothing is turned. One that tips is a torque, until the
thing has fallen or time is over. What is taken away or brought is at its new place at once: nobody
sees by whom. The content of a vessel goes with it. A person who takes a thing out of the robot's
hand is a spring between the thing and a hand that is drawn away: the pull grows up to its size, and
when nothing holds the thing against it any more, the person has it and carries it off.

Also the readings of the joints, wrists, fingers and camera of the simulated robot, spoiled.
"""

import math
from collections.abc import Callable, Generator, Iterator, Sequence
from functools import partial

import mujoco
import numpy as np
from numpy.typing import NDArray

from velma.model.kinds import FURNITURE, MOVEABLE, Model, objects
from velma.model.scene import Scene
from velma.model.scene_xml import GRAIN
from velma.names import BODY, DISTAL, FINGERS, HEAD, PROXIMAL, SIDES
from velma.sim.backend import PERIOD_S, Array, State
from velma.sim.disturbances import Disturbance, Kind, Of

# how long a hand pushes, and how hard at most; estimates: a careless arm
PUSH_S, PUSH_N = 0.3, 12.0
# N/m, Ns/m of a pushing hand; a jar of 0.2 kg lags by 1 mm against friction
STIFF, DAMPED = 1500.0, 40.0
LOW_M = 0.01  # above its foot: higher up, the hand would topple a jar
TIP_S = 1.0  # the longest tip; estimate
# from there on a jar or box falls by itself; a bowl, past its rim
FALLEN_DEG, ROLLED_DEG = 60.0, 100.0
OVER = 2.0  # times the torque that just tips a thing; estimate
PULL_S = 0.6  # until a pull has its full size; estimate: a person takes a cup from a hand so
TAKER, TAKER_DAMPED, TAKER_N = 300.0, 30.0, 30.0
"""N/m, Ns/m, N: stiffness, damping and most force of a person's hand that takes a thing (estimates:
a relaxed arm).
"""
# Nm/rad, Nms/rad of it; estimates: it turns a jar against no stiff hand
TURNER, TURNER_DAMPED = 3.0, 0.1
WITH_IT_M, AWAY_M, AWAY_SPEED = 0.02, 0.4, 0.3
"""m, m, m/s: a person whose thing gives way by so much has it, and carries it so far away, so fast
(estimates).
"""
KNOCK_S = 0.12  # estimate: a blow of an arm that is not stopped
MOVE_S = 1.0  # for furniture; estimate: what stands on it stays on it
ASIDE = (-2.0, 2.0)  # m, on the floor behind the robot, where it neither looks nor reaches
APART_M = 0.4  # between things there
STANDS_M = 0.001  # above the floor, so that nothing is pressed into it
NEAR_M = 0.13  # of a vessel's middle: what is nearer is in it (a jar's half diagonal is 0.11 m)
OVER_TOP_M = 0.35  # above furniture: what stands on it, or on what stands on it, is moved along
_SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)
Going = Generator[None, None, None]


class DisturbedWorld:
    """What goes on in a world. Call `set` between two steps, and `step` before each as long as
    `busy`.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, scene: Scene) -> None:
        self._model, self._data = model, data
        self._kind = {thing.id: thing.model for thing in scene.things}
        self._home = {thing.id: np.array(thing.xyz) for thing in scene.things}
        names = [model.body(body).name for body in range(model.nbody)]
        self._grains = [name for name in names if name.startswith(GRAIN)]
        self._hands = [g for g in range(model.ngeom) if "_Hand" in names[model.geom_bodyid[g]]]
        self._going: dict[str, Going] = {}
        self._undo: dict[str, Callable[[], None]] = {}

    @property
    def busy(self) -> bool:
        """Whether something is under way that needs its part in each step."""
        return bool(self._going)

    def set(self, going_on: Sequence[Disturbance]) -> bool:
        """Begin what is new, undo what has ended. Return whether the world was changed, so that
        nothing rests.
        """
        now = {one.id: one for one in going_on if one.of in _BEGIN}
        ended = [name for name in self._undo if name not in now]
        for name in ended:
            if name in self._going:
                self._going.pop(name).close()
            self._undo.pop(name)()
        begun = [one for name, one in now.items() if name not in self._undo]
        for one in begun:
            self._undo[one.id] = _BEGIN[one.of](self, one)
        if ended or begun:
            mujoco.mj_step1(self._model, self._data)
        return bool(ended or begun)

    def forget(self, going_on: Sequence[Disturbance]) -> None:
        """Take what befell things as done: another simulator did it, and this one goes on in its
        world.
        """
        for one in going_on:
            if one.of is Of.THING and one.kind is not Kind.MOVED:
                back = one.kind is Kind.REMOVED and one.on in self._kind
                self._undo[one.id] = (
                    partial(self._carry, one.on, self._home[one.on]) if back else _nothing
                )
        self._data.xfrc_applied[:] = 0.0

    def step(self) -> None:
        """Do a cycle's part of what is under way."""
        for name, going in list(self._going.items()):
            if next(going, _ENDED) is _ENDED:
                del self._going[name]

    # --- things -----------------------------------------------------------------------------------

    def _thing(self, one: Disturbance) -> Callable[[], None]:
        if one.on not in self._kind:
            return _nothing
        size = np.array(one.size)
        match one.kind:
            case Kind.MOVED if self._kind[one.on] in FURNITURE:
                return self._furniture(one.id, one.on, size)
            case _ if self._kind[one.on] not in MOVEABLE:
                return _nothing
            case Kind.REMOVED:
                back = self._data.body(one.on).xpos.copy()
                self._carry(one.on, self._aside(one.on))
                return partial(self._carry, one.on, back)
            case Kind.ADDED:
                self._carry(one.on, size if size.size else self._home[one.on])
            case _:
                self._going[one.id] = self._forced(one.on, _FORCE[one.kind](self, one.on, size))
        return _nothing

    def _forced(self, name: str, going: Going) -> Going:
        """Let forces act on a thing until their time or order is over."""
        try:
            yield from going
        finally:
            self._data.xfrc_applied[self._model.body(name).id] = 0.0

    def _push(self, name: str, by: Array) -> Going:
        """Push a thing by a vector (3,) [m], as far as nothing stops it."""
        body, data = self._model.body(name).id, self._data
        begun, cycles = data.xipos[body].copy(), round(PUSH_S / PERIOD_S)
        before, flat = begun.copy(), np.array([1.0, 1.0, 1.0 if by[2] else 0.0])
        for cycle in range(1, cycles + cycles // 2):
            share = min(1.0, cycle / cycles)
            wanted, now = begun + share * by, data.xipos[body].copy()
            speed = (by / PUSH_S if share < 1.0 else 0.0) - (now - before) / PERIOD_S
            force = (STIFF * (wanted - now) + DAMPED * speed) * flat
            force *= min(1.0, PUSH_N / max(1e-9, float(np.linalg.norm(force))))
            up = data.xmat[body].reshape(3, 3)[:, 2]
            foot = data.xpos[body] - (_height(self._kind[name]) - LOW_M) * up
            data.xfrc_applied[body] = (*force, *np.cross(foot - now, force))
            before = now
            yield

    def _pull(self, name: str, force: Array) -> Going:
        """Pull at a thing with a force (3,) [N] that grows, as long as that is ordered; carry off
        what gives way.
        """
        body, data = self._model.body(name).id, self._data
        begun, turn = data.xipos[body].copy(), data.xquat[body].copy()
        way, cycle, has = force / max(1e-9, float(np.linalg.norm(force))), 0, False
        try:
            while (data.xipos[body] - begun) @ way < WITH_IT_M:
                cycle += 1
                self._draw(body, begun + min(1.0, cycle * PERIOD_S / PULL_S) * force / TAKER, turn)
                yield
            at, has = data.xipos[body].copy(), True
            for step in range(round(AWAY_M / AWAY_SPEED / PERIOD_S)):
                self._draw(body, at + AWAY_SPEED * PERIOD_S * step * way, turn)
                yield
        finally:
            if has:
                self._carry(name, self._aside(name))

    def _draw(self, body: int, to: Array, turn: Array) -> None:
        """Draw a thing to a point (3,) and an orientation (4,) as a spring does, which carries its
        weight, too.
        """
        data, spin, off, angle = self._data, np.empty(6), np.empty(4), np.empty(3)
        mujoco.mj_objectVelocity(self._model, data, mujoco.mjtObj.mjOBJ_BODY, body, spin, 0)
        force = TAKER * (to - data.xipos[body]) - TAKER_DAMPED * spin[3:]
        mujoco.mju_negQuat(off, data.xquat[body])
        mujoco.mju_mulQuat(off, turn, off.copy())
        mujoco.mju_quat2Vel(angle, off, 1.0)
        force *= min(1.0, TAKER_N / max(1e-9, float(np.linalg.norm(force))))
        data.xfrc_applied[body, :3] = force
        data.xfrc_applied[body, 3:] = TURNER * angle - TURNER_DAMPED * spin[:3]

    def _knock(self, name: str, force: Array) -> Going:
        """Knock against a thing with a force (3,) [N] that comes and goes as half a sine."""
        body, cycles = self._model.body(name).id, round(KNOCK_S / PERIOD_S)
        for cycle in range(1, cycles):
            self._data.xfrc_applied[body, :3] = force * math.sin(math.pi * cycle / cycles)
            yield

    def _tip(self, name: str, towards: Array) -> Going:
        """Tip a thing over in a direction (3,), of which the horizontal part counts."""
        body, model, data = self._model.body(name).id, self._model, self._data
        content = sum(model.body(g).mass[0] for g in self._inside(name))
        weight = 9.81 * (model.body_mass[body] + content)
        x, y, _ = towards / max(1e-9, float(np.linalg.norm(towards[:2])))
        torque = OVER * weight * _foot(self._kind[name]) * np.array([-y, x, 0.0])
        over = math.cos(math.radians(ROLLED_DEG if self._kind[name] is Model.BOWL else FALLEN_DEG))
        for _ in range(round(TIP_S / PERIOD_S)):
            if data.xmat[body][8] < over:
                break
            data.xfrc_applied[body, 3:] = torque
            yield

    def _aside(self, name: str) -> Array:
        number = list(self._kind).index(name)
        z = _height(self._kind[name]) + STANDS_M
        return np.array([ASIDE[0], ASIDE[1] + APART_M * number, z])

    def _carry(self, name: str, to: Array) -> None:
        """Put a thing upright and at rest with its origin at `to` (3,) [m, world], what is in it
        with it.
        """
        body = self._data.body(name)
        turn, at = body.xmat.reshape(3, 3).copy(), body.xpos.copy()
        inside = [(g, turn.T @ (self._data.body(g).xpos - at)) for g in self._inside(name)]
        joint = self._model.joint(name)
        self._data.qpos[joint.qposadr[0] + np.arange(7)] = (*to, 1.0, 0.0, 0.0, 0.0)
        self._data.qvel[joint.dofadr[0] + np.arange(6)] = 0.0
        for grain, local in inside:
            self._shift(grain, to + local - self._data.body(grain).xpos)
            self._still(grain)

    def _inside(self, name: str) -> list[str]:
        """Return the grains in a vessel."""
        if self._kind[name] not in (Model.JAR, Model.BOWL):
            return []
        body = self._data.body(name)
        up = body.xmat.reshape(3, 3)[:, 2]
        middle = body.xpos + (0.05 * up if self._kind[name] is Model.BOWL else 0.0)
        at = {name: self._data.body(name).xpos for name in self._grains}
        return [name for name in self._grains if np.linalg.norm(at[name] - middle) < NEAR_M]

    def _shift(self, name: str, by: Array) -> None:
        first = self._model.jnt_qposadr[self._model.body(name).jntadr[0]]
        self._data.qpos[first : first + 3] += by

    def _still(self, name: str) -> None:
        first = self._model.jnt_dofadr[self._model.body(name).jntadr[0]]
        self._data.qvel[first : first + 3] = 0.0

    # --- furniture --------------------------------------------------------------------------------

    def _furniture(self, key: str, name: str, by: Array) -> Callable[[], None]:
        """Move furniture with what stands in and on it; what ends it moves it back."""
        base = self._model.body(name).pos.copy()
        self._going[key] = self._drag(name, base, base + by)

        def back() -> None:
            self._going[f"{key} back"] = self._drag(name, self._model.body(name).pos.copy(), base)

        return back

    def _drag(self, name: str, base: Array, to: Array) -> Going:
        along, cycles = self._standing(name), round(MOVE_S / PERIOD_S)
        # MuJoCo does not place again what is fast while things sleep
        self._model.opt.enableflags &= ~_SLEEP
        try:
            for cycle in range(1, cycles + 1):
                before = self._model.body(name).pos.copy()
                self._model.body(name).pos[:] = base + (to - base) * cycle / cycles
                for one in along:
                    self._shift(one, self._model.body(name).pos - before)
                yield
            yield
        finally:
            self._model.opt.enableflags |= _SLEEP

    def _standing(self, name: str) -> list[str]:
        """Return things and grains in the space of furniture, and above it as far as things
        reach.
        """
        model, data, body = self._model, self._data, self._model.body(name).id
        geoms = np.flatnonzero(model.geom_bodyid == body)
        boxes = [(data.geom_xmat[g], data.geom_xpos[g], model.geom_size[g]) for g in geoms]
        corners = np.concatenate([_corners(*box) for box in boxes])
        low, high = corners.min(axis=0), corners.max(axis=0) + np.array([0.0, 0.0, OVER_TOP_M])
        moveable = [one for one, kind in self._kind.items() if kind in MOVEABLE]
        at = {one: data.body(one).xpos for one in (*moveable, *self._grains)}
        return [one for one, xyz in at.items() if (low < xyz).all() and (xyz < high).all()]

    # --- what is a parameter of the model ---------------------------------------------------------

    def _stick(self, one: Disturbance) -> Callable[[], None]:
        names = (one.on,) if one.of is Of.JOINT else _finger(one.on)
        dofs = np.array([self._model.joint(name).dofadr[0] for name in names], dtype=np.intp)
        self._going[one.id] = self._kept(self._model.dof_frictionloss, dofs, one.size[0])
        return _putting(self._model.dof_frictionloss, dofs)

    def _kept(self, numbers: Array, at: NDArray[np.intp], value: float) -> Going:
        while True:  # a hand's lock writes there, too
            numbers[at] = value
            yield

    def _slip(self, _: Disturbance) -> Callable[[], None]:
        back = _putting(self._model.geom_friction, np.array(self._hands, dtype=np.intp))
        self._model.geom_friction[self._hands] = 0.0
        return back

    def _weigh(self, one: Disturbance) -> Callable[[], None]:
        model = self._model
        bodies = np.array([model.body(name).id for name in self._grains], dtype=np.intp)
        undo = _putting(model.body_mass, bodies), _putting(model.body_inertia, bodies)
        model.body_mass[bodies] *= one.size[0]
        model.body_inertia[bodies] *= one.size[0]
        mujoco.mj_setConst(model, mujoco.MjData(model))

        def lighter() -> None:
            for each in undo:
                each()
            mujoco.mj_setConst(model, mujoco.MjData(model))

        return lighter


_BEGIN: dict[Of, Callable[[DisturbedWorld, Disturbance], Callable[[], None]]] = {
    Of.THING: DisturbedWorld._thing,
    Of.JOINT: DisturbedWorld._stick,
    Of.FINGER: DisturbedWorld._stick,
    Of.HANDS: DisturbedWorld._slip,
    Of.GRAINS: DisturbedWorld._weigh,
}
"""What begins a disturbance, and returns what undoes it."""
_FORCE: dict[Kind, Callable[[DisturbedWorld, str, Array], Going]] = {
    Kind.PUSHED: DisturbedWorld._push,
    Kind.TIPPED: DisturbedWorld._tip,
    Kind.PULLED: DisturbedWorld._pull,
    Kind.KNOCKED: DisturbedWorld._knock,
}
_ENDED = object()


def _nothing() -> None:
    """Undo what cannot be undone: a thing stays where it was pushed."""


def _putting(numbers: Array, at: NDArray[np.intp]) -> Callable[[], None]:
    before = numbers[at].copy()
    return lambda: numbers.__setitem__(at, before)


def _finger(on: str) -> tuple[str, str]:
    side, finger = on.split()
    number = FINGERS.index(finger)
    return PROXIMAL[side][number], DISTAL[side][number]


def _corners(turn: Array, at: Array, half: Array) -> Array:
    """Return the corners (8, 3) of a box in the world."""
    signs = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    return np.asarray(at + (signs * half) @ turn.reshape(3, 3).T)


def _foot(kind: Model) -> float:
    """Return how far [m] the edge about which a standing thing tips is from its axis, at most."""
    numbers = objects()[kind]
    if "edges" in numbers:
        return math.hypot(*numbers["edges"][:2]) / 2
    return float(numbers.get("base_radius", numbers.get("radius", 0.0)))


def _height(kind: Model) -> float:
    """Return the height of a thing's origin above what it stands on [m]."""
    numbers = objects()[kind]
    if "edges" in numbers:
        return float(numbers["edges"][2]) / 2
    return 0.0 if kind is Model.BOWL else float(numbers["height"]) / 2


# --- Spoiled readings and pictures ----------------------------------------------------------------

Pixels = NDArray[np.uint8]


class SpoiledReadings:
    """What goes on in the readings of a robot. A reading that is stuck stays as it was first read
    then.
    """

    def __init__(self) -> None:
        self._going_on: dict[Disturbance, list[Array]] = {}

    def set(self, going_on: Sequence[Disturbance]) -> None:
        """Take what goes on now in place of what did."""
        spoiling = [one for one in going_on if one.of in _READINGS]
        self._going_on = {one: self._going_on.get(one, []) for one in spoiling}

    def spoil(self, state: State) -> None:
        """Spoil the arrays of a state in place; they are overwritten by the next readings."""
        for one, first in self._going_on.items():
            readings = list(_READINGS[one.of](state, one.on))
            if not first:
                first += [array[part].copy() for array, part in readings]
            for (array, part), before in zip(readings, first, strict=True):
                array[part] = _spoiled(array[part], before, one)
            if one.kind is Kind.STUCK and one.on in BODY:
                state.v[BODY.index(one.on)] = 0.0  # a drive computes it from two positions


def _spoiled(reading: Array, first: Array, one: Disturbance) -> Array | float:
    match one.kind:
        case Kind.ZERO:
            return 0.0
        case Kind.NAN:
            return np.nan
        case Kind.STUCK:
            return first
        case _:
            return reading + one.size[0] * (_AXES if one.of is Of.WRIST else 1.0)


# of a wrist: torques at a lever of 0.05 m, as of Noise (velma.model.scene)
_AXES = np.array([1.0] * 3 + [0.05] * 3)
_Part = tuple[Array, tuple[slice, ...]]


def _rows(on: str) -> slice:
    return slice(SIDES.index(on), SIDES.index(on) + 1) if on else slice(None)


def _wrist(state: State, on: str) -> Iterator[_Part]:
    if state.wrist is not None:
        yield state.wrist, (_rows(on),)


def _grip(state: State, on: str) -> Iterator[_Part]:
    yield state.proximal, (_rows(on),)
    yield state.distal, (_rows(on),)


def _encoder(state: State, on: str) -> Iterator[_Part]:
    array, names = (state.head, HEAD) if on in HEAD else (state.q, BODY)
    yield array, (slice(names.index(on), names.index(on) + 1),)


_READINGS: dict[Of, Callable[[State, str], Iterator[_Part]]] = {
    Of.WRIST: _wrist, Of.GRIP: _grip, Of.ENCODER: _encoder
}  # fmt: skip


class SpoiledPictures:
    """What goes on in the pictures of a camera. A frozen camera gives the picture before, else its
    first one.
    """

    def __init__(self) -> None:
        self._last: Pixels | None = None

    def light(self, pixels: Pixels, going_on: Sequence[Disturbance]) -> Pixels:
        """Return the picture in the light that there is, before the camera's noise."""
        share = min((one.size[0] for one in going_on if one.kind is Kind.DIMMED), default=1.0)
        return pixels if share == 1.0 else np.asarray(np.rint(share * pixels), np.uint8)

    def taken(self, pixels: Pixels, going_on: Sequence[Disturbance]) -> Pixels:
        """Return what the camera gives for the picture that it took."""
        kinds = {one.kind for one in going_on if one.of is Of.CAMERA}
        if Kind.FROZEN in kinds and self._last is not None:
            return self._last
        if Kind.BLACK in kinds:
            pixels = np.zeros_like(pixels)
        elif Kind.MIRRORED in kinds:
            pixels = np.ascontiguousarray(pixels[:, ::-1])
        self._last = pixels
        return pixels
