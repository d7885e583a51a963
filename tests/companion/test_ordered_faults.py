"""`roco fault sensor` and `thing` where they cannot be done, and their words."""

import pytest

from companion.eyes import VARIABLE as EYES
from companion.run_files import DISTURBANCES_FILE
from companion.tools.verbs import fault
from companion.tools.verbs.checkup import BACKEND
from console.errors import ConsoleError, FleetError, UsageError
from console.fleet.local import Local
from operate.fault_lines import Fault
from operate.fault_proxy.files import WIRES_FILE
from velma.model import scene
from velma.sim import disturbances
from velma.sim.disturbances import Disturbance, Kind, Of

BLACK, ZERO = Disturbance("a", Of.CAMERA, Kind.BLACK), Disturbance("b", Of.WRIST, Kind.ZERO)


class FleetWith(Local):
    """A fleet of a run folder whose processes have these variables."""

    def __init__(self, run, **variables):
        super().__init__(run)
        self.variables = variables

    def variable(self, name, variable):
        return self.variables.get(variable, "")


@pytest.fixture
def run(tmp_path):
    """The folder of a fleet that was started with --faults."""
    (tmp_path / WIRES_FILE).write_bytes(b"{}")
    return tmp_path


def refused(fleet, one):
    with pytest.raises(ConsoleError) as told:
        fault.possible(fleet, one)
    return str(told.value)


def test_a_fleet_without_faults_is_left_alone(tmp_path):
    text = "was started without --faults; start the fleet with `roco up --faults`"
    assert text in refused(FleetWith(tmp_path), ZERO)


def test_where_there_is_nothing_that_could_fail(run):
    """The mock has no senses, rays have no camera; all else is possible."""
    assert "back-end mujoco" in refused(FleetWith(run, **{BACKEND: "mock"}), ZERO)
    assert "`roco up --eyes pixels`" in refused(FleetWith(run, **{EYES: "rays"}), BLACK)
    fault.possible(FleetWith(run, **{EYES: "rays"}), ZERO)
    fault.possible(FleetWith(run), BLACK)


def test_things_are_those_of_the_scene_that_the_fleet_has(run):
    """Those that can be taken; a scene that is gone is told."""
    pushed = Disturbance("c", Of.THING, Kind.PUSHED, "box_1")
    assert "there are jar_1, bowl_1" in refused(FleetWith(run), pushed)
    box = scene.CANONICAL.with_stem("box")
    fault.possible(FleetWith(run, ROCO_SCENE=str(box)), pushed)
    with pytest.raises(FleetError, match="cannot be read any more"):
        fault.possible(FleetWith(run, ROCO_SCENE=str(run / "gone.toml")), pushed)


def test_a_vector_has_three_numbers():
    assert (fault.vector("0,-0.05,1e-3"), fault.vector("")) == ((0.0, -0.05, 0.001), ())
    for text in ("1", "1,2", "a,b,c", "1,2,3,4"):
        with pytest.raises(UsageError, match=r"three numbers with commas between, as 0,-0\.05,0"):
            fault.vector(text)


def test_words():
    """As the record and the report have them."""
    bias = Disturbance("d", Of.ENCODER, Kind.BIAS, "left_arm_3_joint", (0.05,))
    assert fault.described(bias) == "encoder bias left_arm_3_joint by 0.05"
    assert fault.described(ZERO) == "wrist zero"
    assert fault.described(Disturbance("e", Of.THING, Kind.REMOVED, "jar_1")) == "jar_1 removed"
    noted = Fault(id="d", kind="sensor", target="loop", t=0.0, what=fault.described(bias))
    assert noted.words == "sensor encoder bias left_arm_3_joint by 0.05"


def test_faults_of_several_commands_stand_beside_each_other(run):
    """Each takes back its own; what has ended by itself is left out."""
    fleet = FleetWith(run)
    kinds = {name: fault._kind(Disturbance(name, Of.WRIST, Kind.ZERO), 60.0) for name in "ab"}
    noted = {name: Fault(id=name, kind="sensor", target="loop", t=0.0) for name in "ab"}
    old = Disturbance("old", Of.WRIST, Kind.NAN, until=1.0)
    disturbances.write(run / DISTURBANCES_FILE, (old,))
    for name, kind in kinds.items():
        kind.begin(fleet, noted[name])
    assert [one.id for one in disturbances.read(run / DISTURBANCES_FILE)] == ["a", "b"]
    fault.KINDS["sensor"].heal(fleet, noted["a"])
    kinds["a"].heal(fleet, noted["a"])
    assert [one.id for one in disturbances.read(run / DISTURBANCES_FILE)] == ["b"]
    kinds["b"].heal(fleet, noted["b"])
    assert disturbances.read(run / DISTURBANCES_FILE) == ()
