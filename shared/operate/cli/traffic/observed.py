"""Traffic heard in a run, for comparing it with a design."""

from pathlib import Path

import msgspec

from operate.cli.errors import ConsoleError, NoRunError
from operate.structs import NothingToRead
from topdown.check.recorded import Observed


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
