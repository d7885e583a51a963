"""Gate (b): all six agents in memory, with the true search, the true skills, the true loop and simulated physics."""

import os
import signal
from functools import partial
from pathlib import Path

import pytest
from called_loop import CalledLoop
from pretended_fleet import Fleet

from agent_runtime.core.effects import Effects
from agent_runtime.io.devices import Post
from companion.all_languages import SW
from companion.eyes import Eyes
from companion.languages import sw
from companion.languages.facts import Facts, fact
from companion.tasks.pour.done import PourKind
from services.executor.device import RobotDevice
from services.executor.local import Setup
from services.executor.loop.core import LoopCore
from services.executor.renderer import Renderer
from services.executor.skill_device import SkillDevice
from services.executor.world import scene_of
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
            return RobotDevice(
                SkillDevice(post, setup, Renderer(partial(scene_of, setup))), CalledLoop(post, self.core)
            )

        super().__init__(seed=seed, search=SearchDevice, robot=robot)


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.parametrize("eyes", [Eyes.RAYS, pytest.param(Eyes.PIXELS, marks=pytest.mark.needs_opengl)])
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
        assert PourKind.ARRIVED in [one.kind for one in told(fleet)], told(fleet)
    finally:
        fleet.close()


@pytest.mark.needs_opengl
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
        (left,) = (one.numbers[0] for one in told(fleet) if one.kind is PourKind.LEFT)
        assert left == pytest.approx(0.06, abs=0.0015), told(fleet)
        assert fact(PourKind.REST_NOT_THERE, "bowl_1") in told(fleet)
    finally:
        fleet.close()


@pytest.mark.process
@pytest.mark.needs_opengl
@pytest.mark.timeout(200)
def test_when_drawing_is_lost_the_robot_goes_on_by_rays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The libraries break and the eye's process dies: no task fails, and it is said once, whoever dies later."""
    monkeypatch.setenv("LD_LIBRARY_PATH", str(tmp_path))
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    fleet, said = TrueFleet(SEED, Eyes.PIXELS), list[str]()

    def hear(agent: str, effects: Effects) -> None:
        said.extend(line.fields["reason"] for line in effects.logs if line.event == "sees by rays")

    fleet.wires.on_step = hear
    try:
        fleet.say("look around")
        assert fleet.finish() == ["done"], fleet.tasks
        assert said == []
        for library in ("libEGL.so.1", "libOSMesa.so.8"):
            (tmp_path / library).touch()
        skills = fleet.wires.nodes["ex"].device.skills
        for count, victim in ((2, skills._renderer.pid), (3, skills._child.pid)):
            os.kill(victim, signal.SIGKILL)
            fleet.say("look around")
            assert fleet.finish(count) == ["done"] * count, fleet.tasks
            assert len(said) == 1
        assert "GlError" in said[0]
        assert "libEGL.so.1: file too short" in said[0]
        assert skills._renderer.pid == 0
    finally:
        fleet.close()


def told(fleet: TrueFleet) -> Facts:
    """Return why ta's last report is as it is."""
    said = [one for one in fleet.wires.traffic if (one.sender, one.receiver) == ("ta", "co")]
    report: sw.Report = SW.decode([one for one in said if str(one.performative) == "inform"][-1].content)
    return report.why
