"""Gate (b): all six agents in memory, with the true search, the true skills, the true loop and simulated physics."""

import re
from pathlib import Path

import pytest
from called_loop import CalledLoop
from pretended_fleet import Fleet

from agent_runtime.io.devices import Post
from companion.eyes import Eyes
from companion.languages import SW, sw
from services.executor.device import RobotDevice
from services.executor.local import Setup
from services.executor.loop.core import LoopCore
from services.executor.skill_device import SkillDevice
from services.planner.search_device import SearchDevice
from velma.model.scene import CANONICAL, load, vary
from velma.sim.mujoco_backend import MujocoBackend
from velma.sim.truth import TruthReader

SEED = 7


class TrueFleet(Fleet):
    """Six agents; search and skills are child processes, the loop is called."""

    def __init__(self, seed: int, eyes: Eyes = Eyes.RAYS, scene: Path = CANONICAL) -> None:
        backend = MujocoBackend(vary(load(scene), seed))
        self.truth = TruthReader(backend)
        self.core = LoopCore(backend)
        self.core.hold(0.4)
        setup = Setup(str(scene), seed, eyes)

        def robot(post: Post) -> RobotDevice:
            return RobotDevice(SkillDevice(post, setup), CalledLoop(post, self.core))

        super().__init__(seed=seed, search=SearchDevice, robot=robot)


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.parametrize("eyes", list(Eyes))
def test_six_agents_pour(eyes: Eyes) -> None:
    """Plan #1, Replan, plan #2: the content is in the bowl, the jar in the left hand, the bowl upright."""
    fleet = TrueFleet(SEED, eyes)
    try:
        fleet.say("pour the jar into the bowl")
        assert fleet.finish(limit_s=1200.0) == ["done"], fleet.tasks
        assert fleet.reports()[-1] == sw.WorkerState.SUCCEEDED
        truth = fleet.truth.read()
        assert truth.grains_in["bowl_1"] >= 0.9 * truth.grains
        assert truth.fingers_on["jar_1"]["left"] >= 3
        assert truth.tilt_deg["bowl_1"] < 10.0
        assert ("g in bowl_1" in words(fleet)) is (eyes is Eyes.PIXELS), words(fleet)
    finally:
        fleet.close()


@pytest.mark.long
@pytest.mark.timeout(600)
def test_content_that_falls_beside_the_bowl_is_not_called_poured(tmp_path: Path) -> None:
    """Grains that stick to each other leave the jar in lumps: the weight alone says 100 %."""
    sticky = tmp_path / "sticky.toml"
    sticky.write_text(CANONICAL.read_text().replace("[content]", "[content]\nfriction = 1.0"))
    fleet = TrueFleet(SEED, Eyes.PIXELS, sticky)
    try:
        fleet.say("pour the jar into the bowl")
        assert fleet.finish(limit_s=1200.0) == ["failed"], fleet.tasks
        truth = fleet.truth.read()
        assert truth.grains_in["jar_1"] == 0
        assert truth.grains_in["bowl_1"] < 0.9 * truth.grains, "less than what counts as poured"
        assert re.search(r"(59|60|61) g left jar_1", words(fleet)), words(fleet)
        assert "the rest is not there" in words(fleet)
    finally:
        fleet.close()


def words(fleet: TrueFleet) -> str:
    """Return the reason of ta's last report."""
    said = [one for one in fleet.wires.traffic if (one.sender, one.receiver) == ("ta", "co")]
    return str(SW.decode([one for one in said if str(one.performative) == "inform"][-1].content).reason)
