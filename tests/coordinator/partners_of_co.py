"""co on pretend wires among hi, pl and ta that do what a test says, or what a policy says."""

from msgspec.structs import replace
from scripted_partner import Puppet

from agent_runtime.core.wiring import Wiring
from agent_runtime.testing.memory_bus import MemoryBus
from companion.design import AgentName, wiring
from companion.languages import hfsm, sw
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.tasks.pour.command import PourInto
from fipa_codec import languages
from fipa_codec.performatives import Performative as P
from services.coordinator.behaviours import agent
from services.coordinator.memory import Limits

POUR = PourInto("jar", "bowl")
LIMITS = Limits(planning_s=60.0)
UNREACHED = fact(Kind.UNREACHED, Side.LEFT, "jar_1")
SLIPS = fact(Kind.SLIPS, Side.LEFT, 0.1)
CANCELLED = fact(Kind.CANCELLED)
BUSY = fact(Kind.BUSY, AgentName.TA)


def run_plans(turn, received):
    """A policy of ta: says Running at once."""
    if received.communicate.performative is P.REQUEST:
        report = sw.Report(sw.WorkerState.RUNNING, at=hfsm.Place(("end",)))
        turn.say(received.conversation, P.INFORM, report)


class Scene:
    """MemoryBus with all four; words of the test are said after what is under way has settled."""

    def __init__(self, *, limits=LIMITS, seed=0, faults=None, **answers):
        self.wires = MemoryBus(seed=seed, faults=faults)
        self.answers = {"ta": run_plans} | answers
        self.puppets = {name: Puppet(name, self.answers.get(name)) for name in ("hi", "pl", "ta")}
        for name, puppet in self.puppets.items():
            self.wires.add(puppet.agent(), unchecked(wiring(name, "test")))
        self.co = self.wires.add(agent(limits), wiring("co", "test"))
        self.settle()

    # --- what the test says -----------------------------------------------------------------------

    def do(self, name, act):
        """Have a puppet act."""
        self.wires.post(name, act)
        self.settle()

    def settle(self, seconds=0.05):
        """Let messages arrive."""
        self.wires.run_for(seconds)

    def command(self, task=POUR):
        """Hi commands; the conversation."""
        opened = []
        self.do("hi", lambda turn: opened.append(turn.open("co", "request", P.REQUEST, task)))
        return opened[0]

    def cancel(self, task):
        """Hi cancels."""
        self.do("hi", lambda turn: turn.say(task, P.CANCEL))

    def pl(self, performative, content, **more):
        """Pl says something in its last conversation."""
        self.do("pl", lambda turn: turn.say(self.asked("pl"), performative, content, **more))

    def plan(self, duration=100.0, suspend=0.0, resume=0.0):
        """Pl has a plan."""
        self.pl(P.INFORM, a_plan(duration, suspend, resume))

    def pl_stops(self):
        """Pl answers a cancel."""
        self.pl(P.INFORM, no_plan(CANCELLED), kind=languages.Kind.CANCEL)

    def ta(self, state, **more):
        """Ta reports."""
        self.do("ta", lambda turn: turn.say(self.asked("ta"), P.INFORM, sw.Report(state, **more)))

    def succeed(self):
        self.ta(sw.WorkerState.SUCCEEDED)

    def carry_out(self, *plan, **more):
        """Pl has a plan, and ta carries it out."""
        self.plan(*plan, **more)
        self.succeed()

    def running(self, task=POUR):
        """Hi commands, pl plans, ta runs; the conversation with hi."""
        name = self.command(task)
        self.plan()
        return name

    # --- what the test sees -----------------------------------------------------------------------

    def heard(self, name, conversation=""):
        """Return the words a puppet heard as (performative, content), of one conversation or of
        all.
        """
        said = [
            (one.communicate.performative, one.content, one.conversation)
            for one in self.puppets[name].heard
        ]
        return [(act, content) for act, content, talk in said if conversation in ("", talk)]

    def acts(self, name, conversation=""):
        """The performatives a puppet heard."""
        return [performative for performative, _ in self.heard(name, conversation)]

    def requests(self, name):
        """The contents of what co requested of a puppet."""
        return [content for act, content in self.heard(name) if act is P.REQUEST]

    def asked(self, name):
        """The last conversation co opened with a puppet."""
        heard = ((one.conversation, one.communicate) for one in self.puppets[name].heard)
        return [talk for talk, message in heard if message.performative is P.REQUEST][-1]

    def agreed(self, task):
        """The facts that hi was told when co agreed to a task."""
        return next(content.why for act, content in self.heard("hi", task) if act is P.AGREE)

    def said(self, task):
        """Return the reports to hi about a task as `performative state`, in order."""
        heard = self.heard("hi", task)
        return [f"{act} {getattr(content, 'state', 'reason')}" for act, content in heard]

    def last_why(self, task):
        """The facts of the last report on a task."""
        return [content.why for _, content in self.heard("hi", task)][-1]

    def ended(self, task, *last, why=None):
        """Assert what hi was told last of a task, and why; that everybody rests, and the next
        command is served.
        """
        assert self.said(task)[-len(last) :] == list(last)
        assert why is None or self.last_why(task) == why
        assert self.at_rest()
        if self.puppets["ta"].answer is run_plans:
            assert self.serves()

    @property
    def state(self):
        """Co's state."""
        return self.co.state.state

    @property
    def memory(self):
        """Co's memory."""
        return self.co.state.memory

    def at_rest(self):
        """All are up, co has nothing to do, and no conversation is open anywhere."""
        states = [node.state for node in self.wires.nodes.values()]
        if any(state is None or state.conversations for state in states):
            return False
        return self.state == "trigger" and not (self.memory.jobs or self.memory.loose)

    def serves(self):
        """A command is carried out from start to end."""
        name = self.running()
        self.succeed()
        return self.said(name)[-1] == "inform done" and self.at_rest()


def unchecked(wired):
    """The wiring of a partner that may say what its interface does not have."""
    links = tuple(replace(link, says={}) for link in wired.links)
    return Wiring(wired.system, wired.agent, links, wired.languages)


def a_plan(duration=100.0, suspend=0.0, resume=0.0):
    """A small plan, its schedule parameters those of its only state."""
    state = hfsm.EndState("end", hfsm.Outcome.SUCCEEDED)
    schedule = (hfsm.ScheduleParameters("end", duration, suspend, resume),)
    main = hfsm.Machine("main", "end", (state,))
    return hfsm.HierarchicalPlan("p", "pour", main, duration, 1, schedule)


def a_plan_of(steps):
    """A plan with steps of these names; the value is the planned time from there to the end [s]."""
    schedule = tuple(hfsm.ScheduleParameters(name, rest) for name, rest in steps.items())
    end = (hfsm.EndState("end", hfsm.Outcome.SUCCEEDED),)
    states = (hfsm.Machine(name, "end", end, step=hfsm.Step(name)) for name in steps)
    root = hfsm.Machine("main", next(iter(steps)), tuple(states))
    return replace(a_plan(), root=root, schedule=schedule)


def no_plan(*why):
    """Return a NoPlan with its reasons."""
    return hfsm.NoPlan("p", why or (UNREACHED,))


def stop_planning(turn, received):
    """A policy of pl: answers a cancel at once."""
    if received.communicate.performative is P.CANCEL:
        turn.say(received.conversation, P.INFORM, no_plan(CANCELLED), kind=languages.Kind.CANCEL)


def refuse_plans(turn, received):
    """A policy of ta."""
    if received.communicate.performative is P.REQUEST:
        turn.say(received.conversation, P.REFUSE, sw.Report(sw.WorkerState.FAILED, why=(BUSY,)))
