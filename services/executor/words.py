"""Messages of ex in RC: impossible commands, agreements, refusals and outcomes."""

import math
from collections.abc import Iterator

from agent_runtime.core.turn import Turn
from companion.languages import rc
from fipa_codec.languages import Kind, Reason
from fipa_codec.performatives import Performative
from services.executor.memory import Act

JOINTS = 8  # of a joint path: torso and one arm


def wrong(command: rc.Act) -> str:
    """Return the first thing that is wrong with a command, before anything is computed; "" if nothing is."""
    if not command.key:
        return "key is empty, an act needs one of its own"
    return next(_complaints(command), "")


def _complaints(command: rc.Act) -> Iterator[str]:
    match command:
        case rc.MoveJoint(path=path, speed=speed):
            if not path or any(len(point) != JOINTS for point in path):
                yield f"path has to be one or more points of {JOINTS} joints"
            yield from _bad_numbers("path", *(x for point in path for x in point))
            yield from _bad_speed(speed)
        case rc.MoveCartesian(segments=segments):
            if not segments:
                yield "segments are empty, a motion needs at least one"
            for segment in segments:
                yield from _bad_numbers("offset", *segment.offset)
                yield from _bad_speed(segment.speed)
        case rc.Grasp():
            yield from _about_a_grasp(command)
        case rc.OpenDoor():
            yield from _about_a_door(command)
        case rc.Look(at=at):
            if not at:
                yield "at is empty, a look needs a point"
            yield from _bad_numbers("at", *(x for point in at for x in point))
        case rc.Pour(tilts=tilts, hold=hold, azimuth=azimuth, spin=spin):
            yield from _bad_numbers("tilts, hold, azimuth, spin", *tilts, hold, azimuth, spin)


def _about_a_grasp(command: rc.Grasp) -> Iterator[str]:
    if not command.approach:
        yield "approach is empty, its last point is the grasp itself"
    if not (math.isfinite(command.mass) and command.mass >= 0.0):
        yield f"mass is {command.mass}, it has to be 0 kg or more"
    yield from _bad_speed(command.speed)


def _about_a_door(command: rc.OpenDoor) -> Iterator[str]:
    if not command.approach:
        yield "approach is empty, its last point is the handle"
    yield from _bad_numbers("turn, least, closed", command.turn, command.least, command.closed)
    if command.end is not None:
        yield from _bad_numbers("end", *command.end.xyz, *command.end.quat_wxyz)
    yield from _bad_speed(command.speed)


def _bad_numbers(name: str, *values: float) -> Iterator[str]:
    if not all(math.isfinite(value) for value in values):
        yield f"{name} holds a number that is not finite"


def _bad_speed(speed: float) -> Iterator[str]:
    if not (math.isfinite(speed) and speed > 0.0):
        yield f"speed is {speed}, it has to be greater than 0"


# --- to ta ------------------------------------------------------------------------------------------------------------


def refuse(turn: Turn, conversation: str, command: rc.Command, kind: str, reason: str) -> None:
    """Refuse a command, without the posture."""
    turn.say(conversation, Performative.REFUSE, rc.NotDone(command.key, kind, reason))


def agree(turn: Turn, act: Act, duration: float) -> None:
    """Agree to an act of this expected duration [s, simulated]."""
    turn.say(act.conversation, Performative.AGREE, rc.Accepted(act.command.key, duration))


def report(turn: Turn, act: Act) -> None:
    """Tell the outcome of an act; in reply to the cancel where the cancel ended it."""
    outcome = act.outcome
    assert outcome is not None
    if act.cancelling and isinstance(outcome, rc.NotDone):
        turn.say(act.conversation, Performative.INFORM, outcome, kind=Kind.CANCEL)
        return
    failed = Performative.FAILURE if act.begun else Performative.REFUSE
    turn.say(act.conversation, Performative.INFORM if isinstance(outcome, rc.Done) else failed, outcome)
    if act.cancelling:
        turn.say(act.conversation, Performative.FAILURE, Reason("the act had ended"), kind=Kind.CANCEL)
