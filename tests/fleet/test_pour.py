"""Gate (b): all six agents in memory, with the true search, the true skills, the true loop and simulated physics."""

import pytest
from called_loop import CalledLoop
from pretended_fleet import Fleet

from agent_runtime.io.devices import Post
from companion.languages import sw
from services.executor.device import RobotDevice
from services.executor.local import Setup
from services.executor.loop.core import LoopCore
from services.executor.skill_device import SkillDevice
from services.planner.search_device import SearchDevice
from velma.model.scene import load, vary
from velma.sim.mujoco_backend import MujocoBackend
from velma.sim.truth import TruthReader

SEED = 7


class TrueFleet(Fleet):
    """Six agents; search and skills are child processes, the loop is called."""

    def __init__(self, seed: int) -> None:
        backend = MujocoBackend(vary(load(), seed))
        self.truth = TruthReader(backend)
        self.core = LoopCore(backend)
        self.core.hold(0.4)
        setup = Setup(seed=seed)

        def robot(post: Post) -> RobotDevice:
            return RobotDevice(SkillDevice(post, setup), CalledLoop(post, self.core))

        super().__init__(seed=seed, search=SearchDevice, robot=robot)


@pytest.mark.long
@pytest.mark.timeout(600)
def test_six_agents_pour() -> None:
    """Plan #1, Replan, plan #2: the content is in the bowl, the jar in the left hand, the bowl upright."""
    fleet = TrueFleet(SEED)
    try:
        fleet.say("pour the jar into the bowl")
        assert fleet.finish(limit_s=1200.0) == ["done"], fleet.tasks
        assert fleet.reports()[-1] == sw.WorkerState.SUCCEEDED
        truth = fleet.truth.read()
        assert truth.grains_in["bowl_1"] >= 0.9 * truth.grains
        assert truth.fingers_on["jar_1"]["left"] >= 3
        assert truth.tilt_deg["bowl_1"] < 10.0
    finally:
        fleet.close()
