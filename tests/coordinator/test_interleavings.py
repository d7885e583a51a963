"""co under chance: partners that take their time and end as they like, wires that lose, a co that
is killed.
"""

import random

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from partners_of_co import CANCELLED, POUR, SLIPS, Scene, a_plan, no_plan

from agent_runtime.core.step import OUTSIDE
from agent_runtime.testing.memory_bus import Faults, Point
from companion.design import DESIGN, AgentName
from companion.languages import cmd, hfsm, rc, sw, wm
from companion.languages.facts import Kind, fact
from companion.languages.sw import WorkerState
from companion.tasks.look_around.command import LookAround
from companion.tasks.put_down.command import PutDown
from companion.tasks.take.command import Take
from fipa_codec import languages
from fipa_codec.performatives import Performative as P
from services.coordinator.behaviours import agent
from services.coordinator.memory import CONDITIONS, Limits
from services.task import acts
from services.task.behaviours import BARRIER_S

COMMANDS = (
    POUR,
    Take("jar", "left", urgency=1),
    PutDown("jar"),
    LookAround(urgency=2),
    LookAround(),
    Take("box"),
)
ENDS = tuple(sw.FINAL)
# virtual time in which everything must have ended: a few planned durations, late ones included
GRACE_S = 2000.0


class Chance:
    """pl and ta that answer by chance, after a while; they obey their role tables and end
    everything they began.
    """

    def __init__(self, scene, seed, slow):
        self.scene, self.chance, self.slow = scene, random.Random(seed), slow
        scene.puppets["pl"].answer, scene.puppets["ta"].answer = self.pl, self.ta

    def later(self, name, act):
        """In a while; now and then so late that reply-by passes."""
        delay = self.chance.choice((0.0, 0.001, 0.5, 5.0, 700.0 if self.slow else 10.0))
        self.scene.wires.post(name, act, delay)

    def pl(self, turn, received):
        """Agree or refuse; a plan or none; a cancel is answered at once."""
        name = received.conversation
        match received.communicate.performative:
            case P.REQUEST if self.chance.random() < 0.2:
                turn.say(name, P.REFUSE, no_plan())
            case P.REQUEST:
                if self.chance.random() < 0.5:
                    turn.say(name, P.AGREE)
                self.later("pl", lambda turn: self.give_plan(turn, name))
            case P.CANCEL if self.chance.random() < 0.5:
                turn.say(name, P.INFORM, no_plan(CANCELLED), kind=languages.Kind.CANCEL)
            case P.CANCEL:
                self.later("pl", lambda turn: self.stop(turn, name))

    def give_plan(self, turn, name):
        """Unless it was cancelled and answered meanwhile."""
        if not turn.holds(name):
            return
        has_plan = self.chance.random() < 0.7
        turn.say(name, P.INFORM, a_plan(self.chance.choice((5.0, 60.0)))) if has_plan else turn.say(
            name, P.FAILURE, no_plan()
        )
        if turn.holds(name):
            late = no_plan(fact(Kind.TOOK_TOO_LONG, AgentName.PL))
            turn.say(name, P.FAILURE, late, kind=languages.Kind.CANCEL)

    def stop(self, turn, name):
        """Answer the cancel, unless the plan did so."""
        if turn.holds(name):
            turn.say(name, P.INFORM, no_plan(CANCELLED), kind=languages.Kind.CANCEL)

    def ta(self, turn, received):
        """Run or refuse; end by chance."""
        name = received.conversation
        match received.communicate.performative:
            case P.REQUEST if self.chance.random() < 0.15:
                turn.say(name, P.REFUSE)
            case P.REQUEST:
                turn.say(name, P.INFORM, sw.Report(WorkerState.RUNNING))
                self.later("ta", lambda turn: self.work(turn, name))
            case P.CANCEL if turn.holds(name):
                self.later("ta", lambda turn: self.report(turn, name, WorkerState.PREEMPTED))

    def work(self, turn, name):
        """One more state of the plan, or its end."""
        if self.chance.random() < 0.5:
            at = hfsm.Place(("main", f"{self.chance.randrange(9)}"))
            self.report(turn, name, WorkerState.RUNNING, at=at)
            self.later("ta", lambda turn: self.work(turn, name))
        else:
            self.report(turn, name, self.chance.choice(ENDS), why=(SLIPS,))

    def report(self, turn, name, state, **more):
        """Unless the final report is out."""
        if turn.holds(name) and turn.conversation(name).state != "finished":
            turn.say(name, P.INFORM, sw.Report(state, **more))


def person(scene, words):
    """hi that commands and cancels at these times; the conversations it opened."""
    opened = []

    def command(task):
        return lambda turn: opened.append(turn.open("co", "request", P.REQUEST, task))

    def cancel(which):
        def act(turn):
            name = opened[which % len(opened)] if opened else ""
            if turn.holds(name) and not turn.conversation(name).cancel:
                turn.say(name, P.CANCEL)

        return act

    for at, which, task in words:
        scene.wires.post("hi", command(COMMANDS[which % 6]) if task else cancel(which), at)
    return opened


def results(scene, task):
    """Return the acts that ended a task for hi: refuse, failure, inform of an end; not the answer
    to a late cancel.
    """
    return [act for act, content in scene.heard("hi", task) if is_end(act, content)]


def is_end(act, content):
    """A refuse, a failure or an end of a task; not the reason that answers a cancel that came too
    late.
    """
    return isinstance(content, cmd.TaskReport) and content.state in ("done", "failed", "cancelled")


def plan_at_once(turn, received):
    turn.say(received.conversation, P.INFORM, a_plan(20.0))


def run_out(scene):
    """Until nobody has an open conversation; every step of co is one of its rows."""
    scene.wires.run(scene.at_rest, limit_s=GRACE_S * 10)
    assert OUTSIDE not in scene.co.state.counts


times = st.sampled_from((0.0, 0.001, 0.0015, 0.4, 3.0, 8.0, 40.0))
words_of_hi = st.lists(st.tuples(times, st.integers(0, 5), st.booleans()), min_size=1, max_size=8)
calm = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow], max_examples=60)


@calm
@given(words_of_hi, st.integers(0, 2**32), st.booleans())
def test_every_command_of_hi_ends_exactly_once(words, seed, slow):
    """This holds for any acts of pl and ta at any time; then co is at rest and serves the next."""
    scene = Scene()
    Chance(scene, seed, slow)
    opened = person(scene, words)
    scene.settle(41.0)
    run_out(scene)
    for task in opened:
        assert len(results(scene, task)) == 1, scene.said(task)
    follow_up(scene)


def follow_up(scene):
    """Partners without whims: the next command is carried out."""
    for name in ("pl", "ta"):
        scene.puppets[name].answer = scene.answers.get(name)
    assert scene.serves()


@settings(deadline=None, max_examples=25)
@given(words_of_hi, st.integers(0, 2**32))
def test_loss_copies_delay_and_a_killed_co_change_nothing(words, seed):
    """The same promise over wires with faults, co dying at any point of its steps."""
    chance = random.Random(seed)
    scene = Scene(seed=seed, faults=Faults(loss=0.1, duplication=0.1, delay=0.1))
    Chance(scene, seed, False)
    opened = person(scene, words)
    for _ in range(3):
        scene.wires.crash("co", chance.choice(list(Point)), in_steps=chance.randrange(1, 12))
        scene.settle(15.0)
    scene.wires.run(lambda: scene.co.state is not None, limit_s=5.0)
    run_out(scene)
    for task in opened:
        assert len(results(scene, task)) == 1, scene.said(task)


@pytest.mark.parametrize("point", list(Point))
@pytest.mark.parametrize("step", range(1, 9))
def test_co_killed_once_at_each_step_goes_on(point, step):
    """Before, in and after a step: the pour ends done."""
    scene = Scene()
    scene.puppets["pl"].answer = plan_at_once

    def run_at_once(turn, received):
        if received.communicate.performative is P.REQUEST:
            turn.say(received.conversation, P.INFORM, sw.Report(WorkerState.RUNNING))
            turn.say(received.conversation, P.INFORM, sw.Report(WorkerState.SUCCEEDED))

    scene.puppets["ta"].answer = run_at_once
    scene.wires.crash("co", point, in_steps=step)
    name = scene.command()
    scene.settle(5.0)
    assert results(scene, name) == [P.INFORM]
    scene.ended(name, "inform done")


@pytest.mark.parametrize("dead", ["pl", "ta"])
def test_a_peer_that_is_dead_for_good_leaves_no_command_open(dead):
    """All that hi asked ends, late, and with the reason."""
    scene = Scene()
    scene.wires.crash(dead, Point.BEFORE, restart_s=1e9)
    scene.do(dead, lambda turn: None)
    if dead == "ta":
        scene.puppets["pl"].answer = plan_at_once
    tasks = [scene.command() for _ in range(3)]
    scene.settle(400.0)
    assert [len(results(scene, task)) for task in tasks] == [1, 1, 1]
    silent = fact(Kind.SAY_AGAIN_LATER, fact(Kind.NOT_ANSWERING, dead))
    whys = [scene.last_why(task) for task in tasks]
    assert whys == [(fact(Kind.NOT_ANSWERED, dead),), (silent,), (silent,)]


# --- the design -----------------------------------------------------------------------------------


def test_co_binds_exactly_the_names_of_the_design():
    """agent() would raise; and every condition of the design is a function of the same name."""
    assert set(CONDITIONS) == DESIGN.conditions("co")
    assert set(agent().behaviours) == {state.name for state in DESIGN.agent("co").state}


def test_the_arcs_of_the_design_are_taken(scene):
    """All of them, with a second task that waits while the first one runs."""
    taken = set()
    scene.wires.on_step = lambda agent, effects: taken.update(
        (line.fields["old"], line.fields["new"])
        for line in effects.logs
        if agent == "co" and line.event == "state"
    )
    first = scene.command()
    scene.command(LookAround())
    scene.plan(60.0, suspend=20.0, resume=20.0)
    scene.plan(5.0)
    scene.ta(WorkerState.REPLAN)
    scene.carry_out()
    scene.pl_stops()
    scene.pl(P.FAILURE, no_plan())
    assert scene.serves()
    designed = {(arc.source, arc.target) for arc in DESIGN.agent("co").arc}
    assert scene.said(first)[-1] == "inform done"
    assert designed - taken == set()


def test_memory_comes_back_from_the_journal_as_it_was(scene):
    """A plan runs, a task waits: the record holds it all."""
    scene.running()
    scene.command()
    stored = msgspec.msgpack.decode(scene.co.state.kept, type=type(scene.memory))
    assert stored == scene.memory


def test_co_waits_longer_for_a_plan_than_ta_for_all_its_acts():
    """By ta's own waits: where every act takes as long as it may, ta asks for a new plan before co
    gives up.
    """
    act = hfsm.ActState("act", rc.Home("k", side="left"))
    ask = hfsm.AskState("ask", wm.ListObjects())
    inner = hfsm.Machine("inner", "act", (act, ask), safe=hfsm.Machine("safe", "act", (act,)))
    plan = hfsm.HierarchicalPlan("p", "pour", hfsm.Machine("main", "inner", (inner, act)), 100.0, 1)
    longest = 5.0 * plan.duration + 3 * acts.MARGIN_S
    assert Limits().acting_s(plan) > longest + acts.STOPPED_S + BARRIER_S
