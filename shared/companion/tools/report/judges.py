"""Verdicts that tasks have of their own (companion.tasks, part `verdict`): by the truth, not by
what co said.
"""

from collections.abc import Callable, Iterator
from functools import cache

import msgspec

from companion.languages import cmd
from companion.languages.evidence import Evidence
from companion.tasks import parts
from companion.telemetry import TrueState
from operate.recording.history import History
from operate.recording.records import Spoken


class Share(msgspec.Struct, frozen=True):
    """The part of the content that the robot believes to have poured, from the weight [kg] that
    left the source in its last pour that was done and what it took the content to weigh; `seen_kg`:
    in the bowl then, null where it was not looked into; `true`: grains in the bowl of all grains.
    """

    believed: float | None
    left_kg: float | None
    content_kg: float | None
    true: float | None
    seen_kg: float | None = None


class Figures(msgspec.Struct, frozen=True):
    """Figures of the main job for report.json; None where the truth was not recorded."""

    poured_fraction: float | None = None
    bowl_tilt_deg: float | None = None
    poured: Share | None = None


class Judge(msgspec.Struct, frozen=True):
    """The verdict of a task. `asked`: its command, `verb` what it asks to do. `against`: why it was
    not done, by the truth at its end. `true`: whether a claim is true, None where the truth does
    not tell. `figures`: those of the main job for report.json; None for another task.
    """

    asked: type[cmd.Command]
    verb: str
    against: Callable[[History, Spoken], Iterator[str]]
    true: Callable[[Evidence, TrueState], bool | None]
    figures: Callable[[History], Figures] | None = None


@cache
def judges() -> tuple[Judge, ...]:
    """Return the verdicts of all tasks."""
    return tuple(part.JUDGE for part in parts("verdict"))


def judge_of(command: object) -> Judge | None:
    """Return the verdict of a command's task, None where it has none."""
    return next((one for one in judges() if isinstance(command, one.asked)), None)
