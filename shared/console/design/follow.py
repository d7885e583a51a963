"""`roco design follow`: whether what the agents of a run did is a path of the model that was
proven.

Exit codes: 0 it is, 1 a step of some agent is none of the model's, 2 a file cannot be read.
"""

from pathlib import Path
from typing import Annotated

import typer

from agent_runtime.io.steplog import deeds
from console.design import files
from console.output import Form, Format, argument, option
from operate.file_names import STEPS
from operate.system import of_run
from topdown.model.design import load
from topdown.prove.paths import Deviation, Follower

Run = Annotated[Path, argument("A run's folder; its agents' steps are in RUN/steps.", exists=True)]
Design = Annotated[Path | None, option("A design file; else that of the run's system.", "--design")]


def follow(run: Run, design: Design = None, form: Form = Format.TEXT) -> None:
    """Follow a run through the composed model of its design: every step of every agent must be a
    move of it.

    Examples:
      roco design follow runs/latest
    """
    with files.problems(form):
        done = deeds(run / STEPS)
        if not done:
            raise ValueError(
                f"{run / STEPS} has no steps; name the folder of a run, as `roco up` or `roco demo`"
                " wrote it"
            )
        follower = Follower(of_run(run).design if design is None else load(design))
        found = follower.follow(done)
    files.tell(
        {"steps": follower.count, "deviation": found and found._asdict()},
        form,
        _progress_text(follower, found),
    )
    if found is not None:
        raise typer.Exit(1)


def _progress_text(follower: Follower, found: Deviation | None) -> str:
    if found is None:
        return (
            f"{follower.count} steps, each a move of the model (at most {follower.most} of its"
            " states at a time)"
        )
    lines = [
        f"step {found.number} is no move of the model: {found.agent} {found.what}",
        "the model would be at",
    ]
    return "\n".join(lines + [f"  {agent:<4} {words}" for agent, words in found.here.items()])
