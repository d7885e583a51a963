"""A loop that takes over the memory of another one goes on as that one would have, bit for bit."""

import msgspec
import numpy as np
import pytest
from grips import DYNAMICS, JAR_GRIP, JAR_POSTURE, jar_gripped, lever, raised, standing
from loop_process import loop_process, seen, until

from companion.languages.facts import Kind, fact
from companion.skills.loop_messages import (
    HeadGoal,
    Mode,
    Move,
    Payload,
    Phase,
    Until,
    motion,
)
from services.executor.loop.core import LoopCore
from services.executor.loop.hands import Activity
from services.executor.loop.link import StopLink
from services.executor.loop.memory import MEMORY, Keeper, Restorable
from velma.model import scene
from velma.sim.mock_backend import MockBackend
from velma.sim.mujoco_backend import MujocoBackend

AFTER = 600  # cycles that both are compared for, 1.2 s


@pytest.fixture
def path(tmp_path):
    """File that keeps the memory."""
    return tmp_path / MEMORY


@pytest.fixture(scope="module")
def carrying():
    """A loop that holds the jar and begins to raise it, with everything that a loop can
    remember.
    """
    core, truth = jar_gripped()
    payload = Payload(0.3, lever(core, truth, 1, "jar_1"))
    knots = raised(core.setpoint, 1, 0.1)
    core.begin(motion("lift", knots, payload_left=payload, head=HeadGoal(0.3, 0.2)))
    return core


def kept(path):
    """A loop around the jar, whose memory is kept in a file."""
    core, _ = standing(JAR_POSTURE, 1, 0.52)
    return core, Keeper(path, core, core.backend)


def reborn(path):
    """A new loop on a new world, which finds the memory of another."""
    core = LoopCore(MujocoBackend(scene.load()), dynamics=DYNAMICS)
    return core, Keeper(path, core, core.backend)


def everything(core):
    """All that can be seen of a loop and its world."""
    counted = (core.cycles, core.saturated, core.faults, core.last_fault, core.mode, core.busy)
    command, hands = core.command, (core.fingers.motor, core.payloads.mass)
    arrays = [one.tobytes() for one in (core.setpoint, command.tau, command.spread, *hands)]
    return (*counted, core.backend.save(), msgspec.msgpack.encode(core.report), *arrays)


def killed_after(core, keeper, cycles):
    """Cycle as the process does, and drop the loop then."""
    for _ in range(cycles):
        core.cycle()
        keeper.save()


AMID = {
    "closing": lambda fingers: fingers._activity[1] is Activity.CLOSING,
    "pushing": lambda fingers: fingers._pushing[1].any(),
    "squeezing": lambda fingers: fingers._activity[1] is Activity.SQUEEZING,
    "stalling": lambda fingers: fingers._stalling[1].any(),
    "locking": lambda fingers: fingers._activity[1] is Activity.LOCKING,
}


@pytest.mark.parametrize("amid", AMID)
def test_it_goes_on_closing_exactly(path, amid):
    """Touch, squeeze and lock come at the same cycle; the other hand's spread and the head arrive
    with them.
    """
    core, keeper = kept(path)
    assert not keeper.restored
    other, grip = Move((0.3, 0.3, 0.3), spread=0.8), JAR_GRIP
    if amid == "stalling":  # it feels no touch, and closes until the motors stand still
        grip = msgspec.structs.replace(JAR_GRIP, effort=100.0)
    core.begin(
        motion("act", core.setpoint, until="touch", left=grip, right=other, head=HeadGoal(0.5, 0.1))
    )
    killed_after(core, keeper, 20)
    while not AMID[amid](core.fingers):
        killed_after(core, keeper, 1)
    killed_after(core, keeper, 2)
    same_from_here(core, keeper, path)


@pytest.mark.parametrize("amid", ["path", "settling"])
def test_it_ends_at_the_same_contact(path, amid):
    """The hand goes down onto the shelf; how far it hung there at the start, and since when it
    rests, is known.
    """
    core, keeper = kept(path)
    down = raised(core.setpoint, 1, -0.12)
    # pushes the hand up: below its path from the start on
    core.payloads.mass[1] = core.payloads._goal[1] = 1.0
    core.begin(
        motion("down", down, until="contact", contact_side="left", contact_m=0.02, settle_s=0.3)
    )
    killed_after(core, keeper, 100)
    while amid == "settling" and core.act._settling_s is None:
        killed_after(core, keeper, 1)
    killed_after(core, keeper, 20)
    other = same_from_here(core, keeper, path)
    assert (other.report.phase, other.report.ended_by) == (Phase.DONE, Until.CONTACT)


def abandoned(core):
    core.abandon((fact(Kind.GAVE_NO_ANSWER, "ex"),))


@pytest.mark.parametrize("cycles", [1, 30])
@pytest.mark.parametrize("end", [LoopCore.stop, abandoned, LoopCore.pause, LoopCore.cancel])
def test_it_stays_in_its_mode_exactly(path, end, cycles):
    """Stopped by a person, in damping, held, paused, braked; asked to be released meanwhile."""
    core, keeper = kept(path)
    knots = raised(core.setpoint, 0, 0.05)
    core.saturated, core.faults, core.last_fault = 7, 2, "an earlier one"
    core.begin(motion("rise", knots + 0.01, until="contact", contact_side="right"))
    killed_after(core, keeper, 100)
    end(core)
    killed_after(core, keeper, cycles)
    core.release()
    killed_after(core, keeper, 1)
    same_from_here(core, keeper, path)


def same_from_here(core, keeper, path):
    """A loop that finds the memory now does what this one does."""
    other, again = reborn(path)
    assert (again.restored, again.epoch) == (True, keeper.epoch)
    for _ in range(AFTER):
        core.cycle()
        other.cycle()
        assert everything(other) == everything(core)
    return other


def test_a_carried_jar_is_carried_on(path, carrying):
    """Locks, load, set-points, the path and its rate, the design of the damping: nothing differs
    after the lift.
    """
    core = carrying
    keeper = Keeper(path, core, core.backend)
    killed_after(core, keeper, 200)
    core.cancel()
    killed_after(core, keeper, 20)  # amid the braking
    other = same_from_here(core, keeper, path)
    assert other.report.phase is Phase.CANCELLED
    assert other.report.left.locked


def test_a_write_that_was_cut_off_leaves_the_one_before(path):
    """Two slots by turns: a loop may be killed in the middle of a write."""
    core, keeper = kept(path)
    killed_after(core, keeper, 10)
    slot = keeper._slots["odd" if keeper._number % 2 else "even"]
    slot._view[0] |= 1  # its number is odd: a write has begun
    other, again = reborn(path)
    assert again.restored
    assert other.cycles == core.cycles - 1


def test_another_scene_is_another_world(path):
    """A new epoch, the start posture."""
    core = LoopCore(MujocoBackend(scene.vary(scene.load(), 3)), dynamics=DYNAMICS)
    keeper = Keeper(path, core, core.backend)
    killed_after(core, keeper, 3)
    other, again = reborn(path)
    assert not again.restored
    assert again.epoch != keeper.epoch
    assert other.cycles == 0


def test_the_largest_world_is_kept(path):
    """As many grains as a scene may have, each with its turns: they fall on as they would have."""
    content = scene.Content(grains=scene.MOST_GRAINS, spin=True)
    largest = msgspec.structs.replace(scene.load(), content=content)
    core, other = (LoopCore(MujocoBackend(largest), dynamics=DYNAMICS) for _ in range(2))
    keeper = Keeper(path, core, core.backend)
    killed_after(core, keeper, 20)
    assert len(core.backend.save()) == pytest.approx(20e3, rel=0.05), "as a comment there says"
    assert Keeper(path, other, other.backend).restored
    for _ in range(50):
        core.cycle()
        other.cycle()
        assert everything(other) == everything(core)


@pytest.mark.parametrize("damage", [b"", b"VELMAWM1", b"x" * 100])
def test_a_damaged_file_is_a_new_world(path, damage):
    """And a file that was never written."""
    path.write_bytes(damage)
    core, keeper = reborn(path)
    assert not keeper.restored
    assert core.mode is Mode.MOTION


def test_a_robot_without_a_simulated_world_has_no_memory():
    """Its world does not end with the process."""
    assert isinstance(MujocoBackend(scene.load()), Restorable)
    assert not isinstance(MockBackend(), Restorable)


# --- processes ------------------------------------------------------------------------------------


@pytest.mark.process
def test_kill_9_amid_a_motion_stops_nothing_but_the_motion(tmp_path):
    """The arms come to rest along their path; no joint and no set-point jumps; the next motion
    starts there.
    """
    slots = tmp_path / "loop.slots"
    rise = (lambda u: u**3 * (10 - 15 * u + 6 * u * u))(np.linspace(0, 1, 401))[:, None] * 0.3
    with loop_process(slots) as (child, agent):
        began = seen(agent)
        agent.send(motion("up", began.setpoint + rise))
        until(lambda: agent.beat() or seen(agent).time_s > began.time_s + 1.5)
        child.kill()
        child.wait(timeout=10)
        last = seen(agent)
    with loop_process(slots) as (_, agent):
        # nobody beats, and nobody has to
        until(lambda: agent.told().report.phase is Phase.CANCELLED)
        state = seen(agent)
        assert (state.epoch, state.mode, state.faults) == (began.epoch, Mode.MOTION, 0)
        assert began.time_s + 1.5 < last.time_s <= state.time_s < last.time_s + 1.0
        assert np.abs(state.setpoint - last.setpoint).max() < 0.1  # what 0.3 s of braking take
        assert np.abs(state.setpoint - state.q).max() < 0.02
        number = agent.send(motion("on", state.setpoint + rise / 10))
        until(lambda: agent.beat() or agent.told().taken == number)
        until(lambda: agent.beat() or agent.told().report.phase is Phase.DONE)


@pytest.mark.process
def test_a_stop_outlives_the_loop_and_its_release_is_heard_while_none_runs(tmp_path):
    """A person stopped it: it is stopped in the next loop, too, and moves again only after the
    release.
    """
    slots = tmp_path / "loop.slots"
    with loop_process(slots) as (_, agent):
        StopLink(slots).stop()
        until(lambda: seen(agent).mode is Mode.STOPPED)
    with loop_process(slots) as (_, agent):
        assert seen(agent).mode is Mode.STOPPED
    StopLink(slots).release()
    with loop_process(slots) as (_, agent):
        until(lambda: seen(agent).mode is Mode.MOTION)
