"""All agents of the design on virtual wires, with a person at hi; search and robot as the test
wants them.

Whatever a test does with a fleet, `close` finds what is wrong in any run: an act that began twice,
a step outside the design, a message that the design does not allow, and, of wires that make no
copies, a violation of its protocols.
"""

from importlib import import_module
from itertools import groupby

from pretended_robot import Robot, World
from scripted_search import Script

from agent_runtime.core.control import SetParameter
from agent_runtime.core.step import OUTSIDE
from agent_runtime.testing.memory_bus import MemoryBus
from companion.autonomy import LEVEL, STEP, Permission, Verb
from companion.design import DESIGN, LANGUAGES, SW, wiring
from companion.languages import sw
from companion.languages.cmd import TaskState
from companion.tools.system import JOB, PROCESSES
from fipa_codec.communicate import Communicate, encode
from services.human_interface.device_messages import Answer, CancelWanted, Sentence
from services.human_interface.grammar import understand
from services.knowledge.store import device_at
from topdown.judge.judge import Judge
from topdown.judge.verdicts import Judgement, Verdict

MODULES = {one.name: f"{one.module}.behaviours" for one in PROCESSES if one.name in DESIGN.agents}
NAMES = tuple(DESIGN.agents)
FINAL = (TaskState.DONE, TaskState.FAILED, TaskState.CANCELLED)
POUR = "pour the jar into the bowl"
LATE = {Verdict.LATE, Verdict.UNANSWERED}
"""True verdicts where a peer is dead for too long."""


class Person:
    """The device of hi: keeps what was told; outlives hi."""

    busy = False

    def __init__(self):
        self.told = []

    def tell(self, content):
        """Hear it."""
        self.told.append(content)

    def close(self):
        """Nothing to close."""


class Fleet:
    """`say` and `cancel` as a person would; `tasks` as hi shows them; `deeds`: those of all agents,
    in order.
    """

    def __init__(self, *, seed=0, faults=None, search=None, robot=None):
        self.wires = MemoryBus(seed=seed, faults=faults)
        self.world, self.person = World(), Person()
        self.asked = []
        self.deeds = []
        self.judge, self.judgements = Judge(DESIGN, LANGUAGES), list[Judgement]()
        self.judged = faults is None or not faults.duplication
        self._lives = {}
        self.watch = lambda agent, effects: None
        self._tickets = 0
        devices = {
            "hi": lambda post: self.person,
            "pl": search or (lambda post: Script(post, self.asked)),
            "km": device_at(None),
            "ex": robot or self._robot,
        }
        for name in NAMES:
            agent = import_module(MODULES[name]).agent()
            self.wires.add(agent, wiring(name, "test"), devices.get(name))
        self.wires.traffic = Heard(self)
        self.wires.on_step = self._stepped

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        self.wires.close()
        assert kind is not None or not (found := self.wrong()), found

    def _robot(self, post):
        return Robot(
            post, self.world, lambda delay, call: self.wires._at(self.wires.now + delay, call)
        )

    def _stepped(self, agent, effects):
        state = self.wires.nodes[agent].state
        if state is not None and self._lives.get(agent) != state.incarnation:
            self._lives[agent] = state.incarnation
            self.judgements += self.judge.lived(
                agent, state.incarnation, self.wires.now, fresh=True
            )
        if effects.deed is not None:
            self.deeds.append((agent, effects.deed))
        self.watch(agent, effects)

    # --- what a person does -----------------------------------------------------------------------

    def say(self, text=POUR, urgency=0):
        """A person's words; hi is asked again until it knows its co."""
        self._tickets += 1
        self.until(lambda: self.up("hi") and "co" in self.wires.nodes["hi"].state.soft.peers)
        said = Sentence(f"t{self._tickets}", text, understand(text), urgency=urgency)
        self.wires.post("hi", said)

    def cancel(self):
        """A person's cancel of the oldest open task."""
        self._tickets += 1
        self.wires.post("hi", CancelWanted(f"t{self._tickets}"))

    def order(self, verb, at=""):
        """The operator's order about the act that waits, or another one."""
        self.wires.order("ta", SetParameter(STEP, str(Permission(verb, at or self.waits_for))))

    def set_level(self, level):
        """How much ta does without asking an operator, from now on."""
        self.wires.order("ta", SetParameter(LEVEL, level.value))

    def begin(self, level):
        """Ask for a pour at this level, once the look around at the start is over, which waits for
        nobody.
        """
        self.until(lambda: self.state("ta") == "surveying")
        self.until(lambda: self.state("ta") == "idle")
        self.set_level(level)
        self.say()
        self.until(lambda: self.tasks)
        return self

    def let_go(self):
        """Let the act begin that waits, as soon as one does; its place in the plan, "" if all tasks
        ended before.
        """
        self.until(lambda: self.waiting or self.ended(len(self.tasks)))
        place = self.waits_for
        if place:
            self.order(Verb.GO)
            self.until(lambda: self.waits_for != place)
        return place

    def step_through(self):
        """Let all acts begin until the tasks have ended; their places in the plans."""
        return list(iter(self.let_go, ""))

    # --- what there is to see ---------------------------------------------------------------------

    def until(self, condition, limit_s=300.0):
        """Go on until this holds."""
        self.wires.run(lambda: bool(condition()), limit_s=limit_s)

    def up(self, name):
        """Whether the agent lives."""
        return self.wires.nodes[name].state is not None

    def state(self, name):
        """The state of an agent; "" of a dead one."""
        return self.wires.nodes[name].state.state if self.up(name) else ""

    @property
    def held(self):
        """What the hands hold, as ex remembers."""
        return self.wires.memory("ex").remembered.held

    @property
    def waits_for(self):
        """The place in the plan of the act that waits, as hi's person sees it."""
        return next((task.asks for task in self.tasks if task.asks), "")

    @property
    def waiting(self):
        """Whether ta waits and the person can see it."""
        return self.state("ta") == "waiting" and bool(self.waits_for)

    @property
    def steps(self):
        """Number of steps that each agent has made."""
        return {name: node.steps for name, node in self.wires.nodes.items()}

    @property
    def tasks(self):
        """Tasks as hi knows them."""
        memory = self.wires.memory("hi")
        return () if memory is None else memory.tasks

    def ended(self, count=1):
        """Whether that many tasks have ended."""
        return sum(task.state in FINAL for task in self.tasks) >= count

    def finish(self, count=1, limit_s=900.0):
        """Go on until that many tasks have ended and everybody rests; their states."""
        self.until(lambda: self.ended(count), limit_s)
        self.until(self.at_rest)
        return [str(task.state) for task in self.tasks]

    def at_rest(self):
        """All agents are up and wait for something new."""
        nodes = self.wires.nodes
        return all(
            self.up(name) and nodes[name].state.state == state for name, state in JOB.rests.items()
        ) and not any(nodes[name].state.conversations or nodes[name].state.due for name in NAMES)

    def why(self):
        """The reason that hi was told last of the first task."""
        return self.tasks[0].why

    def informs(self):
        """ta's informs to co."""
        for one in self.wires.traffic:
            if (one.sender, one.receiver, str(one.performative)) == ("ta", "co", "inform"):
                yield one, SW.decode(one.content)

    def reports(self):
        """ta's final reports to co, each once."""
        said = {(one.conversation, one.id): report.state for one, report in self.informs()}
        return [str(state) for state in said.values() if state in sw.FINAL]

    def answers(self):
        """Answers of hi to the person."""
        return [one for one in self.person.told if isinstance(one, Answer)]

    # --- what must hold of every run --------------------------------------------------------------

    def wrong(self):
        """Whatever is wrong in the run so far."""
        # an act has several motions, one after the other
        begun = [key for key, _ in groupby(self.world.begun)]
        twice = [f"{key} began again" for key in {key for key in begun if begun.count(key) > 1}]
        nodes = self.wires.nodes.items()
        left = ((name, node.state) for name, node in nodes if node.state)
        outside = [f"{name} left the design" for name, state in left if state.counts.get(OUTSIDE)]
        return [*twice, *outside, *against_design(self.wires.traffic), *self.violations()]

    def violations(self):
        """What the judge finds wrong."""
        if not self.judged:
            return []
        self.judgements += self.judge.finish(self.wires.now)
        wrong = [one for one in self.judgements if one.violation and one.verdict not in LATE]
        return [f"{one.verdict}: {one.heard.communicate} {one.why}" for one in wrong]

    def close(self):
        """Close all devices, and look at the run."""
        self.__exit__(None)


class Heard(list[Communicate]):
    """The traffic of a fleet, which its judge hears as it is sent."""

    def __init__(self, fleet):
        super().__init__()
        self._fleet = fleet

    def append(self, communicate):
        """It is sent."""
        super().append(communicate)
        fleet, key = self._fleet, DESIGN.key("test", communicate)
        if fleet.judged:
            fleet.judgements += fleet.judge.hear(key, encode(communicate), fleet.wires.now)


def against_design(traffic):
    """What was said by whom it is not allowed to, in another language or class, or at greater
    length.
    """
    return {found for one in traffic if (found := _against_design(one))}


def _against_design(one):
    rule = DESIGN.rule(one)
    content, _ = LANGUAGES.read(one)
    here = f"{one.sender}->{one.receiver} {one.protocol} {one.performative}"
    if content is None:
        return "" if len(encode(one)) <= rule.bytes else f"{here}: {len(encode(one))} bytes"
    languages = map(LANGUAGES.named, LANGUAGES.names)
    language = next(one for one in languages if type(content) in one.classes)
    name = f"{language.name}.{type(content).__name__}"
    if name not in rule.sizes:
        return f"{here} says {name}, not one of {', '.join(rule.sizes)}"
    return (
        "" if len(encode(one)) <= rule.sizes[name] else f"{here} {name}: {len(encode(one))} bytes"
    )
