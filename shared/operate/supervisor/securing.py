"""Keys of the processes of a fleet, and the address of their router: TLS, unless it is forbidden.

The process that starts the router makes the keys, in the run folder: new ones at each start, and
before they expire. A supervisor of a part of the fleet takes those that it is given.

The first ones are made beside the start of the router, which waits for them: half a second in which
nobody need wait.
"""

import datetime as dt
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from agent_runtime.io.reaching import free_port
from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.secured import ROUTER, key_file
from agent_runtime.io.sessions import UNIX_SOCKET
from operate.fault_proxy.files import place
from topdown.model.design import Design

TLS, PLAIN = "tls/", "tcp/"
LOOPBACK = ("127.0.0.1", "localhost", "::1")
DAYS = 7.0
"""Lifetime of keys, as agent_runtime.io.issuing has it (a test compares): that module is loaded
beside the start.
"""
LAST = 1 / 7
"""Of the time that keys hold: then they are renewed (of a week its last day: as long as a machine
may sleep).
"""
AGAIN_S = 60.0  # estimate: a day is left
SOCKETS_FOLDER = "links"
LONGEST_SOCKET = 107 - len(".lock")  # sun_path (unix(7)); Zenoh writes a lock file beside it
ENDPOINT_MARKS = "?#;"
"""Of Zenoh's endpoints."""


class Keys:
    """The router's address, and the folder of keys: None where nothing is encrypted.

    `own`: where the processes of this host meet; `listen`: where the router listens that is started
    here. One that others reach, too, has a listener on loopback for its own: a flood of handshakes
    locks the listener that it hits, and no other. `agents`: where each agent is reached.
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
        here: bool,
        agents: Mapping[str, str],
        unix: bool = False,
        days: float = DAYS,
    ) -> None:
        """Begin to make them, where a router is started here and none are given.

        `connect`: the address asked for, "" for a free port here; `given`: a folder of keys that
        are there; `here`: whether the router is started here; `agents`: each agent with its
        endpoint, "" for a free port here, or with `unix` a socket in the run folder. ValueError
        where address and keys do not fit, or the name of a socket would be too long.
        """
        self._design, self._system, self._days = design, system, days
        self._from, self._due = -float("inf"), float("inf")
        mine = here and not given and not insecure
        self.folder = (
            run / KEYS_FOLDER if mine else Path(given).resolve() if given and not insecure else None
        )
        scheme = TLS if self.folder else PLAIN
        self.address = connect or f"{scheme}127.0.0.1:{free_port()}"
        self.agents = {
            name: at or (socket_in(run, name) if unix else f"{scheme}127.0.0.1:{free_port()}")
            for name, at in agents.items()
        }
        self._fit()
        self.own = self.listen = self.address
        if here and place(self.address)[0] not in LOOPBACK:
            self.own = f"{self.address.partition('/')[0]}/127.0.0.1:{free_port()}"
            self.listen = f"{self.address},{self.own}"
        self._making = threading.Thread(target=self._begin, name="keys", daemon=True)
        self._failed: Exception | None = None
        self._tried: float | None = None
        if self.folder and mine:
            # of the last start: the router waits for a new one
            key_file(self.folder, ROUTER).unlink(missing_ok=True)
            self._making.start()

    def _fit(self) -> None:
        """Raise ValueError where the address and the keys do not go together."""
        if "," in self.address:
            raise ValueError(f"{self.address!r} names several routers: a fleet has one")
        if self.folder and not self.address.startswith(TLS):
            raise ValueError(
                f"with keys the router's address begins with {TLS}, {self.address!r} not; or"
                " --insecure"
            )
        if not self.folder and self.address.startswith(TLS):
            raise ValueError(
                f"{self.address!r} wants keys, and there are none: --keys names their folder"
            )

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
        """Renew them in their last days, where the clock was set back to before they hold, and
        where they were deleted.

        The router sees it, and all come back to it with the new ones. Raises OSError where the
        first ones could not be written; later ones are tried again.
        """
        if self._failed is not None:
            raise self._failed
        if self._from <= (now := time.time()) < self._due and self._there():
            return
        if self._tried is not None and 0.0 <= now - self._tried < AGAIN_S:
            return
        try:
            words = f"the keys are renewed; they hold until {self._make():%Y-%m-%d %H:%M} UTC"
            self._tried = None
        except OSError as error:
            words = f"the keys cannot be renewed: {error}; tried again in {AGAIN_S:g} s"
            self._tried = now
        with suppress(OSError):  # a full disk takes no words either
            print(words, flush=True)

    def _there(self) -> bool:
        """Whether keys that were made here are still there; none were made where none shall be."""
        return self._due == float("inf") or key_file(self.folder or Path(), ROUTER).exists()

    def _make(self) -> dt.datetime:
        from agent_runtime.io import issuing

        assert self.folder is not None
        hosts = tuple(dict.fromkeys((*issuing.HOSTS, place(self.address)[0])))
        systems, now = (self._system,), dt.datetime.fromtimestamp(time.time(), dt.UTC)
        made = issuing.issue(
            self.folder, self._design, systems, days=self._days, hosts=hosts, now=now
        )
        until = made.until
        self._from = until.timestamp() - self._days * 86400.0 - issuing.BACK.total_seconds() / 2
        self._due = until.timestamp() - LAST * self._days * 86400.0
        return until


def socket_in(run: Path, agent: str) -> str:
    """Return the endpoint of an agent's socket in a run folder. Raise ValueError where no socket
    can have the name.
    """
    name = str((run / SOCKETS_FOLDER / f"{agent}.sock").resolve())
    if len(name.encode()) > LONGEST_SOCKET or set(name) & set(ENDPOINT_MARKS):
        raise ValueError(
            f"--links unix: the socket {name} cannot be: its name has more than {LONGEST_SOCKET}"
            f" bytes, or one of {ENDPOINT_MARKS}; name another folder with --out"
        )
    return f"{UNIX_SOCKET}{name}"
