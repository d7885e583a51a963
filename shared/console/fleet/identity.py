"""Identity of a session of the command line at a fleet with keys (docs/security.md)."""

import os
from pathlib import Path
from typing import Any

from agent_runtime.core.errors import RuntimeFault
from agent_runtime.io.run_files import KEYS_FOLDER, KEYS_VARIABLE
from agent_runtime.io.secured import client_tls
from console.errors import ConsoleError
from operate.fleet_file import Fleet

CONSOLE = "console"
"""The identity that hears everything and says nothing, where there are keys."""
OPERATOR = "operator"
"""The identity that may write orders to agents, where there are keys: not the one that listens."""


def tls(run: Path, fleet: Fleet, identity: str) -> dict[str, Any] | None:
    """Return the TLS options by which a session identifies itself; None if the fleet has no keys.
    Raises ConsoleError if key files are missing.
    """
    keys = folder(run, fleet)
    try:
        return client_tls(keys, identity) if keys else None
    except RuntimeFault as error:
        raise ConsoleError(str(error)) from error


def folder(run: Path, fleet: Fleet) -> Path | None:
    """Return the folder of the fleet's keys; None if it has none."""
    if not fleet.connect.startswith("tls/"):
        return None
    told = os.environ.get(KEYS_VARIABLE)
    return Path(told) if told else run / KEYS_FOLDER
