"""`roco record repair`: the index of a recording whose recorder was killed. The recorder's own process writes it."""

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from operate.cli import completion
from operate.cli.analysis import analysed
from operate.cli.output import Form, Format, problems, tell_json
from operate.cli.runs import folders


class Repaired(msgspec.Struct, frozen=True):
    """What was done (operate.recording.index.Written); `messages` 0: nothing, the file has its index."""

    file: str
    messages: int = 0
    whole: bool = True
    lost: int = 0
    kept: str = ""


def repair(
    recording: Annotated[
        Path | None,
        typer.Argument(metavar="[RUN]", help="A run's folder, or a recording.", autocompletion=completion.runs),
    ] = None,
    form: Form = Format.TEXT,
) -> None:
    """Write a recording again in chunks with an index. Without RUN that of runs/latest.

    A recorder does so when it ends in order. Without an index, as after a kill, Rerun reads nothing from the file. If
    its end cannot be read, the file is also kept as it was.

    Examples:
      roco record repair
      roco record repair mine.mcap
    """
    with problems(form):
        file = recording or folders.find(None)
        done = msgspec.json.decode(analysed("repair", str(file), about=file), type=Repaired)
        if form is Format.JSON:
            tell_json(done)
        else:
            print(sentence(done))


def sentence(done: Repaired) -> str:
    """Return what was done, for people."""
    name = folders.near(Path(done.file))
    if not done.messages:
        return f"{name}: it was closed in order and has its index; nothing to repair"
    lost = f"\n{done.lost} bytes at its end could not be read; kept as it was: {done.kept}" if done.lost else ""
    return f"{name}: {done.messages} messages, now with an index{lost}"
