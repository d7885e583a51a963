"""Identity of a session of the command line at a fleet with keys (docs/security.md), and a session
by which orders are put: `python -m console.fleet.identity KEY HEX` puts one, in a container beside
the agents.
"""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from agent_runtime.core.errors import RuntimeFault
from agent_runtime.io.run_files import KEYS_FOLDER, KEYS_VARIABLE
from agent_runtime.io.secured import client_tls
from console.errors import ConsoleError, FleetError
from console.runs import folders
from operate.fleet_file import Fleet

CONSOLE = "console"
"""The identity that gets guests' messages, heartbeats and telemetry, and writes nothing."""
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


# --- A session of an identity to a fleet: to its router, by which orders are put, or an agent -----


CONNECT_VARIABLE = "ROCO_CONNECT"
ANSWER_S = 5.0
"""Time to wait for an answer [s] (estimate: it takes milliseconds)."""


@contextmanager
def session(run: Path, who: str = OPERATOR, to: str = "") -> Iterator[Callable[[str, bytes], None]]:
    """Return what puts data on a key. `to`: an agent that is to hear it; one that it is linked with
    is dialled.

    Raises FleetError: nobody answers; ConsoleError: keys are missing.
    """
    fleet = folders.living(run)
    if fleet is None:
        raise FleetError(f"nothing runs in {run}; `roco up` starts a fleet")
    at = fleet.agents.get(to, fleet.connect) if who in fleet.agents else fleet.connect
    with _session(at, tls(run, fleet, who)) as put:
        yield put


@contextmanager
def _session(connect: str, tls: dict[str, Any] | None) -> Iterator[Callable[[str, bytes], None]]:
    from agent_runtime.io import sessions  # most verbs need no session
    from agent_runtime.io.reaching import why_not

    until = time.monotonic() + ANSWER_S
    opened = sessions.open_client(connect, lambda: time.monotonic() > until, tls=tls)
    if opened is None:
        why = why_not(connect, tls) or f"{connect} opens no session"
        raise FleetError(f"{why}; `roco status` says whether it runs")
    try:
        yield lambda key, data: sessions.put(opened, key, data)
    finally:
        opened.close()  # type: ignore[no-untyped-call]


def main(key: str, data: str) -> None:
    """Put one order as the environment of this container says. Raises FleetError, KeysError."""
    keys = os.environ.get(KEYS_VARIABLE)
    with _session(
        os.environ[CONNECT_VARIABLE], client_tls(Path(keys), OPERATOR) if keys else None
    ) as put:
        put(key, bytes.fromhex(data))


if __name__ == "__main__":
    main(*sys.argv[1:])
