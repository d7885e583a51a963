"""All agents of the design on virtual wires, with a person at hi; search and robot as the test wants them."""

from importlib import import_module
from typing import Any

from pretended_robot import Robot, World
from scripted_search import Script

from agent_runtime.io.devices import DeviceMaker, Post
from agent_runtime.testing.wires import Faults, Wires
from companion.all_languages import SW
from companion.binding import wiring
from companion.design import DESIGN
from companion.languages import sw, wm
from companion.languages.cmd import TaskState
from companion.tools.system import JOB, PROCESSES
from services.human_interface.grammar import understand
from services.human_interface.local import Answer, CancelWanted, Said
from services.knowledge.store import device_at

MODULES = {one.name: f"{one.module}.behaviours" for one in PROCESSES if one.name in DESIGN.agents}
NAMES = tuple(DESIGN.agents)
FINAL = (TaskState.DONE, TaskState.FAILED, TaskState.CANCELLED)


class Person:
    """The device of hi: keeps what was told; outlives hi."""

    busy = False

    def __init__(self) -> None:
        self.told: list[Any] = []

    def tell(self, content: Any) -> None:
        """Hear it."""
        self.told.append(content)

    def close(self) -> None:
        """Nothing to close."""


class Fleet:
    """`say` and `cancel` as a person would; `tasks` as hi shows them."""

    def __init__(
        self,
        *,
        seed: int = 0,
        faults: Faults | None = None,
        search: DeviceMaker | None = None,
        robot: DeviceMaker | None = None,
    ) -> None:
        self.wires = Wires(seed=seed, faults=faults)
        self.world, self.person = World(), Person()
        self.asked: list[wm.AnyQuery] = []
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

    def _robot(self, post: Post) -> Robot:
        return Robot(post, self.world, lambda delay, call: self.wires._at(self.wires.now + delay, call))

    def say(self, text: str, urgency: int = 0) -> None:
        """A person's words; hi is asked again until it knows its co."""
        self._tickets += 1
        self.wires.run(lambda: self.up("hi") and "co" in self.wires.nodes["hi"].state.soft.peers)
        self.wires.post("hi", Said(f"t{self._tickets}", text, understand(text), urgency=urgency))

    def cancel(self) -> None:
        """A person's cancel of the oldest open task."""
        self._tickets += 1
        self.wires.post("hi", CancelWanted(f"t{self._tickets}"))

    def up(self, name: str) -> bool:
        """Whether the agent lives."""
        return self.wires.nodes[name].state is not None

    @property
    def tasks(self) -> tuple[Any, ...]:
        """Tasks as hi knows them."""
        memory = self.wires.memory("hi")
        return () if memory is None else memory.tasks

    def ended(self, count: int = 1) -> bool:
        """Whether that many tasks have ended."""
        return sum(task.state in FINAL for task in self.tasks) >= count

    def finish(self, count: int = 1, limit_s: float = 900.0) -> list[str]:
        """Go on until that many tasks have ended and everybody rests; their states."""
        self.wires.run(lambda: self.ended(count), limit_s=limit_s)
        self.wires.run(self.at_rest, limit_s=300.0)
        return [str(task.state) for task in self.tasks]

    def at_rest(self) -> bool:
        """All agents are up and wait for something new."""
        nodes = self.wires.nodes
        return all(self.up(name) and nodes[name].state.state == state for name, state in JOB.rests.items()) and not any(
            nodes[name].state.conversations or nodes[name].state.due for name in NAMES
        )

    def reports(self) -> list[str]:
        """ta's final reports to co, each once."""
        finals: dict[str, str] = {}
        for one in self.wires.traffic:
            if one.sender == "ta" and one.receiver == "co" and str(one.performative) == "inform":
                report = SW.decode(one.content)
                if report.state in sw.FINAL:
                    finals[f"{one.conversation} {one.id}"] = str(report.state)
        return list(finals.values())

    def answers(self) -> list[Answer]:
        """Answers of hi to the person."""
        return [one for one in self.person.told if isinstance(one, Answer)]

    def close(self) -> None:
        """Close all devices."""
        self.wires.close()
