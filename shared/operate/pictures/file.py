"""run.rrd: a recorded run for Rerun, with its blueprint. The same drawing as live."""

from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from agent_runtime.io.run_files import replaced
from operate.pictures.blueprint import blueprint
from operate.pictures.sheet import Sheet
from operate.pictures.stage import Stage
from operate.recording.happenings import of_history
from operate.recording.history import History
from operate.system import System

NAME = "robot_companion"


def write(path: Path, history: History, system: System) -> dict[str, int]:
    """Write the file, so that a reader sees the old one or the new one. How many rows each entity
    got.
    """
    name = f"{NAME}-{history.begin:.3f}"
    with replaced(path) as file, rr.RecordingStream(NAME, recording_id=name) as out:
        # The open file by its descriptor: Rerun takes names only, and would follow a link.
        beside = f"/proc/self/fd/{file.fileno()}"
        rr.save(beside, default_blueprint=laid_out(system, end_s(history)), recording=out)
        sheet = drawn(out, history, system)
    return sheet.rows


def drawn(out: rr.RecordingStream, history: History, system: System) -> Sheet:
    """The sheet on which a whole run was drawn."""
    sheet = Sheet(out, history.begin)
    stage = Stage(sheet, system)
    for happening in of_history(history):
        stage.take(happening)
    stage.pass_time(history.begin + end_s(history) + 1.0)
    sheet.flush()
    return sheet


def laid_out(system: System, end_s: float | None) -> rrb.Blueprint:
    """The system's own layout, else the one for any system."""
    own = system.addition("blueprint") or blueprint
    layout: rrb.Blueprint = own(end_s)
    return layout


def end_s(history: History) -> float:
    """The duration of the run [s]."""
    times = [one.received for one in history.said[-1:]] + [at for at, _ in history.signals]
    return max(times, default=history.begin) - history.begin or 1.0
