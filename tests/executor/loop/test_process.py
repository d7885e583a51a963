"""The loop with its slots, turned by hand: what an agent and a person on the other side see."""

import mmap
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from typer.testing import CliRunner

from companion.languages.facts import Kind, fact
from companion.skills.loop_messages import Cancel, LookAgain, Mode, Phase, Release, motion
from companion.tools.verbs.hi import Hi
from console.__main__ import app
from services.executor.loop.__main__ import build
from services.executor.loop.backends import PARTS
from services.executor.loop.link import AgentLink, StopLink
from services.executor.loop.memory import MEMORY
from services.executor.loop.process import SHOW_EVERY, Histogram, Pacer, Speed
from services.human_interface.server import HttpDevice
from velma.model import scene
from velma.names import START
from velma.sim.backend import PERIOD_S
from velma.sim.mock_backend import MockBackend
from velma.sim.mujoco_backend import MujocoBackend
from velma.sim.truth import Truth

pytestmark = pytest.mark.process


def made(folder, backend, speed):
    """A loop, its agent, and the path of its slots."""
    folder.mkdir(exist_ok=True)
    path = folder / "loop.slots"
    return build(path, backend, speed=speed, realtime=False), AgentLink(path), path


@pytest.fixture
def pair(tmp_path, clock):
    """A loop on the pretended robot at full speed."""
    return made(tmp_path, MockBackend(), Speed.MAX)


def rise(start, seconds=0.5):
    return start + np.linspace(0, 0.1, round(seconds * 100))[:, None] ** 2


def begin(loop, agent, seconds=2.0, **options):
    """Send a motion, and turn once."""
    number = agent.send(motion("up", rise(agent.state().setpoint, seconds), **options))
    loop.turn()
    return number


def turns(loop, count):
    for _ in range(count):
        loop.turn()


def turn(loop, agent, most=5000, until=lambda told: told.report.phase is not Phase.RUNNING):
    """Turn while the agent lives, until it is so; return the state and the answer of that time."""
    for _ in range(most):
        if until(agent.told()):
            return agent.state(), agent.told()
        agent.beat()
        loop.turn()
    raise AssertionError("it was not told")


def look_due(told):
    return told.look


def test_an_agent_sees_its_motion_taken_running_and_done(pair):
    """The number it was given, then the phases. At full speed, simulated time goes on only while
    something happens.
    """
    loop, agent, _ = pair
    before = agent.state().time_s
    turns(loop, 50)
    assert agent.state().time_s == before
    number = begin(loop, agent, 0.5)
    told = agent.told()
    assert (told.taken, told.refusal) == (number, None)
    assert (told.report.key, told.report.phase) == ("up", Phase.RUNNING)
    state, told = turn(loop, agent)
    assert told.report.phase is Phase.DONE
    assert not state.busy
    np.testing.assert_allclose(state.setpoint, rise(START)[-1])
    assert state.q.shape == state.v.shape == (15,)
    assert state.fingers(1)[0].shape == (3,)


def test_a_refusal_reaches_the_agent(pair):
    """With the number of what was refused; nothing moves."""
    loop, agent, _ = pair
    number = agent.send(motion("far", START + 1.0))
    loop.turn()
    assert agent.told().taken == number
    assert agent.told().refusal.why == (fact(Kind.MOTION_REFUSED, "first_knot"),)
    assert "set-point" in agent.told().refusal.text
    agent.file.slots["command"].write(b"garbage")
    loop.turn()
    assert agent.told().refusal.why == (fact(Kind.BAD_COMMAND, "command"),)
    assert "not a command" in agent.told().refusal.text


# --- looks at a motion ----------------------------------------------------------------------------


def looked_at(folder, speed=Speed.MAX, later_s=0.0, backend=None):
    """A loop in a motion of 2 s with a look every 0.5 s, the first one later, its agent, and when
    it began.
    """
    loop, agent, _ = made(folder, backend or MockBackend(), speed)
    began = agent.state().time_s
    begin(loop, agent, look_every_s=0.5 + later_s)
    return loop, agent, began


def test_time_waits_for_a_look_at_full_speed(tmp_path, clock):
    """It is due after so long, not later; the next one so long after that as the answer says."""
    loop, agent, began = looked_at(tmp_path)
    for again_s, due in ((0.1, 0.5), (0.5, 0.6), (60.0, 1.1)):
        state, _ = turn(loop, agent, until=look_due)
        assert state.time_s - began == pytest.approx(due, abs=0.003)
        for _ in range(100):
            agent.beat()
            loop.turn()
        assert agent.state().time_s == state.time_s
        agent.send(LookAgain("another motion", 0.1))
        loop.turn()
        assert agent.told().look
        agent.send(LookAgain("up", again_s))
        loop.turn()
        assert not agent.told().look
    assert turn(loop, agent)[1].report.phase is Phase.DONE


@pytest.mark.parametrize("cycles", range(SHOW_EVERY))
def test_a_look_is_told_whenever_it_is_due(tmp_path, clock, cycles):
    """Also in a cycle in which the state is shown: a simulator is read once more for that, and its
    time has gone on.
    """
    later_s = cycles * PERIOD_S
    loop, agent, began = looked_at(tmp_path, later_s=later_s, backend=MujocoBackend(scene.load()))
    state, _ = turn(loop, agent, until=look_due)
    assert state.time_s - began == pytest.approx(0.5 + later_s, abs=0.003)


def test_in_real_time_nothing_waits_for_a_look(tmp_path, clock):
    """Nobody answers: the motion is done in its time."""
    loop, agent, _ = looked_at(tmp_path, Speed.REAL)
    turn(loop, agent, until=look_due)
    report = turn(loop, agent)[1].report
    assert report.phase is Phase.DONE
    assert report.time_s == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("end", ["cancel", "silence"])
def test_an_end_waits_for_no_look(tmp_path, clock, end):
    """Neither a cancel nor the end of an act whose agent is gone."""
    loop, agent, _ = looked_at(tmp_path)
    turn(loop, agent, until=look_due)
    if end == "cancel":
        agent.send(Cancel("up"))
        assert turn(loop, agent)[1].report.phase is Phase.CANCELLED
    else:
        silent(loop, clock, 6.0)
        assert agent.told().report.phase is Phase.INTERRUPTED
        assert agent.state().mode is Mode.HOLD
    assert not agent.told().look


# --- an agent that is late, or gone ---------------------------------------------------------------


@pytest.fixture(params=[Speed.REAL, Speed.MAX])
def at_speed(request, tmp_path, clock):
    """A loop on the pretended robot in a motion of 2 s, its agent, and the clock, at both
    speeds.
    """
    loop, agent, _ = made(tmp_path, MockBackend(), request.param)
    turns(loop, 5000)
    assert agent.state().mode is Mode.MOTION, "between acts nobody need beat"
    begin(loop, agent)
    return loop, agent, clock


def silent(loop, clock, seconds):
    """Turn for a while of wall time, at least as long as a turn of 2 ms takes; the set-points on
    the way.
    """
    end, points = clock.now + seconds, []
    while clock.now < end:
        before = clock.now
        loop.turn()
        clock.now = max(clock.now, before + 0.002)
        points.append(loop.core.setpoint[0])
    return points


def test_a_late_beat_brings_the_arms_to_rest_and_the_next_one_lets_them_go_on(request, at_speed):
    """0.5 s after the last beat nothing moves (at speed max nor does time); with beats the motion
    arrives.
    """
    loop, agent, clock = at_speed
    goal = rise(agent.state().setpoint, 2.0)[-1]
    points, began = silent(loop, clock, 0.5), loop.core.state.time
    points += silent(loop, clock, 3.5)
    passed = loop.core.state.time - began
    assert points[0] < points[-1] < 0.5 * goal[0], "it moved, and not to the end"
    rest = points[250:]
    assert min(rest) == max(rest), "at rest within half a second"
    real = request.node.callspec.params["at_speed"] is Speed.REAL
    assert passed == pytest.approx(3.5 if real else 0.0, abs=0.01)
    assert agent.told().report.phase is Phase.RUNNING
    state, told = turn(loop, agent)
    assert told.report.phase is Phase.DONE
    np.testing.assert_allclose(state.setpoint, goal)


def test_an_agent_that_stays_silent_loses_its_act(at_speed):
    """After 5 s: damping, then hold; the word for it says that the machine ended it."""
    loop, agent, clock = at_speed
    silent(loop, clock, 4.5)
    assert agent.told().report.phase is Phase.RUNNING
    silent(loop, clock, 1.0)
    assert agent.told().report.phase is Phase.INTERRUPTED
    assert agent.told().report.why == (fact(Kind.GAVE_NO_ANSWER, "ex"),)
    assert agent.state().mode is Mode.HOLD


def test_a_machine_that_stood_still_has_interrupted_nothing(at_speed):
    """Loop and agent were suspended together for a minute: both go on where they were."""
    loop, agent, clock = at_speed
    clock.now += 60.0
    loop.turn()
    assert loop.core.report.phase is Phase.RUNNING
    assert turn(loop, agent)[1].report.phase is Phase.DONE


def test_a_motion_of_a_dead_agent_can_be_cancelled_by_the_next_one(at_speed):
    """It is at rest; the new agent's cancel ends it, at once and without a step further."""
    loop, agent, clock = at_speed
    silent(loop, clock, 2.0)
    at = loop.core.setpoint.copy()
    agent.send(Cancel("up"))
    state, told = turn(loop, agent)
    assert told.report.phase is Phase.CANCELLED
    np.testing.assert_allclose(state.setpoint, at, atol=1e-3)


# --- a person stops the robot ---------------------------------------------------------------------


def test_no_agent_releases_what_a_person_stopped(pair):
    """Nor after a fault, which agents release."""
    loop, agent, path = pair
    people = StopLink(path)
    people.stop()
    loop.turn()
    for mode in (Mode.STOPPED, Mode.DAMPING):
        assert loop.core.mode is mode
        agent.send(Release())
        loop.turn()
        assert agent.told().refusal.why == (fact(Kind.HELD_STILL, "stopped"),)
        loop.core.hold(1.1)
        assert loop.core.mode is Mode.STOPPED
        loop.core._fault(RuntimeError("a fault"))
    people.release()
    loop.turn()
    loop.core.hold(1.1)
    assert loop.core.mode is Mode.MOTION


def test_a_stop_in_words_is_obeyed_within_two_cycles_by_a_loop_alone(pair):
    """There is no fleet, no agent, no router, no key, no supervisor: a folder with the files of the
    loop. The release comes after the dwell, even where time stands still otherwise.
    """
    loop, agent, path = pair

    def said(*words):
        return CliRunner().invoke(app, [*words, "--run-dir", str(path.parent)])

    sentences = ("STOP!!!", "no, don't touch that", "stój", "help")
    for words in (("stop",), *(("say", one) for one in sentences)):
        begin(loop, agent)
        assert agent.state().mode is Mode.MOTION, words
        done = said(*words)
        assert (done.exit_code, "until `roco release`" in done.stdout) == (0, True), done.output
        at = agent.state().cycles
        turns(loop, 2)
        assert (agent.state().mode, agent.state().cycles - at <= 2) == (Mode.STOPPED, True), words
        turns(loop, 510)
        assert agent.state().mode is Mode.STOPPED, "leaving is explicit"
        assert said("release").exit_code == 0
        turns(loop, 510)
        assert agent.state().mode is Mode.MOTION


def test_a_stop_over_http_is_obeyed_though_the_agent_hangs(pair):
    """hi's threads alone, and the loop."""
    loop, agent, path = pair
    begin(loop, agent)
    desk = HttpDevice(lambda content, delay_s=0.0: None, path.parent)
    try:
        assert Hi(desk.address).say("halt").state == "stopped"
        loop.turn()
        assert agent.state().mode is Mode.STOPPED
        assert Hi(desk.address).hold(False).state == "released"
        turns(loop, 510)
        assert agent.state().mode is Mode.MOTION
    finally:
        desk.close()


def test_the_end_is_damping(pair):
    """The loop damps when it is told to end, whatever runs."""
    loop, agent, _ = pair
    begin(loop, agent)
    loop.end()
    assert agent.told().report.phase is Phase.INTERRUPTED
    assert agent.state().mode is not Mode.MOTION


# --- timing ---------------------------------------------------------------------------------------


def test_lateness_is_counted_in_fixed_bins():
    """Percentiles within a bin of the true ones, the maximum exactly."""
    histogram = Histogram()
    assert histogram.figures() == {}
    for us in (*map(float, range(1000)), 1e6):
        histogram.add(us)
    figures = histogram.figures()
    assert (figures["p50"], figures["p99"]) == pytest.approx((500, 990), abs=6)
    assert figures["max"] == 1e6


def test_a_pacer_keeps_absolute_deadlines_and_gives_up_what_is_long_gone(clock):
    """A late cycle is caught up; a long absence is counted as skipped periods, not run through."""
    pacer = Pacer(0.002)
    for _ in range(100):
        pacer.wait()
        clock.now += 0.0005
        pacer.done()
    assert clock.now == pytest.approx(99 * 0.002 + 0.0005)
    for absent, skipped in ((0.003, 0), (1.0, 500)):
        clock.now += absent
        pacer.wait()
        pacer.done()
        assert pacer.timing().skipped == pytest.approx(skipped, abs=skipped and 3)


def test_a_pacer_waits_as_long_as_was_rested(clock):
    """The next wait takes one period. Rested periods are not counted as cycles."""
    pacer, began = Pacer(0.002), clock.now
    waits = []
    for rested in (0, 5, 0, 3, 0):
        pacer.wait()
        waits.append(round(1e3 * (clock.now - began), 6))
        pacer.rest(rested) if rested else pacer.done()
    assert waits == [0, 2, 12, 14, 20]
    timing = pacer.timing()
    assert (timing.cycles, timing.rested, timing.missed) == (3, 8, 0)


def test_page_faults_are_counted_while_a_motion_is_under_way(clock):
    """Each first write to a page is a minor one; between motions they count for nothing."""
    pacer, pages = Pacer(0.002), 50
    with mmap.mmap(-1, 3 * pages * mmap.PAGESIZE) as memory:
        counted = []
        for part, moving in enumerate((True, False, True)):
            pacer.go()
            for page in range(part * pages, (part + 1) * pages):
                memory[page * mmap.PAGESIZE] = 1
            pacer.done(moving)
            counted.append(pacer.timing().page_faults.minor)
    first, still, second = counted
    assert first >= pages
    assert still == first
    assert second >= first + pages
    assert pacer.timing().page_faults.late == 0


# --- a simulated world, also one that stands still ------------------------------------------------


def still(folder, seconds=3.0, world=None):
    """A loop in real time whose simulated world has had these seconds to come to rest, its agent
    and its path.
    """
    loop, agent, path = made(folder, MujocoBackend(world or scene.load()), Speed.REAL)
    until = loop.core.state.time + seconds
    while loop.core.state.time < until:
        loop.turn()
    return loop, agent, path


def turned(loop):
    """Turn once; return how much simulated time has passed, and the largest change of a
    coordinate.
    """
    time_s, before = loop.core.backend.data.time, loop.core.backend.configuration().copy()
    loop.turn()
    moved = np.abs(loop.core.backend.configuration() - before).max()
    return pytest.approx(loop.core.backend.data.time - time_s), moved


def test_a_world_that_stands_still_is_not_computed_but_its_time_passes_and_is_shown(
    tmp_path, clock
):
    """Every 50 ms, with the clock, and shown every 0.1 s; no cycle of it counts, none is missed.
    The agent gets the mirror's coordinates for the receptor; the truth is sealed, for the monitor.
    """
    loop, agent, _ = still(tmp_path)
    began, before, shown = clock.now, agent.state(), agent.timing()
    for _ in range(40):
        assert turned(loop) == (0.050, 0.0)
        assert 0 <= loop.core.cycles - agent.state().cycles < 50
    after = agent.state()
    assert after.time_s - before.time_s == pytest.approx(2.0)
    assert clock.now - began == pytest.approx(2.0)
    assert after.cycles == before.cycles + 1000
    assert (after.body, after.world) == (before.body, before.world)
    timing = agent.timing()
    assert (timing.cycles, timing.rested) == (shown.cycles, shown.rested + 1000)
    assert (timing.missed, timing.skipped) == (0, 0)
    assert after.configuration.shape == (137,)
    assert msgspec.msgpack.decode(agent.sealed_truth(), type=Truth).grains_in["jar_1"] == 30


def test_a_world_that_stood_still_moves_from_the_next_turn_on_when_it_is_asked_to(tmp_path, clock):
    """A cycle takes 2 ms until the motion ends. Later the world stands still again."""
    loop, agent, _ = still(tmp_path)
    agent.send(motion("up", rise(agent.state().setpoint)))
    for _ in range(100):
        assert turned(loop)[0] == 0.002
    assert agent.told().report.phase is Phase.RUNNING
    state, told = turn(loop, agent)
    assert told.report.phase is Phase.DONE
    np.testing.assert_allclose(state.q, rise(START)[-1], atol=0.01)
    assert turned(loop)[0] == 0.002, "the arms swing out"
    turns(loop, 2500)
    assert turned(loop) == (0.050, 0.0)


def test_a_motion_after_a_rest_is_the_motion_without_one(tmp_path, clock):
    """It ends where the motion of a loop ends that computed every cycle."""
    rested, agent, _ = still(tmp_path)
    turns(rested, 200)
    plain, other, _ = made(tmp_path / "other", MujocoBackend(scene.load()), Speed.REAL)
    plain.core.hold(rested.core.state.time - plain.core.state.time)
    knots = rise(agent.state().setpoint)
    for loop, link in ((rested, agent), (plain, other)):
        link.send(motion("up", knots))
        loop.turn()
        turn(loop, link)
    np.testing.assert_allclose(agent.state().q, other.state().q, atol=1e-6)
    assert rested.core.cycles == pytest.approx(plain.core.cycles, abs=5)


@pytest.mark.parametrize("asked", ["stop", "release", "cancel", "refused"])
def test_whatever_is_asked_of_a_world_that_stands_still_has_it_computed(tmp_path, clock, asked):
    """For half a second at least: a stop changes the law of control, and what follows from it is
    seen.
    """
    loop, agent, path = still(tmp_path)
    assert turned(loop)[0] == 0.050
    if asked in ("stop", "release"):
        StopLink(path).stop()
        loop.turn()
    if asked == "release":
        turns(loop, 1500)
        StopLink(path).release()
    elif asked != "stop":
        agent.send(Cancel("none") if asked == "cancel" else motion("far", START + 1.0))
    loop.turn()
    assert [turned(loop)[0] for _ in range(240)] == [0.002] * 240


def test_what_creeps_is_computed(tmp_path, clock):
    """A jar that is pulled a little moves over its table by tenths of a millimetre in a second."""
    loop, agent, _ = still(tmp_path)
    agent.send(Cancel("none"))
    data, jar = loop.core.backend.data, loop.core.backend.model.body("jar_1").id
    data.xfrc_applied[jar, 0] = 0.2
    assert all(turned(loop)[0] == 0.002 for _ in range(1500))


def test_a_robot_whose_joints_are_measured_with_noise_is_computed(tmp_path, clock):
    """Its arms tremble, whatever it is asked."""
    world = scene.load()
    noisy = msgspec.structs.replace(world, noise=msgspec.structs.replace(world.noise, joint=1e-4))
    loop, _, _ = still(tmp_path, world=noisy)
    assert turned(loop)[0] == 0.002


def test_a_world_is_saved_whether_or_not_it_can_rest(tmp_path, clock):
    """A back-end of others may have the one without the other."""
    backend = MujocoBackend(scene.load())
    parts = (*PARTS, "fingerprint", "save", "restore", "data")
    other = SimpleNamespace(**{name: getattr(backend, name) for name in parts})
    loop, _, _ = made(tmp_path, other, Speed.REAL)
    assert all(turned(loop)[0] == 0.002 for _ in range(2000))
    assert (tmp_path / MEMORY).exists()


def test_a_robot_that_is_not_simulated_has_a_cycle_every_2_ms(tmp_path, clock):
    """At rest, too."""
    loop, _, _ = made(tmp_path, MockBackend(), Speed.REAL)
    loop.turn()
    before = loop.core.cycles, clock.now
    turns(loop, 50)
    assert loop.core.cycles == before[0] + 50
    assert clock.now - before[1] == pytest.approx(0.1)
