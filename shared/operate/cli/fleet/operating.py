"""A session of the operator, or of another identity, to the router of a fleet, by which orders are put.

`python -m operate.cli.fleet.operating KEY HEX` puts one, in a container beside the agents.
"""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from agent_runtime.io import message_size
from agent_runtime.io.reaching import why_not
from agent_runtime.io.run_files import KEYS_VARIABLE
from agent_runtime.io.secured import client_tls
from agent_runtime.io.sessions import open_client
from operate.cli.errors import FleetError
from operate.cli.fleet import identity
from operate.cli.fleet.identity import OPERATOR
from operate.cli.runs import folders

CONNECT_VARIABLE = "ROCO_CONNECT"
ROUTER_S = 5.0
"""Time to wait for a router [s] (estimate: it answers in milliseconds)."""


@contextmanager
def session(run: Path, who: str = OPERATOR) -> Iterator[Callable[[str, bytes], None]]:
    """Return what puts data on a key. Raises FleetError: no router answers; ConsoleError: keys are missing."""
    fleet = folders.living(run)
    if fleet is None:
        raise FleetError(f"nothing runs in {run}; `roco up` starts a fleet")
    with _session(fleet.connect, identity.tls(run, fleet, who)) as put:
        yield put


@contextmanager
def _session(connect: str, tls: dict[str, Any] | None) -> Iterator[Callable[[str, bytes], None]]:
    until = time.monotonic() + ROUTER_S
    opened = open_client(connect, lambda: time.monotonic() > until, tls=tls)
    if opened is None:
        why = why_not(connect, tls) or f"the router at {connect} opens no session"
        raise FleetError(f"{why}; `roco status` says whether it runs")
    try:
        yield lambda key, data: message_size.put(opened, key, data)
    finally:
        opened.close()  # type: ignore[no-untyped-call]


def main(key: str, data: str) -> None:
    """Put one order as the environment of this container says. Raises FleetError, KeysError."""
    keys = os.environ.get(KEYS_VARIABLE)
    with _session(os.environ[CONNECT_VARIABLE], client_tls(Path(keys), OPERATOR) if keys else None) as put:
        put(key, bytes.fromhex(data))


if __name__ == "__main__":
    main(*sys.argv[1:])
