"""Velma in MuJoCo: the scene, stepped at the control period. True poses are in truth.py only.

A step is `mj_step2` and then `mj_step1`, so that all that is read between two steps (gravity,
contacts, poses) belongs to the present state and not to the one before.
"""

import ctypes
import hashlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from velma.errors import SceneError
from velma.model.scene import Noise, Scene, checked
from velma.model.scene_xml import WRIST_SENSORS, scene_xml
from velma.names import BODY, DISTAL, FINGERS, HEAD, PROXIMAL, SIDES, SPREAD, START, check_joints
from velma.sim.backend import (
    DISTAL_SHARE,
    PAIR_LIMIT,
    PERIOD_S,
    SINGLE_LIMIT,
    Array,
    Command,
    State,
    at_rest,
)
from velma.sim.disturbances import Disturbance, Orders
from velma.sim.disturbed_world import DisturbedWorld, SpoiledReadings

# --- MuJoCo's sleep: what is at rest and touched by nothing awake is not simulated ----------------

AWAKE = -1


def allow_sleep(model: mujoco.MjModel) -> None:
    """Let all trees sleep but those with drives, which MuJoCo keeps awake."""
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)


def sleep_again(model: mujoco.MjModel, data: mujoco.MjData, asleep: Array) -> None:
    """Put to sleep the trees that slept when `data.tree_asleep` was `asleep` (ntree,), at the
    coordinates of `data`.
    """
    data.tree_asleep[:] = AWAKE
    mujoco.mj_step1(model, data)  # what sleeps is placed only while it is awake
    data.tree_asleep[:] = asleep.astype(np.int32)
    _update()(model._address, data._address)
    data.qacc_smooth[:] = data.qacc_warmstart  # of what sleeps the next step hands it on


@cache
def _update() -> Any:
    """Return the function of MuJoCo's library that makes its lists of what is awake; Python's
    bindings leave it out.
    """
    (path,) = Path(mujoco.__file__).parent.glob("libmujoco.so.*")
    update = ctypes.CDLL(str(path)).mj_updateSleep
    update.argtypes, update.restype = [ctypes.c_void_p, ctypes.c_void_p], None
    return update


# --- Things of a scene that stand in each other or in the robot. Read from the contacts of the
# simulation at its start


# [m] estimate: a recorded scene is true to some millimetres, and what stands is pressed in by less
# than 1
MOST_M = 0.003


def refuse(scene: Scene, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Raise SceneError if a thing overlaps another one or the robot by more than MOST_M.

    `data` has the contacts of the start posture. Furniture may overlap furniture: it does not move.
    """
    things = {thing.id for thing in scene.things}
    for contact in data.contact[: data.ncon]:
        if contact.dist >= -MOST_M:
            continue
        first, second = (model.body(int(model.geom_bodyid[geom])).name for geom in contact.geom)
        named = [name for name in (first, second) if name in things]
        if not named or any(name.startswith("grain_") for name in (first, second)):
            continue
        other = second if first == named[0] else first
        part = "the floor" if other == "world" else f"the robot ({other})"
        around = other if other in things else part
        deep = f"{-1000 * contact.dist:.0f} mm inside {around}"
        most = f"things that overlap by at most {1000 * MOST_M:.0f} mm; move one of them"
        raise SceneError(f"thing {named[0]}", deep, most)


# --- Errors of the simulated robot and of what is known of it: the same in the same cycle of a
# scene, also restored


CYCLES = 4001  # 8 s, then the noise repeats: longer than every average over it (estimate)


def wrists(noise: Noise) -> Array:
    """Return errors (CYCLES, 2, 6) [N, Nm] by cycle and side: a constant one and white noise, drawn
    from the seed.
    """
    rng = np.random.default_rng([noise.seed, *b"wrist"])
    bias = np.array([noise.force_bias] * 3 + [noise.torque_bias] * 3)
    spread = np.array([noise.force] * 3 + [noise.torque] * 3)
    constant = rng.uniform(-bias, bias, (2, 6))
    return np.asarray(constant + spread * rng.standard_normal((CYCLES, 2, 6)))


def joints(noise: Noise) -> Array:
    """Return errors (CYCLES, 2, 15) of body joints by cycle: of positions [rad], and of speeds
    [rad/s], which a drive computes from two positions.
    """
    rng = np.random.default_rng([noise.seed, *b"joint"])
    positions = noise.joint * rng.standard_normal((CYCLES, len(BODY)))
    return np.stack((positions, (positions - np.roll(positions, 1, axis=0)) / PERIOD_S), axis=1)


def weights(noise: Noise) -> Array:
    """Return by which factor (15,) each drive holds the weight of the arms."""
    rng = np.random.default_rng([noise.seed, *b"weight"])
    return np.asarray(1.0 + noise.weight * rng.uniform(-1.0, 1.0, len(BODY)))


def masses(noise: Noise, count: int) -> Array:
    """Return by which factor (count,) each thing is heavier than its model says."""
    rng = np.random.default_rng([noise.seed, *b"mass"])
    return np.asarray(1.0 + noise.mass * rng.uniform(-1.0, 1.0, count))


# --- Velma in MuJoCo ------------------------------------------------------------------------------


# A locked hand holds by dry friction of its worm gears: proximal and spread, distal, Nm. Estimate:
# carries jar and bowl without creep; data from the maker of the gear would be better.
LOCK_PROXIMAL, LOCK_DISTAL = 3.0, 1.0
# MuJoCo's dry friction is soft by default: 1.5 Nm would turn a locked finger by 0.7 rad/s. With
# these it is 0.02 rad/s.
LOCK_SOLREF, LOCK_SOLIMP = 0.005, (0.99, 0.999)


def compiled(scene: Scene) -> mujoco.MjModel:
    """Return the model of a scene, its joints checked. A mirror of the world is made the same
    way.
    """
    model = mujoco.MjModel.from_xml_string(scene_xml(checked(scene)))
    joints = [model.joint(j).name for j in range(model.njnt)]
    check_joints(f"scene {scene.name}", [name for name in joints if name in BODY])
    if abs(model.opt.timestep - PERIOD_S) > 1e-12:
        raise ValueError(
            f"scene {scene.name} steps {model.opt.timestep} s, the loop {PERIOD_S} s: see"
            " objects.yaml"
        )
    return model


STATE = mujoco.mjtState.mjSTATE_INTEGRATION
"""Everything that the next step depends on, but the locks, which are parameters of the model
here.
"""


class MujocoBackend:
    """A simulated Velma in a scene, in the start posture with open hands.

    `model`: of the scene, with bodies beside that have no joint; None: compiled here.
    """

    period_s = PERIOD_S

    def __init__(self, scene: Scene, model: mujoco.MjModel | None = None) -> None:
        self.scene = scene
        self.model = model = model or compiled(scene)
        allow_sleep(model)
        self.data = mujoco.MjData(model)
        # MuJoCo would write its warnings to a file in the working folder; errors show in the
        # numbers, which the loop checks.
        mujoco.set_mju_user_warning(lambda _message: None)
        self._places()
        self._limits()
        self._weigh()
        self.data.qpos[self._q] = START
        mujoco.mj_step1(model, self.data)
        refuse(scene, model, self.data)
        self._state = at_rest()
        self._state.wrist = np.zeros((2, 6))
        self._wrist_errors = wrists(scene.noise)
        self._joint_errors = joints(scene.noise) if scene.noise.joint else None
        self._weights, self._late = weights(scene.noise), scene.noise.delay > 0
        self._before = np.stack((START, np.zeros(len(BODY))))
        self._locked = np.zeros(2)
        self._readings, self._world = SpoiledReadings(), DisturbedWorld(model, self.data, scene)
        self.orders = Orders.named()
        self._work = 0.0
        sizes = [mujoco.mj_stateSize(model, STATE), 2, 1]
        sizes += [self._wrist.size, self._before.size, model.ntree]
        self._saved, ends = np.zeros(sum(sizes)), np.cumsum(sizes)
        self._parts = [
            slice(int(end - size), int(end)) for end, size in zip(ends, sizes, strict=True)
        ]

    def _places(self) -> None:
        model = self.model

        def position(names: tuple[str, ...]) -> Array:
            return np.array([model.joint(name).qposadr[0] for name in names], dtype=np.intp)

        def speed(names: tuple[str, ...]) -> Array:
            return np.array([model.joint(name).dofadr[0] for name in names], dtype=np.intp)

        def drive(names: tuple[str, ...]) -> Array:
            return np.array([model.actuator(name).id for name in names], dtype=np.intp)

        self._q, self._v, self._motors = position(BODY), speed(BODY), drive(BODY)
        self._head, self._head_servos = position(HEAD), drive(HEAD)
        self._spread = np.stack([position(SPREAD[side][:1]) for side in SIDES])[:, 0]
        self._spread_servos = drive(tuple(f"{side}_spread" for side in SIDES))
        self._proximal = np.stack([position(PROXIMAL[side]) for side in SIDES])
        self._distal = np.stack([position(DISTAL[side]) for side in SIDES])
        self._proximal_servos, self._distal_servos = (
            np.stack([drive(tuple(f"{s}_{kind}_{f}" for f in FINGERS)) for s in SIDES])
            for kind in ("proximal", "distal")
        )
        self._stiff_dofs = [speed((*PROXIMAL[side], *SPREAD[side])) for side in SIDES]
        self._distal_dofs = [speed(DISTAL[side]) for side in SIDES]
        firsts = [
            [model.sensor(f"{side}_{kind}").adr[0] for kind in WRIST_SENSORS] for side in SIDES
        ]
        self._wrist = np.array(
            [[at + k for at in row for k in range(3)] for row in firsts], dtype=np.intp
        )

    def _limits(self) -> None:
        closing = np.array([PAIR_LIMIT, PAIR_LIMIT, SINGLE_LIMIT])
        self.model.actuator_forcerange[self._proximal_servos, 1] = closing
        self.model.actuator_forcerange[self._distal_servos, 1] = closing * DISTAL_SHARE
        for dofs in (*self._stiff_dofs, *self._distal_dofs):
            self.model.dof_solref[dofs, 0] = LOCK_SOLREF
            self.model.dof_solimp[dofs, :2] = LOCK_SOLIMP

    def _weigh(self) -> None:
        """Make things as heavy as they are, which their models need not say."""
        if not self.scene.noise.mass:
            return
        bodies = [self.model.body(thing.id).id for thing in self.scene.things]
        factors = masses(self.scene.noise, len(bodies))
        self.model.body_mass[bodies] *= factors
        self.model.body_inertia[bodies] *= factors[:, None]
        mujoco.mj_setConst(self.model, self.data)

    def observe(self) -> State:
        """Return the state, with the errors and the delay that the scene's noise says; forces
        before the last step.
        """
        state, qpos = self._state, self.data.qpos
        state.time = self.data.time
        cycle = round(self.data.time / PERIOD_S) % CYCLES
        state.q[:], state.v[:] = (
            self._before if self._late else (qpos[self._q], self.data.qvel[self._v])
        )
        if self._joint_errors is not None:
            state.q += self._joint_errors[cycle, 0]
            state.v += self._joint_errors[cycle, 1]
        state.head[:] = qpos[self._head]
        state.spread[:] = qpos[self._spread]
        state.proximal[:] = qpos[self._proximal]
        state.distal[:] = qpos[self._distal]
        state.wrist = self.data.sensordata[self._wrist] + self._wrist_errors[cycle]
        self._readings.spoil(state)
        return state

    def disturb(self, going_on: Sequence[Disturbance]) -> bool:
        """Take what goes on now in place of what did; return whether the world was changed, so that
        nothing rests.
        """
        self._readings.set(going_on)
        return self._world.set(going_on)

    def disturbed(self) -> bool:
        """Look for orders, where it is time; return whether they changed the world. Cheap."""
        return self.orders.changed() and self.disturb(self.orders.going_on)

    def resume(self) -> None:
        """Go on in a restored world: what was ordered has befallen its things already, senses are
        ill again.
        """
        self.orders.look()
        self._world.forget(self.orders.going_on)
        self.disturb(self.orders.going_on)

    def step(self, command: Command) -> None:
        """Add the weight of the arms to the torques, set the servos, let 2 ms pass."""
        data = self.data
        if (command.locked != self._locked).any():
            self._lock(command.locked)
        if self._world.busy:
            self._world.step()
        ctrl = data.ctrl
        if self._late:
            self._before[:] = data.qpos[self._q], data.qvel[self._v]
        ctrl[self._motors] = command.tau + self._weights * data.qfrc_bias[self._v]
        ctrl[self._head_servos] = command.head
        ctrl[self._spread_servos] = command.spread
        ctrl[self._proximal_servos] = command.proximal
        ctrl[self._distal_servos] = command.distal
        mujoco.mj_step2(self.model, data)
        power = data.actuator_force[self._motors] * data.qvel[self._v]
        self._work += float(np.abs(power).sum()) * PERIOD_S
        mujoco.mj_step1(self.model, data)

    def pass_time(self, periods: int) -> None:
        """Let time pass in which nothing moves; the caller knows that nothing would."""
        self.data.time += periods * PERIOD_S

    def _lock(self, locked: Array) -> None:
        for row, on in enumerate(locked):
            self.model.dof_frictionloss[self._stiff_dofs[row]] = LOCK_PROXIMAL * on
            self.model.dof_frictionloss[self._distal_dofs[row]] = LOCK_DISTAL * on
        self._locked[:] = locked

    def configuration(self) -> Array:
        """Return all coordinates (nq,): robot, things and grains."""
        configuration: Array = self.data.qpos
        return configuration

    @property
    def fingerprint(self) -> bytes:
        """32 bytes that are the same for the same scene and version of MuJoCo."""
        return hashlib.sha256(f"{mujoco.__version__} {scene_xml(self.scene)}".encode()).digest()

    def save(self) -> bytes:
        """Return the state between two steps, with the locks, the work so far, what was measured
        last and before.

        What sleeps is part of it, too.
        """
        state, locked, work, wrist, before, asleep = (self._saved[part] for part in self._parts)
        mujoco.mj_getState(self.model, self.data, state, STATE)
        asleep[:] = self.data.tree_asleep
        locked[:] = self._locked
        work[:] = self._work
        wrist[:] = self.data.sensordata[self._wrist.ravel()]
        before[:] = self._before.ravel()
        return self._saved.tobytes()

    def restore(self, saved: bytes) -> None:
        """Take up a state of `save`: the same commands lead to the same states, bit for bit."""
        state, locked, work, wrist, before, asleep = (
            np.frombuffer(saved)[part] for part in self._parts
        )
        mujoco.mj_setState(self.model, self.data, state, STATE)
        sleep_again(self.model, self.data, asleep)
        self._lock(locked)
        self._work = float(work[0])
        mujoco.mj_step1(self.model, self.data)
        self.data.sensordata[self._wrist.ravel()] = wrist
        self._before[:] = before.reshape(self._before.shape)

    @property
    def work_J(self) -> float:
        """Work of the body joints so far, J: the integral of |torque x speed| with the weight of
        the arms in it.
        """
        return self._work
