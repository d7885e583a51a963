"""Cost of a control cycle beside the physics it commands, and of saving it: `python
benchmarks/loop.py`.

The same simulated robot, 30 grains in its jar, held and then in motion; the physics step alone is
timed in the same run on the same state, so that the ratio says something on any machine. So is all
of it with grains that spin, by turns. In the pile in motion, gravity turns to and fro by 35 degrees
in a second. Set OMP_NUM_THREADS=1, as the services do.
"""

import copy
import math
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
from msgspec.structs import replace

from companion.skills.loop_messages import Motion, Phase, motion
from services.executor.loop.core import LoopCore
from services.executor.loop.memory import MEMORY, Keeper
from velma.model import scene
from velma.model.scene import Content
from velma.model.scene_xml import grain_name
from velma.sim.mujoco_backend import MujocoBackend

CYCLES, GRAINS, SPINS = 3000, 30, (False, True)
TURN, HEAVY_KG = math.radians(35.0), 1e3  # beyond the slope at which a pile slides; estimates


def by_turns(*calls: Callable[[], object], times: int) -> np.ndarray:
    """Durations (calls, times) of calls, one after the other, us."""
    out = np.empty((len(calls), times))
    for k in range(times):
        for row, call in enumerate(calls):
            start = time.perf_counter()
            call()
            out[row, k] = 1e6 * (time.perf_counter() - start)
    return out


def physics_alone(backend: MujocoBackend) -> Callable[[], None]:
    """The step of the same model from the same state, with the present drive commands kept."""
    data = mujoco.MjData(backend.model)
    mujoco.mj_copyData(data, backend.model, backend.data)
    return lambda: mujoco.mj_step(backend.model, data)


def in_motion(backend: MujocoBackend) -> Callable[[], None]:
    """The same for a copy in which gravity turns to and fro, and all but the grains is too heavy to
    follow it.
    """
    model, data = copy.copy(backend.model), mujoco.MjData(backend.model)
    mujoco.mj_copyData(data, model, backend.data)
    grains = [grain_name(k) for k in range(GRAINS)]
    model.dof_armature[~np.isin(model.dof_bodyid, [model.body(name).id for name in grains])] = (
        HEAVY_KG
    )
    mujoco.mj_setConst(model, mujoco.MjData(model))

    def step() -> None:
        angle = TURN * math.sin(math.tau * data.time)
        model.opt.gravity[:] = 9.81 * math.sin(angle), 0.0, -9.81 * math.cos(angle)
        mujoco.mj_step(model, data)

    return step


def there(core: LoopCore) -> Motion:
    """A motion of all joints, longer than what is timed."""
    u = np.linspace(0, 1, 500)[:, None]
    return motion(
        "there", core.setpoint + 0.4 * u**3 * (10 - 15 * u + 6 * u * u) * np.sign(-core.setpoint)
    )


def row(name: str, us: np.ndarray, physics: float) -> str:
    """One line of the table."""
    p50, p99, p999 = np.percentile(us, [50, 99, 99.9])
    return f"{name:32s} {p50:8.0f} {p99:8.0f} {p999:8.0f} {us.max():8.0f}   {p50 / physics:5.2f}"


def main() -> None:
    """Print p50, p99, p99.9, max in us, and the ratio to the physics step of grains that do not
    spin.
    """
    cores = [
        LoopCore(MujocoBackend(replace(scene.load(), content=Content(grains=GRAINS, spin=spin))))
        for spin in SPINS
    ]
    for core in cores:
        core.hold(0.5)
    named = {
        "physics step alone": by_turns(*(physics_alone(core.backend) for core in cores), times=1000)
    }
    named["the same, pile in motion"] = by_turns(
        *(in_motion(core.backend) for core in cores), times=1500
    )
    named["cycle, held"] = by_turns(*(core.cycle for core in cores), times=CYCLES)
    for core in cores:
        core.begin(there(core))
    with tempfile.TemporaryDirectory() as folder:
        keepers = [
            Keeper(Path(folder) / f"{k}{MEMORY}", core, core.backend)
            for k, core in enumerate(cores)
        ]
        calls = [core.cycle for core in cores] + [keeper.save for keeper in keepers]
        moving = by_turns(*calls, times=2400)
    named |= {"cycle, moving": moving[:2], "saving it": moving[2:]}
    assert all(core.report.phase is Phase.RUNNING for core in cores), [
        core.report for core in cores
    ]
    print(f"{'us':32s} {'p50':>8s} {'p99':>8s} {'p99.9':>8s} {'max':>8s}   ratio")
    base = float(np.median(named["physics step alone"][0]))
    for name, both in named.items():
        for spin, us in zip(SPINS, both, strict=True):
            print(row(name + ", spin" * spin, us, base))


if __name__ == "__main__":
    main()
