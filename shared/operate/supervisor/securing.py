"""Keys of the processes of a fleet, and the address at which they meet: TLS, unless it is forbidden.

The process that starts the router makes the keys, in the run folder: new ones at each start, and before they expire. A
supervisor of a part of the fleet takes those that it is given.

The first ones are made beside the start of the router, which waits for them: half a second in which nobody need wait.
"""

import datetime as dt
import socket
import threading
import time
from pathlib import Path

from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.secured import ROUTER, key_file
from topdown.model.design import Design

TLS, PLAIN = "tls/", "tcp/"
LOOPBACK = ("127.0.0.1", "localhost", "::1")
DAYS = 7.0
"""Lifetime of keys, as agent_runtime.io.keys has it (a test compares): that module is loaded beside the start."""
LAST = 1 / 7
"""Of the time that keys hold: then they are renewed (of a week its last day: as long as a machine may sleep)."""
AGAIN_S = 60.0  # estimate: a day is left


class Keys:
    """Address of the router, and the folder of keys: None where nothing is encrypted.

    `own`: where the processes of this host meet; `listen`: where the router listens. One that others reach, too, has a
    listener on loopback for its own: a flood of handshakes locks the listener that it hits, and no other.
    """

    def __init__(
        self,
        run: Path,
        design: Design,
        system: str,
        connect: str,
        given: str,
        *,
        insecure: bool,
        router: bool,
        days: float = DAYS,
    ) -> None:
        """Begin to make them, where the router is started here and none are given.

        `connect`: the address asked for, "" for a free port here; `given`: a folder of keys that are there. ValueError
        where address and keys do not fit.
        """
        self._design, self._system, self._days, self._due = design, system, days, float("inf")
        mine = router and not given and not insecure
        self.folder = run / KEYS_FOLDER if mine else Path(given).resolve() if given and not insecure else None
        self.address = connect or f"{TLS if self.folder else PLAIN}127.0.0.1:{free_port()}"
        if self.folder and not self.address.startswith(TLS):
            raise ValueError(f"with keys the router's address begins with {TLS}, {self.address!r} not; or --insecure")
        if not self.folder and self.address.startswith(TLS):
            raise ValueError(f"{self.address!r} wants keys, and there are none: --keys names their folder")
        outside = router and host_of(self.address) not in LOOPBACK
        self.own = f"{self.address.partition('/')[0]}/127.0.0.1:{free_port()}" if outside else self.address
        self.listen = f"{self.address},{self.own}" if outside else self.address
        self._making = threading.Thread(target=self._begin, name="keys", daemon=True)
        self._failed: Exception | None = None
        if self.folder and mine:
            key_file(self.folder, ROUTER).unlink(missing_ok=True)  # the last start's: the router waits for a new one
            self._making.start()

    def _begin(self) -> None:
        try:
            self._make()
        except Exception as error:
            self._failed = error

    def made(self) -> None:
        """Wait until they are there. Raises OSError where they cannot be written."""
        if self._making.ident is not None:
            self._making.join()
        self.tend()

    def tend(self) -> None:
        """Renew them in their last days: the router sees it, and all come back to it with the new ones.

        Raises OSError where the first ones could not be written; later ones are tried again.
        """
        if self._failed is not None:
            raise self._failed
        if time.time() < self._due:
            return
        try:
            print(f"the keys are renewed; they hold until {self._make():%Y-%m-%d %H:%M} UTC", flush=True)
        except OSError as error:
            print(f"the keys cannot be renewed: {error}; tried again in {AGAIN_S:g} s", flush=True)
            self._due = time.time() + AGAIN_S

    def _make(self) -> dt.datetime:
        from agent_runtime.io import issuing, keys

        assert self.folder is not None
        hosts = dict.fromkeys((*keys.HOSTS, host_of(self.address)))
        until = issuing.issue(self.folder, self._design, (self._system,), days=self._days, hosts=tuple(hosts)).until
        self._due = until.timestamp() - LAST * self._days * 86400.0
        return until


def host_of(address: str) -> str:
    """The host in an address like tls/127.0.0.1:7447."""
    return address.partition("/")[2].rpartition(":")[0].strip("[]")


def free_port() -> int:
    """A TCP port of the loopback interface that nobody listens on now, so that several fleets run side by side."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
