"""`roco fault sensor` and `roco fault thing` on a running fleet: the simulator does it, the agents
are not told.
"""

import json
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from roco_fleet import RocoFleet

from companion.run_files import DISTURBANCES_FILE
from operate.fault_lines import Fault, latest, read
from operate.file_names import FAULTS_FILE
from velma.control.grip import Wrong
from velma.sim import disturbances

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(150)]


class Faulty(RocoFleet):
    """A fleet that was started with --faults."""

    def __init__(self, run: Path) -> None:
        super().__init__(run, more=("--faults",))

    def fault(self, *words: str, code: int = 0) -> str:
        """Return what a fault prints."""
        return self.roco("fault", *words, code=code)

    def last(self) -> Fault:
        """The newest fault that was recorded."""
        return latest(read((self.run / FAULTS_FILE).read_bytes()))[-1]

    def going_on(self) -> tuple[disturbances.Disturbance, ...]:
        """What the simulator reads."""
        return disturbances.read(self.run / DISTURBANCES_FILE)


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Faulty]:
    made = Faulty(tmp_path_factory.mktemp("faulty") / "run")
    yield made
    made.down()


def test_a_thing_is_pushed_removed_and_put_back(fleet: Faulty) -> None:
    """Also while simulated time stands still; it is recorded, and the file is empty at the end."""
    before = fleet.truth().at["bowl_1"]
    told = fleet.fault("thing", "bowl_1", "--kind", "pushed", "--by", "-0.03,0,0", "--for", "1")
    assert "thing bowl_1 pushed by -0.03,0,0: healed after 1 s" in told
    fleet.wait(lambda: fleet.truth().at["bowl_1"][0] < before[0] - 0.02, "the bowl was pushed")
    pushed = fleet.truth().at["bowl_1"]
    fault = json.loads(
        fleet.fault("thing", "jar_1", "--kind", "removed", "--for", "2", "--format", "json")
    )
    assert (fault["kind"], fault["target"], fault["what"]) == ("thing", "loop", "jar_1 removed")
    assert fleet.last().text == "healed after 2 s"
    fleet.wait(lambda: fleet.truth().at["jar_1"][0] > 0.0, "the jar is back")
    truth = fleet.truth()
    assert truth.grains_in["jar_1"] == truth.grains
    assert truth.at["bowl_1"] == pytest.approx(pushed, abs=0.01)
    assert fleet.going_on() == ()


def test_a_sense_is_ill_for_its_time_and_heals_although_its_command_was_killed(
    fleet: Faulty,
) -> None:
    """The loop reads what cannot be: all that anybody knows is what the robot itself finds out."""
    words = "fault sensor encoder --kind bias --joint left_arm_3_joint --by 0.2 --for 60"
    with fleet.begin(words) as child:
        fleet.wait(fleet.going_on, "the order stands in the file")
        child.kill()
    (ordered,) = fleet.going_on()
    told = ordered.of, ordered.kind, ordered.on, ordered.by
    assert told == ("encoder", "bias", "left_arm_3_joint", (0.2,))
    assert ordered.until is not None, "it would end by itself"
    told = fleet.fault("heal")
    assert "sensor encoder bias left_arm_3_joint by 0.2: healed" in told
    assert fleet.going_on() == ()


def test_the_robot_finds_by_itself_that_a_wrist_does_not_feel(fleet: Faulty) -> None:
    """It takes the jar with a wrist that reads no number, and says so."""
    with fleet.begin("fault sensor wrist --kind nan --for 100") as child:
        try:
            fleet.wait(fleet.going_on, "the order stands in the file")
            line = fleet.do("take the jar")
            report = fleet.link.told().report
        finally:
            child.send_signal(signal.SIGINT)
            child.wait()
    assert report.left.grip.wrong == report.right.grip.wrong == Wrong.NO_NUMBER, line
    assert fleet.last().text == "broken off, healed"
    assert fleet.going_on() == ()


def test_each_is_listed(fleet: Faulty) -> None:
    """By its own words, as the report has them."""
    fleet.fault("sensor", "grip", "--kind", "stuck", "--side", "right", "--for", "0.5")
    told = fleet.fault("list")
    assert "sensor grip stuck right" in told
    assert fleet.last().target == "loop"


def test_what_cannot_be_is_refused(fleet: Faulty) -> None:
    """With what is right; nothing is recorded."""
    before = (fleet.run / FAULTS_FILE).read_bytes()
    for words, said in {
        "thing cup_1 --kind pushed": "no thing 'cup_1' can be moved; there are jar_1, bowl_1",
        "thing table_1 --kind tipped": "no thing 'table_1' can be moved",
        "thing jar_1 --kind pushed --by 1": "three numbers with commas between",
        "sensor wrist --kind black": "wrist cannot be black; it can be zero, stuck, nan, bias",
        "sensor encoder --kind bias": "which encoder? name its joint: --joint",
        "sensor wrist --kind zero --by 1": "wrist zero has no size",
    }.items():
        assert said in " ".join(fleet.fault(*words.split(), code=2).split()), words
    assert (fleet.run / FAULTS_FILE).read_bytes() == before


def test_the_report_has_them(fleet: Faulty) -> None:
    """After the end of the fleet; the last test of this file."""
    fleet.fault("thing", "bowl_1", "--kind", "pushed", "--by", "0.02,0,0", "--for", "0.5")
    fleet.roco("down")
    report = json.loads((fleet.run / "report.json").read_bytes())
    done = [(one["kind"], one["what"]) for one in report["faults"]]
    assert ("thing", "bowl_1 pushed by 0.02,0,0") in done
    assert "<td>thing bowl_1 pushed by 0.02,0,0</td>" in (fleet.run / "report.html").read_text()
