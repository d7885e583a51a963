"""The pouring task with one death at one boundary of one message, and what is left of it in the
end.
"""

from collections import Counter
from enum import StrEnum
from typing import Any

import msgspec
from pretended_fleet import NAMES, POUR, Fleet, Heard

from agent_runtime.testing.memory_bus import LATENCY_S
from companion.design import RC

COMMAND = POUR
VICTIMS = NAMES


class Side(StrEnum):
    """Whether the victim dies before the message is taken or right after."""

    BEFORE = "before"
    AFTER = "after"


class Ending(msgspec.Struct, frozen=True):
    """State at the end of a run.

    `world`: km's; `stands`: poses and grips as they are; `last`: the states of hi's tasks; `acts`:
    kinds of act that ta commanded, in their order; `doubled`: keys of acts that were commanded or
    begun more than once; `poured`: how often; `messages`: how many there were.
    """

    world: Any
    stands: Any
    last: str
    acts: tuple[str, ...]
    doubled: tuple[str, ...]
    poured: int
    messages: int


class Traffic(Heard):
    """The traffic of wires; at message `number` (from 1) the victim is killed. Copies count."""

    def __init__(self, fleet, victim, number, side):
        super().__init__(fleet)
        self._victim, self._number, self._side = victim, number, side
        fleet.wires.traffic = self

    def append(self, communicate):
        """It is sent; the wires put its arrival on the agenda right after this."""
        super().append(communicate)
        if len(self) == self._number:
            wires = self._fleet.wires
            kill = lambda: wires.kill(self._victim)  # noqa: E731
            later = kill if self._side is Side.BEFORE else lambda: wires.call(0.0, kill)
            wires.call(LATENCY_S, later)


def run(victim="", number=0, side=Side.BEFORE):
    """The ending of a run with a death in it; without a victim of one without."""
    with Fleet() as fleet:
        Traffic(fleet, victim, number, side)
        fleet.say(COMMAND)
        return ending(fleet, fleet.finish())


def messages():
    """How many messages a run without a death has."""
    return run().messages


def ending(fleet, states):
    """What is left."""
    scene = fleet.wires.memory("km").scene
    things = scene.things.items()
    objects = {name: (one.model, one.pose, one.on, one.inside) for name, one in things}
    to_ex = (one for one in fleet.wires.traffic if one.receiver == "ex")
    asked = (one for one in to_ex if str(one.performative) == "request")
    requests = {(one.sender, one.id): RC.decode(one.content) for one in asked}
    commanded = Counter(content.key for content in requests.values())
    begun = fleet.world.begun
    starts = Counter(key for at, key in enumerate(begun) if at == 0 or begun[at - 1] != key)
    return Ending(
        world=(objects, scene.hands, scene.joints, scene.contents, scene.reserved),
        stands=dict(fleet.world.poses),
        last=" ".join(states),
        acts=tuple(type(content).__name__ for content in requests.values()),
        doubled=tuple(
            sorted(
                key for count in (commanded, starts) for key, times in count.items() if times > 1
            )
        ),
        poured=fleet.world.poured,
        messages=len(fleet.wires.traffic),
    )
