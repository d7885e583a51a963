"""Gate (b): all six agents in memory, with the true search, the true skills, the true loop and
simulated physics.

In the last tests, the hands lose their friction for a while.
"""

import os
import signal

import pytest
from true_fleet import TrueFleet

from companion.eyes import Eyes
from companion.languages import sw
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.tasks.pour.done import PourKind
from velma.model.scene import CANONICAL

SEED = 7
FULL_S = 1.5  # without friction
FLOOR_M = 0.3


def told(fleet):
    """Why ta's last report is as it is."""
    *_, (_, report) = fleet.informs()
    return report.why


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    "eyes", [Eyes.RAYS, pytest.param(Eyes.PIXELS, marks=pytest.mark.needs_opengl)]
)
def test_six_agents_pour(eyes):
    """Plan #1, Replan, plan #2: the content is in the bowl, the jar in the left hand, the bowl
    upright.
    """
    with TrueFleet(SEED, eyes) as fleet:
        fleet.say()
        assert fleet.finish(limit_s=1200.0) == ["done"], fleet.tasks
        assert fleet.reports()[-1] == sw.WorkerState.SUCCEEDED
        truth = fleet.truth.read()
        assert truth.grains_in["bowl_1"] >= 0.9 * truth.grains
        assert truth.fingers_on["jar_1"]["left"] >= 3
        assert truth.tilt_deg["bowl_1"] < 10.0
        assert PourKind.ARRIVED in [one.kind for one in told(fleet)], told(fleet)


@pytest.mark.needs_opengl
@pytest.mark.long
@pytest.mark.timeout(600)
def test_content_that_falls_beside_the_bowl_is_not_called_poured(tmp_path):
    """Grains that stick to each other leave the jar in lumps: the weight alone says 100 %."""
    sticky = tmp_path / "sticky.toml"
    sticky.write_text(CANONICAL.read_text().replace("[content]", "[content]\nfriction = 1.0"))
    with TrueFleet(SEED, Eyes.PIXELS, sticky) as fleet:
        fleet.say()
        assert fleet.finish(limit_s=1200.0) == ["failed"], fleet.tasks
        truth = fleet.truth.read()
        assert truth.grains_in["jar_1"] == 0
        assert truth.grains_in["bowl_1"] < 0.9 * truth.grains, "less than what counts as poured"
        (left,) = (one.numbers[0] for one in told(fleet) if one.kind is PourKind.LEFT)
        assert left == pytest.approx(0.06, abs=0.0015), told(fleet)
        assert fact(PourKind.REST_NOT_THERE, "bowl_1") in told(fleet)


@pytest.mark.process
@pytest.mark.needs_opengl
@pytest.mark.timeout(200)
def test_when_drawing_is_lost_the_robot_goes_on_by_rays(tmp_path, monkeypatch):
    """The libraries break and the eye's process dies: no task fails, and it is said once, whoever
    dies later.
    """
    monkeypatch.setenv("LD_LIBRARY_PATH", str(tmp_path))
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    said = []

    def hear(agent, effects):
        said.extend(line.fields["reason"] for line in effects.logs if line.event == "sees by rays")

    with TrueFleet(SEED, Eyes.PIXELS) as fleet:
        fleet.watch = hear
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


class Slippery(TrueFleet):
    """Friction is gone for a while as soon as the jar has moved by `out` [m] towards the robot and
    `up` [m].
    """

    def __init__(self, seed, out, up):
        super().__init__(seed)
        self.gone_s = None
        model, cycle = self.core.backend.model, self.core.cycle
        hands = [g for g in range(model.ngeom) if "_Hand" in model.body(model.geom_bodyid[g]).name]
        before = model.geom_friction[hands].copy()
        stood = self.truth.read().at["jar_1"]

        def tricked():
            cycle()
            now = self.core.state.time
            if self.gone_s is None:
                jar = self.truth.pose("jar_1")[1]
                if stood[0] - jar[0] > out and jar[2] - stood[2] > up:
                    self.gone_s = now
                    model.geom_friction[hands] = 0.0
            elif now - self.gone_s > FULL_S:
                model.geom_friction[hands] = before

        self.core.cycle = tricked  # type: ignore[method-assign]


@pytest.mark.long
@pytest.mark.timeout(900)
def test_a_jar_that_falls_is_never_poured():
    """The robot says within a second that it lost the jar, that a person is needed, and never that
    it is done.
    """
    told_s, falls = list[float](), [fact(Kind.LOST, side, "jar_1") for side in Side]

    def lost():
        if not told_s and any(one in falls for _, report in fleet.informs() for one in report.why):
            told_s.append(fleet.core.state.time)
        return fleet.ended()

    with Slippery(SEED, out=0.2, up=0.0) as fleet:
        fleet.say()
        fleet.until(lost, 1200.0)
        assert [str(task.state) for task in fleet.tasks] == ["failed"]
        assert fleet.gone_s is not None
        assert told_s[0] - fleet.gone_s < 1.0
        assert sw.WorkerState.SUCCEEDED not in fleet.reports()
        assert fleet.truth.read().at["jar_1"][2] < FLOOR_M
        (task,) = fleet.tasks
        assert any(one.kind is Kind.LOST_SINCE for one in task.why), task
        scene = fleet.wires.memory("km").scene
        assert all(held.object != "jar_1" for held in scene.hands.values())
        assert "jar_1" in scene.lost or scene.things["jar_1"].pose.xyz[2] < FLOOR_M
        assert scene.contents == {}


@pytest.mark.long
@pytest.mark.timeout(900)
def test_a_jar_lost_on_its_shelf_is_taken_again():
    """It slides back through the hand that lifts it; the robot notices, looks, takes it again and
    pours.
    """
    with Slippery(SEED, out=-1.0, up=0.015) as fleet:
        fleet.say()
        assert fleet.finish(limit_s=1200.0) == ["done"], fleet.tasks
        assert fleet.gone_s is not None
        errors = [report for _, report in fleet.informs() if report.state is sw.WorkerState.ERROR]
        assert any("jar_1" in one.things for report in errors for one in report.why)
        truth = fleet.truth.read()
        assert truth.grains_in["bowl_1"] >= 0.9 * truth.grains
        assert fleet.wires.memory("km").scene.contents == {"jar_1": "bowl_1"}
