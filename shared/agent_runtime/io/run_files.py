"""Names in a run folder, and the environment variables that name it (docs/run-folder.md)."""

import os
from pathlib import Path

RUN_FOLDER_VARIABLE = "ROCO_RUN_DIR"
KEYS_VARIABLE = "ROCO_TLS_DIR"  # a folder of keys; none: nothing is encrypted
KEYS_FOLDER = "keys"  # certificates and private keys of this run, mode 0700 (docs/security.md)
# The stop flag: one byte, written in place (a process may hold the file mapped; a rename would cut it off).
STOP_FILE = "stop"
STOP_RELEASED = b"\x00"
STOP_HELD = b"\x01"


def heartbeat_file(run: Path, name: str) -> Path:
    """Return the file that a process writes or touches each second."""
    return run / f"{name}.heartbeat.json"


def set_stop(run: Path, held: bool) -> None:
    """Have the robot held, as by a person's stop, or released; the byte is written in place. Raise OSError."""
    flag = os.open(run / STOP_FILE, os.O_WRONLY | os.O_CREAT, 0o600)
    try:
        os.pwrite(flag, STOP_HELD if held else STOP_RELEASED, 0)
    finally:
        os.close(flag)


def make_run(run: Path) -> None:
    """Make a run folder that other users cannot enter: TLS would hide nothing from who reads the recording.

    One that is there keeps its mode.
    """
    run.mkdir(mode=0o700, parents=True, exist_ok=True)
