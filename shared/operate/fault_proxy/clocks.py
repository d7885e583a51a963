"""A wall clock for each agent that `roco fault clock` can step: a library loaded before libc adds
what a file says.

wall_clock.c is compiled when a fleet starts with `--faults`; without a C compiler agents have the
machine's clock.
"""

import os
import shutil
import struct
import subprocess
from pathlib import Path

from agent_runtime.io.run_files import opened

SOURCE = Path(__file__).with_name("wall_clock.c")
LIBRARY_FILE, SUFFIX = "wall_clock.so", ".clock"
COMPILER = "cc"
COMPILE_S = 30.0  # estimate: it takes 0.1 s
OFFSET = struct.Struct("=q")
"""Contents of a file: how far forward the clock is [ns]."""


def file(run: Path, name: str) -> Path:
    """Return the file of a process; it is there where the process has a clock of its own."""
    return run / f"{name}{SUFFIX}"


def made(run: Path, names: tuple[str, ...]) -> dict[str, dict[str, str]]:
    """Give these processes clocks of their own, which show the right time: process -> variables for
    its start.

    {} where no C compiler is installed, or it fails; no clock of an earlier start is left then.
    """
    for old in run.glob(f"*{SUFFIX}"):
        old.unlink(missing_ok=True)
    if not _compiled(run / LIBRARY_FILE):
        return {}
    for name in names:
        file(run, name).write_bytes(OFFSET.pack(0))
    return {
        name: {"LD_PRELOAD": str(run / LIBRARY_FILE), "ROCO_WALL_CLOCK": str(file(run, name))}
        for name in names
    }


def step(run: Path, name: str, seconds: float) -> None:
    """Set the clock of a process so far forward, in place: the file is mapped. Nothing where it has
    none.
    """
    if file(run, name).exists():
        with os.fdopen(opened(file(run, name), os.O_WRONLY), "wb", buffering=0) as mapped:
            mapped.write(OFFSET.pack(round(seconds * 1e9)))


def _compiled(library: Path) -> bool:
    command = [COMPILER, "-O2", "-shared", "-fPIC", "-o", str(library), str(SOURCE), "-ldl"]
    if shutil.which(COMPILER) is None:
        return False
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, timeout=COMPILE_S, check=False)
        return done.returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        return False
