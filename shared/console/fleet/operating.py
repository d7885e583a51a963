"""A session of the operator, or of another identity, to a fleet: to its router, by which orders are
put, or an agent.

`python -m console.fleet.operating KEY HEX` puts one, in a container beside the agents.
"""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from agent_runtime.io import sessions
from agent_runtime.io.reaching import why_not
from agent_runtime.io.run_files import KEYS_VARIABLE
from agent_runtime.io.secured import client_tls
from agent_runtime.io.sessions import open_client
from console.errors import FleetError
from console.fleet import identity
from console.fleet.identity import OPERATOR
from console.runs import folders

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
    with _session(at, identity.tls(run, fleet, who)) as put:
        yield put


@contextmanager
def _session(connect: str, tls: dict[str, Any] | None) -> Iterator[Callable[[str, bytes], None]]:
    until = time.monotonic() + ANSWER_S
    opened = open_client(connect, lambda: time.monotonic() > until, tls=tls)
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
