"""Cost of a control cycle beside the physics it commands, and of saving it: `python benchmarks/loop.py`.

The same simulated robot, 30 grains in its jar, held and then in motion; the physics step alone is timed in the same
run on the same state, so that the ratio says something on any machine. Set OMP_NUM_THREADS=1, as the services do.
"""

import tempfile
import time
from pathlib import Path

import mujoco
import numpy as np

from services.executor.loop.core import LoopCore
from services.executor.loop.memory import MEMORY, Keeper
from services.executor.loop.program import Phase, motion
from velma.model import scene
from velma.sim.mujoco_backend import MujocoBackend

CYCLES = 3000


def timed(call, times: int) -> np.ndarray:
    """Durations of `call`, us."""
    out = np.empty(times)
    for k in range(times):
        start = time.perf_counter()
        call()
        out[k] = 1e6 * (time.perf_counter() - start)
    return out


def by_turns(first, second, times: int) -> tuple[np.ndarray, np.ndarray]:
    """Durations of two calls, one after the other, us."""
    both = np.array([(timed(first, 1)[0], timed(second, 1)[0]) for _ in range(times)])
    return both[:, 0], both[:, 1]


def physics_alone(backend: MujocoBackend, times: int) -> np.ndarray:
    """The step of the same model from the same state, with the present drive commands kept."""
    data = mujoco.MjData(backend.model)
    mujoco.mj_copyData(data, backend.model, backend.data)
    return timed(lambda: mujoco.mj_step(backend.model, data), times)


def row(name: str, us: np.ndarray, physics: float) -> str:
    """One line of the table."""
    p50, p99, p999 = np.percentile(us, [50, 99, 99.9])
    return f"{name:22s} {p50:8.0f} {p99:8.0f} {p999:8.0f} {us.max():8.0f}   {p50 / physics:5.2f}"


def main() -> None:
    """Print p50, p99, p99.9, max in us, and the ratio to the physics step."""
    core = LoopCore(MujocoBackend(scene.load()))
    core.hold(0.5)
    physics = physics_alone(core.backend, 1000)
    held = timed(core.cycle, CYCLES)
    u = np.linspace(0, 1, 500)[:, None]
    moved = core.setpoint + 0.4 * u**3 * (10 - 15 * u + 6 * u * u) * np.sign(-core.setpoint)
    core.begin(motion("there", moved))
    with tempfile.TemporaryDirectory() as folder:
        moving, saving = by_turns(core.cycle, Keeper(Path(folder) / MEMORY, core, core.backend).save, 2400)
    assert core.report.phase is Phase.RUNNING, core.report
    print(f"{'us':22s} {'p50':>8s} {'p99':>8s} {'p99.9':>8s} {'max':>8s}   ratio")
    base = float(np.median(physics))
    named = {"physics step alone": physics, "cycle, held": held, "cycle, moving": moving, "saving it": saving}
    for name, us in named.items():
        print(row(name, us, base))


if __name__ == "__main__":
    main()
