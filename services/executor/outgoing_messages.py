"""Messages of ex in RC: impossible commands, agreements, refusals and outcomes."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple, get_args, get_type_hints

import msgspec
import numpy as np

from agent_runtime.core.turn import Turn
from companion.languages import rc
from companion.languages.facts import Facts
from companion.languages.values import Pose, Within
from fipa_codec.languages import Kind, Reason
from fipa_codec.performatives import Performative
from services.executor.memory import RunningAct
from velma import names, ranges
from velma.errors import MotionError

JOINTS = 8  # of a joint path: torso and one arm
ANY = Within(-100.0, 100.0)  # of a number whose type says nothing; estimate: a wrong unit is found
UNIT = 0.01  # of the length of a quaternion from 1; estimate: more than rounding
_NOT_EMPTY = {"key": "an act needs one of its own", "path": "a motion needs a point",
              "at": "a look needs a point",
              "segments": "a motion needs one",
              "approach": "its last point is where the hand closes"}  # fmt: skip


class Wrong(NamedTuple):
    """A field of a command that makes no sense; `text`: what is wrong with it, for a log."""

    field: str
    text: str


def wrong(command: rc.Command) -> Wrong | None:
    """Return the first thing that is wrong with a command, before anything is computed; None if
    nothing is.
    """
    return next(_complaints(command), None)


def _complaints(command: rc.Command) -> Iterator[Wrong]:
    for field, why in _NOT_EMPTY.items():
        if not getattr(command, field, True):
            yield Wrong(field, f"{field} is empty, {why}")
    yield from _outside("", type(command), command)
    if isinstance(command, rc.MoveJoint):
        if any(len(point) != JOINTS for point in command.path):
            yield Wrong("path", f"path has to be points of {JOINTS} joints")
        whole = np.tile(names.START, (len(command.path), 1))
        whole[:, names.COLUMNS[command.side]] = command.path
        try:
            ranges.joints("path", whole)
        except MotionError as error:
            yield Wrong(error.field, str(error))


def _outside(field: str, kind: Any, value: Any) -> Iterator[Wrong]:
    """Yield each number in a value that is outside the range that its type notes, and each pose
    that is none.
    """
    parts = get_args(kind)
    if isinstance(value, float | int):
        least, most = next(
            (w for one in (kind, *parts) for w in get_args(one) if isinstance(w, Within)), ANY
        )
        if not least <= value <= most:
            yield Wrong(
                field, f"{field} is {value}, it has to be finite, from {least:g} to {most:g}"
            )
    elif isinstance(value, tuple) and parts[-1] is not ... and len(parts) != len(value):
        yield Wrong(field, f"{field} has {len(value)} values, it has to have {len(parts)}")
    elif isinstance(value, tuple):
        for k, one in enumerate(value):
            yield from _outside(f"{field}[{k}]", parts[0] if parts[-1] is ... else parts[k], one)
    elif isinstance(value, msgspec.Struct):
        for name, inner in get_type_hints(type(value), include_extras=True).items():
            yield from _outside(f"{field}.{name}".lstrip("."), inner, getattr(value, name))
    if isinstance(value, Pose) and not abs(math.hypot(*value.quat_wxyz) - 1.0) <= UNIT:
        yield Wrong(
            f"{field}.quat_wxyz",
            f"{field}.quat_wxyz is {value.quat_wxyz}, it has to be of length 1",
        )


# --- to ta ----------------------------------------------------------------------------------------


def refuse(turn: Turn, conversation: str, command: rc.Command, kind: str, why: Facts) -> None:
    """Refuse a command, without the posture."""
    turn.say(conversation, Performative.REFUSE, rc.NotDone(command.key, kind, why))


def agree(turn: Turn, act: RunningAct, duration: float) -> None:
    """Agree to an act of this expected duration [s, simulated]."""
    turn.say(act.conversation, Performative.AGREE, rc.Accepted(act.command.key, duration))


def report(turn: Turn, act: RunningAct) -> None:
    """Tell the outcome of an act; in reply to the cancel where the cancel ended it."""
    outcome = act.outcome
    assert outcome is not None
    if act.cancelling and isinstance(outcome, rc.NotDone):
        turn.say(act.conversation, Performative.INFORM, outcome, kind=Kind.CANCEL)
        return
    failed = Performative.FAILURE if act.begun else Performative.REFUSE
    turn.say(
        act.conversation, Performative.INFORM if isinstance(outcome, rc.Done) else failed, outcome
    )
    if act.cancelling:
        turn.say(
            act.conversation, Performative.FAILURE, Reason("the act had ended"), kind=Kind.CANCEL
        )
