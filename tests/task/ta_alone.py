"""ta between scripted partners, and the parts of plans that its tests are made of."""

from typing import Any

from scripted_partner import Open, Say, partner

from agent_runtime.testing.memory_bus import MemoryBus
from companion.binding import wiring
from companion.languages import hfsm, rc, sw
from companion.languages.facts import Kind, fact
from companion.languages.values import BodyPosture, Side
from fipa_codec.performatives import Performative as P
from services.task import behaviours

BODY = BodyPosture(0.0, (0.0,) * 7, (0.0,) * 7, (0.0, 0.0), (0.0,) * 4, (0.0,) * 4)
LOOK = rc.Look("plan/1", ((1.0, 0.0, 1.0),))
HOME = rc.Home("plan/2", Side.LEFT)
OK = hfsm.Outcome.SUCCEEDED
STUCK = (fact(Kind.NO_WAY_HOME, Side.LEFT),)
CANCELLED = (fact(Kind.CANCELLED),)


def plan(*states: hfsm.State) -> hfsm.HierarchicalPlan:
    """A plan of these states."""
    return hfsm.HierarchicalPlan("plan", "test", hfsm.Machine("test", states[0].name, states), 1.0, 0)


class Scene:
    """ta between a co, an ex and a km that say what the test has them say."""

    def __init__(self) -> None:
        self.wires = MemoryBus()
        self.heard: dict[str, list[tuple[int, str, Any]]] = {"co": [], "ex": [], "km": []}
        for name, heard in self.heard.items():
            self.wires.add(partner(name, heard), wiring(name, "test"))
        self.wires.add(behaviours.agent(), wiring("ta", "test"))
        self.wires.run_for(0.1)

    def start(self, asked: hfsm.HierarchicalPlan) -> None:
        self.wires.post("co", Open("ta", "coordinate", P.REQUEST, asked))

    def hears(self, name: str, count: int) -> Any:
        """Return the nth message that it heard."""
        self.wires.run(lambda: len(self.heard[name]) >= count, limit_s=2000.0)
        return self.heard[name][count - 1][2]

    def states(self) -> list[str]:
        """The states reported to co."""
        return [str(content.state) for _, _, content in self.heard["co"] if isinstance(content, sw.Report)]

    def ex(self, performative: P, content: Any, number: int = 0) -> None:
        self.wires.post("ex", Say(number, performative, content))
