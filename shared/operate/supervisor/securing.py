"""Keys of the processes of a fleet, and the address at which they meet: TLS, unless it is forbidden.

The process that starts the router makes the keys, in the run folder: new ones at each start, and before they expire. A
supervisor of a part of the fleet takes those that it is given.

The first ones are made beside the start of the router, which waits for them: half a second in which nobody need wait.
"""

import datetime as dt
import random
import socket
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from agent_runtime.io.cli import listed
from agent_runtime.io.reaching import require_loopback
from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.secured import ROUTERS, key_file
from operate.wires.files import place
from topdown.model.design import Design

TLS, PLAIN = "tls/", "tcp/"
LOOPBACK = ("127.0.0.1", "localhost", "::1")
DAYS = 7.0
"""Lifetime of keys, as agent_runtime.io.keys has it (a test compares): that module is loaded beside the start."""
LAST = 1 / 7
"""Of the time that keys hold: then they are renewed (of a week its last day: as long as a machine may sleep)."""
AGAIN_S = 60.0  # estimate: a day is left
RANGE = Path("/proc/sys/net/ipv4/ip_local_port_range")
PORTS, TRIES = 10_000, 100
"""So many ports below those of outgoing connections are looked at, and so often (estimate: few of them are taken)."""
_KEPT: list[socket.socket] = []
"""UDP sockets that tell other fleets of this machine which TCP ports will be listened at."""


class Keys:
    """Addresses of the routers, and the folder of keys: None where nothing is encrypted.

    `own`: where the processes of this host meet, of two routers comma between; `routers`: the settings of each that is
    started here. One that others reach, too, has a listener on loopback for its own: a flood of handshakes locks the
    listener that it hits, and no other. `agents`: where each agent is reached, where they are linked.
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
        here: tuple[str, ...],
        linked: bool = False,
        agents: Mapping[str, str] | None = None,
        days: float = DAYS,
    ) -> None:
        """Begin to make them, where a router is started here and none are given.

        `connect`: the addresses asked for, "" for free ports here; `given`: a folder of keys that are there; `here`:
        the routers that are started here; `linked`: there are two; `agents`: those that are linked directly, each with
        its endpoint, "" for a free port here. ValueError where addresses and keys do not fit.
        """
        self._design, self._system, self._days, self._direct = design, system, days, bool(agents)
        self._from, self._due = -float("inf"), float("inf")
        self._routers = len(ROUTERS) if linked else 1
        mine = bool(here) and not given and not insecure
        self.folder = run / KEYS_FOLDER if mine else Path(given).resolve() if given and not insecure else None
        self.addresses = listed(connect) or tuple(
            f"{TLS if self.folder else PLAIN}127.0.0.1:{free_port()}" for _ in range(self._routers)
        )
        scheme = TLS if self.folder else PLAIN
        self.agents = {name: at or f"{scheme}127.0.0.1:{free_port()}" for name, at in (agents or {}).items()}
        self._fit(here, mine=mine)
        self.own, self.routers = self._met(here)
        self._making = threading.Thread(target=self._begin, name="keys", daemon=True)
        self._failed: Exception | None = None
        self._tried: float | None = None
        if self.folder and mine:
            for name in ROUTERS:  # of the last start: a router waits for a new one
                key_file(self.folder, name).unlink(missing_ok=True)
            self._making.start()

    def _fit(self, here: tuple[str, ...], *, mine: bool) -> None:
        """Raise ValueError where the addresses do not go with each other, or with the keys."""
        for address in self.addresses:
            if self.folder and not address.startswith(TLS):
                raise ValueError(f"with keys the router's address begins with {TLS}, {address!r} not; or --insecure")
            if not self.folder and address.startswith(TLS):
                raise ValueError(f"{address!r} wants keys, and there are none: --keys names their folder")
        if mine and self._routers > 1 and len(here) < self._routers:
            raise ValueError(
                f"only {', '.join(here)} of the routers is started here: the other needs keys of the same authority;"
                " `roco keys make --routers 2`, then --keys at both hosts"
            )
        if self._routers > 1 and len(self.addresses) != self._routers:
            raise ValueError(
                f"{self._routers} routers want an address each, comma between; {self.addresses[0]!r} is"
                f" {len(self.addresses)}; without an address they get free ports"
            )

    def _met(self, here: tuple[str, ...]) -> tuple[str, dict[str, dict[str, str]]]:
        """Return where the processes of this host meet, and the settings of each router that is started here."""
        own, settings = list(self.addresses), {}
        for number, (name, address) in enumerate(zip(ROUTERS, self.addresses, strict=False)):
            if name not in here:
                continue
            listen = address
            if place(address)[0] not in LOOPBACK:
                own[number] = f"{address.partition('/')[0]}/127.0.0.1:{free_port()}"
                listen = f"{address},{own[number]}"
            settings[name] = {"ROCO_NAME": name, "ROCO_LISTEN": listen} | ({"ROCO_LINK": own[0]} if number else {})
        return ",".join(own), settings

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
        """Renew them in their last days, where the clock was set back to before they hold, and where they were deleted.

        The router sees it, and all come back to it with the new ones. Raises OSError where the first ones could not be
        written; later ones are tried again.
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
        return self._due == float("inf") or any(key_file(self.folder or Path(), name).exists() for name in ROUTERS)

    def _make(self) -> dt.datetime:
        from agent_runtime.io import issuing, keys

        assert self.folder is not None
        hosts = tuple(dict.fromkeys((*keys.HOSTS, *(place(one)[0] for one in self.addresses))))
        systems, count, now = (self._system,), self._routers, dt.datetime.fromtimestamp(time.time(), dt.UTC)
        made = issuing.issue(
            self.folder,
            self._design,
            systems,
            days=self._days,
            hosts=hosts,
            routers=count,
            direct=self._direct,
            now=now,
        )
        until = made.until
        self._from = until.timestamp() - self._days * 86400.0 - keys.BACK.total_seconds() / 2
        self._due = until.timestamp() - LAST * self._days * 86400.0
        return until


def free_port() -> int:
    """A TCP port of the loopback interface that nobody listens on now, so that several fleets run side by side.

    Who listens does so seconds later: it is none of those that the system may give to outgoing connections meanwhile,
    and no other fleet is given it while this process lives, since the UDP port of the same number is kept. Raise
    OSError.
    """
    require_loopback()
    lowest = _lowest_given()
    for port in (*random.sample(range(lowest - PORTS, lowest), TRIES), 0):
        kept = socket.socket(type=socket.SOCK_DGRAM)
        with socket.socket() as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            found = int(probe.getsockname()[1])
            kept.bind(("127.0.0.1", found))
            _KEPT.append(kept)
            return found
        kept.close()
    raise OSError("no TCP port of 127.0.0.1 is free; end what listens there (`ss -ltn`)")


def _lowest_given() -> int:
    """Return the lowest port that the system gives to outgoing connections; 32768, Linux's default, elsewhere."""
    with suppress(OSError, ValueError, IndexError):
        return max(int(RANGE.read_text().split()[0]), 1024 + PORTS)
    return 32768
