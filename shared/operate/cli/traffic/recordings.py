"""The recording that a verb works on: the one that is named, else that of the fleet that is meant."""

from pathlib import Path

from operate.cli.errors import UsageError
from operate.cli.fleet import targets
from operate.cli.fleet.local import Local


def recording_of(run: Path | None, target: str, run_dir: Path | None) -> Path:
    """Return a run folder or a recording. Raise ConsoleError where there is none, UsageError for containers."""
    if run is not None:
        if not run.exists():
            raise UsageError(f"{run} is not there; give a run folder, or a recording of `roco record`")
        return run
    found = targets.find(target, run_dir)
    if not isinstance(found, Local):
        raise UsageError(f"{found.where} runs in containers; `roco record FILE` records it, then --run FILE")
    return found.run
