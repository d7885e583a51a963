"""All agents of the depot on pretend wires, watched at every step: who is in the aisle, what fits
no row.
"""

from collections.abc import Callable
from typing import Any

from depot.carrier.wheels import wheels
from depot.design import DESIGN, LANGUAGES
from depot.desk import behaviours as desk
from depot.desk.people import Wish, people
from depot.dispatcher import behaviours as dispatcher
from depot.languages.order import Assigned
from depot.mule import behaviours as mule
from depot.ox import behaviours as ox
from depot.traffic import behaviours as traffic

from agent_runtime.core.binding import wiring
from agent_runtime.core.events import Effects
from agent_runtime.core.step import OUTSIDE
from agent_runtime.io.devices import Device
from agent_runtime.testing.memory_bus import Faults, MemoryBus

ROBOTS = ("mule", "ox")


class Told:
    """A device that notes what it is told, and hands it on."""

    busy = False

    def __init__(self, device: Device, told: list[Any]) -> None:
        self._device, self._told = device, told

    def tell(self, content: Any) -> None:
        """Note it, hand it on."""
        self._told.append(content)
        self._device.tell(content)

    def close(self) -> None:
        """As the device does."""
        self._device.close()


class Depot:
    """`wishes`: what people want; `without`: agents that are not there."""

    def __init__(
        self,
        *wishes: Wish,
        seed: int = 0,
        faults: Faults | None = None,
        without: tuple[str, ...] = (),
    ) -> None:
        self.wires = MemoryBus(seed=seed, faults=faults)
        self.wires.on_step = self._watch
        self.outside: list[str] = []
        self.together = False
        agents = {
            "desk": (desk.agent(), people(wishes)),
            "dispatcher": (dispatcher.agent(), None),
            "traffic": (traffic.agent(), None),
            "mule": (mule.agent(), wheels),
            "ox": (ox.agent(), wheels),
        }
        for name in sorted(agents.keys() - set(without)):  # in one order, whatever the hashes are
            agent, device = agents[name]
            self.wires.add(agent, wiring(name, "test", design=DESIGN, languages=LANGUAGES), device)

    def run(self, ended: int, limit_s: float = 600.0) -> None:
        """Until that many orders have ended."""
        self.until(lambda: self.wires.memory("desk").ended >= ended, limit_s)

    def until(self, condition: Callable[[], object], limit_s: float = 600.0) -> None:
        """Until this holds; every step on the way is a row of the design, and one robot is in the
        aisle at most.
        """
        self.wires.run(lambda: bool(condition()), limit_s=limit_s)
        assert (self.outside, self.together) == ([], False)

    @property
    def orders(self) -> tuple[int, int]:
        """Numbers of the orders that were delivered, and that failed."""
        memory = self.wires.memory("dispatcher")
        return memory.delivered, memory.failed

    def said(self, performative: str, sender: str = "") -> list[str]:
        """Conversations in which an act was said, each once."""
        acts = [
            one
            for one in self.wires.traffic
            if one.performative == performative and sender in ("", one.sender)
        ]
        return sorted({one.conversation for one in acts})

    @property
    def assigned(self) -> list[str]:
        """The robots that got the jobs, in order."""
        return [content.robot for content in self.told(Assigned)]

    def told(self, kind: type) -> list[Any]:
        """The contents of one class that the desk was informed of, each message once."""
        informs = {
            one.id: one
            for one in self.wires.traffic
            if one.performative == "inform" and one.receiver == "desk"
        }
        contents = [LANGUAGES.read(one)[0] for one in informs.values()]
        return [content for content in contents if isinstance(content, kind)]

    def _watch(self, agent: str, effects: Effects) -> None:
        self.outside += [str(line.fields["why"]) for line in effects.logs if line.event == OUTSIDE]
        inside = [robot for robot in ROBOTS if robot in self.wires.nodes and self._inside(robot)]
        self.together = self.together or len(inside) > 1

    def _inside(self, robot: str) -> bool:
        state = self.wires.nodes[robot].state
        return state is not None and any(
            held.conversation.protocol == "passage" and held.conversation.state == "inside"
            for held in state.conversations.values()
        )


def wishes(*ways: tuple[str, str]) -> tuple[Wish, ...]:
    """Wishes at the start, numbered."""
    return tuple(
        Wish(f"thing {n}", source, target, number=n)
        for n, (source, target) in enumerate(ways, start=1)
    )
