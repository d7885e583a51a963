"""Six agents with the true search, skills, loop and physics; the hands lose their friction for a while."""

import pytest
from pretended_fleet import Fleet
from test_pour import TrueFleet

from companion.all_languages import SW
from companion.languages import sw
from companion.languages.facts import Kind, fact
from companion.languages.values import Side

FULL_S = 1.5  # without friction
FLOOR_M = 0.3


class Slippery(TrueFleet):
    """Friction is gone for a while as soon as the jar has moved by `out` [m] towards the robot and `up` [m]."""

    def __init__(self, seed: int, out: float, up: float) -> None:
        super().__init__(seed)
        self.gone_s: float | None = None
        model, cycle = self.core.backend.model, self.core.cycle
        hands = [g for g in range(model.ngeom) if "_Hand" in model.body(model.geom_bodyid[g]).name]
        before = model.geom_friction[hands].copy()
        stood = self.truth.read().at["jar_1"]

        def tricked() -> None:
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


def reports(fleet: Fleet) -> list[tuple[float, sw.Report]]:
    """Return ta's reports to co, with the simulated time."""
    said = [one for one in fleet.wires.traffic if (one.sender, one.receiver) == ("ta", "co")]
    return [(one.sent, SW.decode(one.content)) for one in said if str(one.performative) == "inform"]


@pytest.mark.long
@pytest.mark.timeout(900)
def test_a_jar_that_falls_is_never_poured() -> None:
    """The robot says within a second that it lost the jar, that a person is needed, and never that it is done."""
    fleet = Slippery(7, out=0.2, up=0.0)
    told: list[float] = []
    wires = fleet.wires

    def lost() -> bool:
        if not told and any(
            fact(Kind.LOST, side, "jar_1") in report.why for _, report in reports(fleet) for side in Side
        ):
            told.append(fleet.core.state.time)
        return fleet.ended()

    try:
        fleet.say("pour the jar into the bowl")
        wires.run(lost, limit_s=1200.0)
        assert [str(task.state) for task in fleet.tasks] == ["failed"]
        assert fleet.gone_s is not None
        assert told[0] - fleet.gone_s < 1.0
        assert sw.WorkerState.SUCCEEDED not in fleet.reports()
        assert fleet.truth.read().at["jar_1"][2] < FLOOR_M
        (task,) = fleet.tasks
        assert any(one.kind is Kind.LOST_SINCE for one in task.why), task
        scene = wires.memory("km").scene
        assert all(held.object != "jar_1" for held in scene.hands.values())
        assert "jar_1" in scene.lost or scene.things["jar_1"].pose.xyz[2] < FLOOR_M
        assert scene.contents == {}
    finally:
        fleet.close()


@pytest.mark.long
@pytest.mark.timeout(900)
def test_a_jar_lost_on_its_shelf_is_taken_again() -> None:
    """It slides back through the hand that lifts it; the robot notices, looks, takes it again and pours."""
    fleet = Slippery(7, out=-1.0, up=0.015)
    try:
        fleet.say("pour the jar into the bowl")
        assert fleet.finish(limit_s=1200.0) == ["done"], fleet.tasks
        assert fleet.gone_s is not None
        errors = [report for _, report in reports(fleet) if report.state is sw.WorkerState.ERROR]
        assert any("jar_1" in one.things for report in errors for one in report.why)
        truth = fleet.truth.read()
        assert truth.grains_in["bowl_1"] >= 0.9 * truth.grains
        assert fleet.wires.memory("km").scene.contents == {"jar_1": "bowl_1"}
    finally:
        fleet.close()
