"""Whether a human interface that does not listen is on its way, so that it is worth waiting for."""

import contextlib
from pathlib import Path

from companion.tools.verbs.hi import HI
from operate.cli.errors import ConsoleError
from operate.cli.fleet import targets
from operate.cli.runs import folders
from operate.run_folder import LATEST, ProcessState

HUMAN_INTERFACE = "services.human_interface"
ON_ITS_WAY = (ProcessState.WAITING, ProcessState.STARTING, ProcessState.BACKING_OFF)


def starting(name: str = "", run_dir: Path | None = None) -> bool:
    """Whether the human interface that is meant is on its way."""
    with contextlib.suppress(ConsoleError):
        look = targets.find(name, run_dir).look()
        if any(one.name == HI and one.status.state in ON_ITS_WAY for one in look.seen):
            return True
        if look.fleet is not None and look.fleet.supervisor:
            return False
    return name in ("", targets.LOCAL) and begins(run_dir or folders.RUNS / LATEST)


def begins(run: Path) -> bool:
    """Whether a supervisor lives that keeps this run, or the run that is to be the latest where this is the latest one.

    It says so before anything of it is in a run folder. In a container a_hi itself is looked for.
    """
    called = folders.called()
    if folders.around() is not None:
        return any(HUMAN_INTERFACE in words for words in called)
    mine = {run.resolve(), run.parent.resolve()} if run.name == LATEST else {run.resolve()}
    supervisors = (words for words in called if {*folders.SUPERVISORS} & {*words} and "--run-dir" in words)
    kept = [Path(words[words.index("--run-dir") + 1]) for words in supervisors]
    return any(folder in mine or folder.parent in mine for folder in kept)
