"""The links of an agent with its neighbours: one session, opened again where keys were renewed or one was revoked.

Both ends of a link listen and dial, so that a restarted agent is linked again at once, and a storm of connections has
to hit both ends to keep them apart. The session is open whether a neighbour is there or not.
"""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import zenoh

from agent_runtime.core.errors import RuntimeFault
from agent_runtime.core.wiring import Wiring
from agent_runtime.io.options import AGENTS_VARIABLE, Options
from agent_runtime.io.secured import age, client_tls, links_of, links_tls
from agent_runtime.io.sessions import open_client, open_links

UNIX_SOCKET = "unixsock-stream/"
"""Endpoints of sockets of this host begin so. They do not tell who is at the other end: rules by certificate would
refuse all, so there are none. A user who may write the folder of the sockets may speak as any agent.
"""


class NoEndpointError(RuntimeFault):
    """Nobody told where an agent is reached."""


class Links:
    """Of one agent, at the endpoint that `options.agents` has for it."""

    def __init__(self, options: Options, wiring: Wiring) -> None:
        """Raises KeysError where the keys or the rules of this agent are missing, NoEndpointError where an endpoint."""
        linked = [peer for peer in wiring.peers if peer not in wiring.groups]
        unknown = [name for name in (wiring.agent, *linked) if name not in options.agents]
        if unknown:
            there = ", ".join(options.agents) or "none"
            raise NoEndpointError(
                f"{AGENTS_VARIABLE} has no endpoint of {', '.join(unknown)}; it has {there}, and"
                f" {wiring.agent} is linked with {', '.join(linked)}: `roco up` tells each agent, else set"
                f" {AGENTS_VARIABLE}={wiring.agent}=tls/HOST:PORT,..."
            )
        self._keys, self._name = options.keys, wiring.agent
        self.at = options.listen or options.agents[wiring.agent]
        self._neighbours = tuple(dict.fromkeys(options.agents[peer] for peer in linked))
        self._age: object = None
        self._settings()

    def _settings(self) -> tuple[dict[str, Any] | None, dict[str, Any] | None]:
        if self._keys is None or self.at.startswith(UNIX_SOCKET):
            return None, None
        return links_tls(self._keys, self._name), links_of(self._keys, self._name)

    def open(self) -> zenoh.Session:
        """Raises zenoh.ZError where the address is taken, KeysError where keys are missing now."""
        self._age = self._of_keys()
        tls, rules = self._settings()
        if self.at.startswith(UNIX_SOCKET):
            Path(self.at.removeprefix(UNIX_SOCKET)).parent.mkdir(mode=0o700, exist_ok=True)
        return open_links(self.at, self._neighbours, tls, rules)

    @property
    def stale(self) -> bool:
        """Whether the session has other keys, or other rules, than there are now."""
        return self._of_keys() not in (self._age, None)

    def _of_keys(self) -> tuple[int, int] | None:
        return None if self._keys is None else age(self._keys, self._name)


class Joining:
    """Joins the router of the tools beside the agent's work: tried at once, then in a thread until it is there."""

    def __init__(
        self, options: Options, name: str, join: Callable[[zenoh.Session], None], told: Callable[[str], None]
    ) -> None:
        """`told`: gets the reason where it takes longer, and again where it is another one."""
        self._options, self._join, self._told = options, join, told
        self._tls = client_tls(options.keys, name) if options.keys else None
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._try, args=(self._ended.is_set,), name="join", daemon=True)
        once = iter((False, True))
        if not self._try(lambda: next(once)):
            self._thread.start()

    def _try(self, give_up: Callable[[], bool]) -> bool:
        session = open_client(self._options.connect, give_up, tls=self._tls, told=self._told)
        if session is not None:
            self._join(session)
        return session is not None

    def close(self) -> None:
        """End the tries."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)  # a try ends after some ms
