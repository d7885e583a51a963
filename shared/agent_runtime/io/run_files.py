"""Names in a run folder, and the variables that name it (docs/run-folder.md); addresses at which people are heard."""

import os
from pathlib import Path

RUN_FOLDER_VARIABLE = "ROCO_RUN_DIR"
FLEET_VARIABLE = "ROCO_FLEET"  # id of the fleet that a supervisor started a process for
KEYS_VARIABLE = "ROCO_TLS_DIR"  # a folder of keys; none: nothing is encrypted
KEYS_FOLDER = "keys"  # certificates and private keys of this run, mode 0700 (docs/security.md)
# The stop flag: one byte, written in place (a process may hold the file mapped; a rename would cut it off).
STOP_FILE = "stop"
STOP_RELEASED = b"\x00"
STOP_HELD = b"\x01"
LOOPBACK = ("127.0.0.1", 0)  # a free port


def heartbeat_file(run: Path, name: str) -> Path:
    """Return the file that a process writes or touches each second."""
    return run / f"{name}.heartbeat.json"


def make_run(run: Path) -> None:
    """Make a run folder that other users cannot enter: TLS would hide nothing from who reads the recording.

    One that is there keeps its mode.
    """
    run.mkdir(mode=0o700, parents=True, exist_ok=True)


def write_secret(path: Path, data: bytes) -> None:
    """Write a file that only its owner can read, atomically. Raise OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}.new")
    beside.unlink(missing_ok=True)
    with os.fdopen(os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(data)
    beside.replace(path)


def listen_at(text: str) -> tuple[str, int]:
    """Return host and port of host:port; LOOPBACK for "". Raise ValueError for anything else."""
    if not text:
        return LOOPBACK
    host, colon, port = text.rpartition(":")
    if not (host and colon and port.isascii() and port.isdecimal() and int(port) < 65536):
        raise ValueError(f"{text!r} is not an address to listen at, expected host:port, such as 127.0.0.1:8350")
    return host, int(port)
