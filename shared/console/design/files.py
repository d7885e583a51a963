"""Parts shared by the verbs of `roco design`: file argument, output formats, error messages instead
of tracebacks.
"""

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from console.errors import ConsoleError, NoRunError
from console.output import Format, argument, option, tell_problem
from operate.structs import NothingToRead
from operate.system import NoSystemError, here
from topdown import check
from topdown.check.recorded import Observed
from topdown.model.design import Design
from topdown.model.errors import TopdownError
from topdown.model.findings import Finding

WRONG_FILE = 2
"""Exit code if a file cannot be read or is not a design."""
NARROW, WIDE = 60, 160


File = Annotated[
    Path | None, argument("A design file; else that of the system here.", show_default=False)
]
Recording = Annotated[
    Path | None, option("A run's folder, or a .json of observations.", "--recording")
]


def meant(file: Path | None) -> Path:
    """The file named, else that of the system here. Raise NoSystemError where there is none."""
    return here().design.place if file is None else file


def width() -> int:
    """Columns to fill."""
    return min(max(shutil.get_terminal_size((100, 0)).columns, NARROW), WIDE)


def shown(file: Path) -> str:
    """A path as short as it can be said from here."""
    whole, here = file.resolve(), Path.cwd()
    return str(whole.relative_to(here) if whole.is_relative_to(here) else file)


def observed(run: Path | None) -> Observed | None:
    """The run that is meant, if one is."""
    return None if run is None else recording(run)


def findings(design: Design, file: Path) -> tuple[Finding, ...]:
    """Of the file itself; of that of the system here also what else its system looks at, as its
    code.
    """
    found = check.check(design)
    try:
        system = here()
        own: Callable[[Design], tuple[Finding, ...]] | None = system.addition("findings")
    except (NoSystemError, TopdownError):
        return found
    if own is None or system.design.place != file.resolve():
        return found
    return (*found, *own(design))


def tell(what: object, form: Format, words: str) -> None:
    """Print an answer: for programs as JSON in several lines, else in words."""
    print(msgspec.json.format(msgspec.json.encode(what)).decode() if form is Format.JSON else words)


@contextmanager
def problems(form: Format, code: int = WRONG_FILE) -> Iterator[None]:
    """Turn what goes wrong into words on standard error and this exit code."""
    try:
        yield
    except (TopdownError, NoSystemError, ConsoleError, ValueError) as error:
        tell_problem(error, form)
        raise typer.Exit(code) from error


# --- Traffic heard in a run, for comparing it with a design ---------------------------------------


def recording(run: Path) -> Observed:
    """The communicates and events of a run folder, of the folder a traffic.mcap stands in, or of a
    .json file of observations, from whatever recorder. ConsoleError where nothing can be read.
    """
    if run.suffix == ".json":
        return msgspec.json.decode(run.read_bytes(), type=Observed)
    folder = run.parent if run.is_file() else run
    if not folder.is_dir():
        raise NoRunError(str(run))
    try:
        from operate.recording.run import Run

        found = Run(folder).observed()
    except (NothingToRead, ModuleNotFoundError) as error:
        raise ConsoleError(
            f"the recording in {folder} cannot be read ({error}); install the extra `monitor`"
        ) from error
    if not found.communicates:
        raise ConsoleError(
            f"{folder} holds no recorded communicates; give a run's folder, with its traffic.mcap"
        )
    return found
