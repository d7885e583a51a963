"""An operator of the pretended fleet: sets the level of autonomy, and lets plans go on."""

from pretended_fleet import Fleet

from agent_runtime.core.control import SetParameter
from companion.autonomy import LEVEL, STEP, Level, Verb, Word

POUR = "pour the jar into the bowl"


def asked(fleet: Fleet) -> str:
    """The leaf that waits, as hi's person sees it."""
    return next((task.asks for task in fleet.tasks if task.asks), "")


def waiting(fleet: Fleet) -> bool:
    """Whether ta waits and the person can see it."""
    return fleet.up("ta") and fleet.wires.nodes["ta"].state.state == "waiting" and bool(asked(fleet))


def say(fleet: Fleet, verb: Verb, at: str = "") -> None:
    """The operator's word about the leaf that waits, or another one."""
    fleet.wires.order("ta", SetParameter(STEP, str(Word(verb, at or asked(fleet)))))


def set_level(fleet: Fleet, level: Level) -> None:
    """From now on."""
    fleet.wires.order("ta", SetParameter(LEVEL, level.value))


def begun(fleet: Fleet, level: Level) -> Fleet:
    """A pour is asked for at this level; the look around at the start is over, which waits for nobody."""
    fleet.wires.run(lambda: fleet.up("ta") and fleet.wires.nodes["ta"].state.state == "surveying")
    fleet.wires.run(lambda: fleet.wires.nodes["ta"].state.state == "idle")
    set_level(fleet, level)
    fleet.say(POUR)
    return fleet


def stepped(fleet: Fleet, ended: int = 1) -> list[str]:
    """Let plans go on until that many tasks have ended; the leaves that were asked about."""
    leaves: list[str] = []
    while True:
        fleet.wires.run(lambda: fleet.ended(ended) or waiting(fleet))
        if fleet.ended(ended):
            return leaves
        leaves.append(asked(fleet))
        say(fleet, Verb.GO)
        fleet.wires.run(lambda before=leaves[-1]: asked(fleet) != before)
