"""ta between scripted partners, and the parts of plans that its tests are made of."""

from itertools import pairwise

from msgspec.structs import replace
from scripted_partner import Open, Say, partner

from agent_runtime.testing.memory_bus import MemoryBus
from companion.design import wiring
from companion.languages import hfsm, rc, sw, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import BodyPosture, Side
from fipa_codec import languages
from fipa_codec.performatives import Performative as P
from services.task import behaviours

BODY = BodyPosture(0.0, (0.0,) * 7, (0.0,) * 7, (0.0, 0.0), (0.0,) * 4, (0.0,) * 4)
LOOK = rc.Look("plan/1", ((1.0, 0.0, 1.0),))
HOME = rc.Home("plan/2", Side.LEFT)
OK = hfsm.Outcome.SUCCEEDED
STUCK = (fact(Kind.NO_WAY_HOME, Side.LEFT),)
CANCELLED = (fact(Kind.CANCELLED),)


def plan(*states):
    """A plan of these states."""
    root = hfsm.Machine("test", states[0].name, states)
    return hfsm.HierarchicalPlan("plan", "test", root, 1.0, 0)


def plan_of(*commands):
    """A plan of these acts, one after the other."""
    states = [hfsm.ActState(type(one).__name__, one) for one in commands]
    chained = [replace(one, arcs=(hfsm.Arc(OK, two.name),)) for one, two in pairwise(states)]
    return plan(*chained, states[-1])


class Scene:
    """ta between a co, an ex and a km that say what the test has them say; ta has begun the acts,
    if there are some.
    """

    def __init__(self, *commands, observed=False):
        self.wires = MemoryBus()
        self.heard = {"co": [], "ex": [], "km": []}
        for name, heard in self.heard.items():
            self.wires.add(partner(name, heard), wiring(name, "test"))
        self.wires.add(behaviours.agent(), wiring("ta", "test"))
        self.wires.run_for(0.1)
        if commands:
            self.start(plan_of(*commands))
            self.hears("ex", 1)
        if observed:
            self.observe()

    def start(self, asked):
        """co requests a plan."""
        self.wires.post("co", Open("ta", "coordinate", P.REQUEST, asked))

    def observe(self):
        """km subscribes to what is seen."""
        self.wires.post("km", Open("ta", "subscribe", P.SUBSCRIBE, wm.ObserveWorld()))

    def ends(self, outcome, number=0, performative=None):
        """ex ends an act, as soon as it is asked for it."""
        self.hears("ex", number + 1)
        told = P.INFORM if isinstance(outcome, rc.Done) else P.FAILURE
        self.wires.post("ex", Say(number, performative or told, outcome))

    def cancelled(self, key, number=0, **more):
        """ex answers a cancel."""
        outcome = rc.NotDone(key, "cancelled", CANCELLED, **more)
        self.wires.post("ex", Say(number, P.INFORM, outcome, languages.Kind.CANCEL))

    def hears(self, name, count):
        """The nth message that it heard."""
        self.wires.run(lambda: len(self.heard[name]) >= count, limit_s=2000.0)
        return self.heard[name][count - 1][2]

    def news(self, kind=object):
        """What km was told, of this kind."""
        return [one for _, _, one in self.heard["km"] if one is not None and isinstance(one, kind)]

    @property
    def state(self):
        """The state of ta."""
        return self.wires.nodes["ta"].state.state

    def states(self):
        """The states reported to co."""
        heard = (content for _, _, content in self.heard["co"])
        return [str(content.state) for content in heard if isinstance(content, sw.Report)]

    def ex(self, performative, content, number=0):
        """ex says something in its nth conversation."""
        self.wires.post("ex", Say(number, performative, content))
