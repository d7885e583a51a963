"""Traffic heard in a run, for comparing it with a design. The recorder's own process reads its recordings."""

import subprocess
from pathlib import Path

import msgspec

from operate.cli.analysis import command, environment
from operate.cli.errors import ConsoleError, NoRunError
from operate.system import of_run
from topdown.check.recorded import Observed

TIMEOUT_S = 120.0
"""A run of an hour is read in some seconds; estimate."""


def recording(run: Path) -> Observed:
    """The communicates and events of a run folder, of the folder a traffic.mcap stands in, or of a .json file of
    observations, from whatever recorder. ConsoleError where nothing can be read.
    """
    if run.suffix == ".json":
        return msgspec.json.decode(run.read_bytes(), type=Observed)
    folder = run.parent if run.is_file() else run
    if not folder.is_dir():
        raise NoRunError(str(run))
    told = command("observations", str(folder))
    done = subprocess.run(told, env=environment(of_run(folder)), capture_output=True, timeout=TIMEOUT_S, check=False)
    if done.returncode:
        last = done.stderr.decode(errors="replace").strip().splitlines()[-1:] or ["no reason given"]
        raise ConsoleError(f"the recording in {folder} cannot be read ({last[0]}); install the extra `monitor`")
    found = msgspec.json.decode(done.stdout, type=Observed)
    if not found.communicates:
        raise ConsoleError(f"{folder} holds no recorded communicates; give a run's folder, with its traffic.mcap")
    return found
