"""Sessions of Zenoh, of an agent linked with its neighbours, of a client and of the router:
settings, and the reasons.

Scouting off (no way around the router's rights), lease 2 s (a frozen process is seen in 1.6-2.0 s,
a pause of 1.2 s is not), fast reconnect, a frozen peer holds nobody up for more than 0.1 s, no
message beyond LONGEST, shared memory off (852 kB in a third of the time, but messages of one
process were lost after another was killed, and nobody was told). All measured with eclipse-zenoh
1.10.2.
"""

import ctypes
import json
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import zenoh

from agent_runtime.core.errors import RuntimeFault
from agent_runtime.core.wiring import Wiring
from agent_runtime.io.inbox import OneReaderEvent
from agent_runtime.io.logs import Log
from agent_runtime.io.options import AGENTS_VARIABLE, Options
from agent_runtime.io.reaching import Tries, free_port
from agent_runtime.io.run_files import PERIOD_S, ProcessHeartbeat, make_run
from agent_runtime.io.secured import (
    ROUTER,
    KeysError,
    age,
    client_tls,
    granted,
    links_of,
    links_tls,
    revoked,
    rights_of,
    router_tls,
)
from fipa_codec.communicate import MAX_BYTES

# --- Largest size of a message: the sender checks before it puts, since a router silently drops
# what is too long


LONGEST = 8_000_000
"""Bytes of a message that a router or client puts together again; more of it is dropped, the
session stays.

Zenoh's default is 1 GiB, and rights are looked at afterwards. When somebody sent 50 MB a router's
memory peaked at 44 MiB with this limit, and at 117 without (measured). Receivers take no more than
MAX_BYTES; the rest is room.
"""


class TooLongError(RuntimeFault):
    """A message for `key` has `size` bytes, more than `limit`; nothing was put."""

    def __init__(self, key: str, size: int, limit: int = MAX_BYTES) -> None:
        self.key, self.size, self.limit = key, size, limit
        super().__init__(
            f"a message for {key} has {size} bytes, at most {limit} are put: a longer one would be"
            " dropped on the way, and nobody told; put it in parts, or less of it"
        )


def put(session: zenoh.Session, key: zenoh.KeyExpr | str, data: bytes, **how: Any) -> None:
    """Put data on a key. `how`: options of zenoh.Session.put. Raises TooLongError; tests see that
    nobody else puts.
    """
    if len(data) > MAX_BYTES:
        raise TooLongError(str(key), len(data))
    session.put(key, data, **how)


# --- Sessions of Zenoh, of an agent linked with its neighbours, of a client and of the router -----


LEASE_MS = 2000
KEPT_BYTES = 128 * 1024 * 1024
"""Free memory that a process keeps (estimate: some dozen of the largest messages, MAX_BYTES, with
their copies).
"""
# glibc's malloc.h; its largest mmap threshold is 32 MB
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_QUEUE = {"interactive_high": 16, "data": 16, "data_low": 16}
"""Batches (64 kB each) of a priority that may be on the way; the default of 2 holds an answer of
852 kB up by 20 %.
"""
ROUTER_PATIENCE_MS, CLIENT_PATIENCE_MS = 100, LEASE_MS
"""Longest time that a receiver that takes nothing delays its senders, before what it does not take
is dropped (at the router, _DROPPED_AT_LAST) or the session is closed.

The router must lose its patience well before a client does: while it waits for a slow monitor, it
reads nothing from the sender either. With 500 ms at both the sender's session was closed, and a
healthy receiver got 45, 88, 150 of 150 messages of 852 kB; so all 150, three times (measured).
"""
CLOSE_S = 3.0
"""For a session to close; estimate: it takes some ms, and the supervisor kills an agent that needs
more than 5 s.
"""
LINK_PATIENCE_MS = 300
"""Longest time that a frozen neighbour holds up what is put to it, before the link is closed. With
2000 ms a thread that put to a healthy neighbour waited for 1.1 s, too; with 100 to 500 ms for 1 to
10 ms (measured).
"""
MORE_SESSIONS = 20
"""Sessions at a router beside as many as there are identities; more are refused. Estimate: a dozen
verbs of `roco` that listen, and processes that come back before their last session has ended.

The companion has more than a dozen identities. With an unfinished message of 7.9 MB in each of
30 sessions the router took 231 MiB (measured); its container has 256.
"""
_RETRY = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2}
_DROPPED_AT_LAST = {
    "messages": ["put"],
    "key_exprs": ["**"],
    "flows": ["egress"],
    "overwrite": {"congestion_control": "drop"},
}
"""A router drops what a receiver does not take in time, whatever its sender asked for, and keeps
the session.

Else whoever puts faster than a receiver takes cuts it off: with 60,000 messages a second co lost
its router 4 times in 8 s, and not once so (benchmarks/floods.py).
"""
_NO_SCOUTING = {"multicast": {"enabled": False}, "gossip": {"enabled": False}}


def client_config(
    endpoint: str, tls: dict[str, Any] | None = None, *, timestamping: bool = False
) -> zenoh.Config:
    """Configuration of a client of the router. `endpoint` like tcp/127.0.0.1:7447; with `tls`
    (secured.client_tls) tls/... `timestamping`: it stamps what it puts, as caches need it.
    """
    connect = {"endpoints": [endpoint], "timeout_ms": 0, "retry": _RETRY}
    stamps = {"enabled": timestamping}
    transport = _transport(tls, CLIENT_PATIENCE_MS)
    return _config("client", transport, connect=connect, timestamping=stamps)


def links_config(
    listen: str,
    neighbours: tuple[str, ...],
    tls: dict[str, Any] | None = None,
    access_control: dict[str, Any] | None = None,
) -> zenoh.Config:
    """Configuration of an agent's links: it listens, and dials each neighbour, as long as that is
    not there.

    With keys (secured.links_tls) it grants its neighbours the rights of `access_control`; all
    others get none.
    """
    waiting = {"timeout_ms": -1, "exit_on_failure": False, "retry": _RETRY}
    return _config(
        "peer",
        _transport(tls, LINK_PATIENCE_MS),
        access_control,
        listen={"endpoints": [listen]},
        connect={"endpoints": list(neighbours), **waiting},
        # Else each open waits 0.5 s for neighbours that are not there yet.
        open={"return_conditions": {"connect_scouted": False, "declares": False}},
    )


def router_config(
    endpoint: str,
    tls: dict[str, Any] | None = None,
    access_control: dict[str, Any] | None = None,
) -> zenoh.Config:
    """Configuration of the fleet's router. With keys (secured.router_tls) it grants the rights of
    `access_control`.

    `endpoint`: several, comma between, are independent: a flood of handshakes at one locks that one
    alone.
    """
    transport = _transport(tls, ROUTER_PATIENCE_MS, router=True)
    if access_control is not None:
        most = len(access_control.get("subjects", ())) + MORE_SESSIONS
        transport["unicast"] = {"max_sessions": most}
    return _config(
        "router",
        transport,
        access_control,
        listen={"endpoints": endpoint.split(",")},
        adminspace={"enabled": True},
        qos={"network": [_DROPPED_AT_LAST]},
    )


def _config(
    mode: str, transport: dict[str, Any], access_control: dict[str, Any] | None = None, **more: Any
) -> zenoh.Config:
    parts = {"mode": mode, "scouting": _NO_SCOUTING, "transport": transport, **more}
    if access_control is not None:
        parts["access_control"] = access_control
    return zenoh.Config.from_json5(json.dumps(parts))


def _transport(
    tls: dict[str, Any] | None, patience_ms: int, *, router: bool = False
) -> dict[str, Any]:
    patience = patience_ms * 1000
    drop = {"wait_before_drop": patience, "max_wait_before_drop_fragments": patience}
    waiting = {"block": {"wait_before_close": patience}, "drop": drop if router else {}}
    queue = {"size": _QUEUE, "congestion_control": waiting}
    link: dict[str, Any] = {
        "tx": {"lease": LEASE_MS, "keep_alive": 4, "queue": queue},
        "rx": {"max_message_size": LONGEST},
    }
    if tls is not None:
        link["tls"] = tls
    return {"link": link, "shared_memory": {"enabled": False}}


def keep_memory() -> None:
    """Let the C library keep memory that large messages need repeatedly; else each page is mapped
    again each time.

    An answer of 852 kB through two agents takes two thirds of the time with it
    (benchmarks/as_shipped.py). Of glibc; elsewhere nothing happens.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_TRIM_THRESHOLD, KEPT_BYTES)
        mallopt(_M_MMAP_THRESHOLD, KEPT_BYTES // 4)


def open_router(
    endpoint: str,
    tls: dict[str, Any] | None = None,
    access_control: dict[str, Any] | None = None,
) -> zenoh.Session:
    """A router in this process; when this returns it listens. Raises zenoh.ZError where the address
    is taken.
    """
    keep_memory()
    return zenoh.open(router_config(endpoint, tls, access_control))


def open_links(
    listen: str,
    neighbours: tuple[str, ...],
    tls: dict[str, Any] | None = None,
    access_control: dict[str, Any] | None = None,
) -> zenoh.Session:
    """The links of an agent, whether its neighbours are there or not. Raises zenoh.ZError: the
    address is taken.
    """
    keep_memory()
    return zenoh.open(links_config(listen, neighbours, tls, access_control))


def open_client(
    endpoint: str,
    give_up: Callable[[], bool],
    every_s: float = 0.1,
    tls: dict[str, Any] | None = None,
    told: Callable[[str], None] = lambda why: None,
) -> zenoh.Session | None:
    """A session, as soon as the router is there; None when `give_up` says so first. Blocks for one
    try at a time.

    `told` gets the reason where it takes longer, and again where it is another one.
    """
    keep_memory()
    tries = Tries(endpoint, tls, told)
    while not give_up():
        try:
            return zenoh.open(client_config(endpoint, tls))
        except zenoh.ZError:
            tries.failed()
            time.sleep(every_s)  # a try without a router ends after 6 ms
    return None


def close(session: zenoh.Session, within_s: float = CLOSE_S) -> bool:
    """Close a session; return False, and say so on standard error, where that has not ended in
    time.

    Zenoh waits without a limit for its tasks and callbacks; the process goes on, to its journal and
    its reports.
    """
    closing = threading.Thread(target=session.close, name="close", daemon=True)
    closing.start()
    closing.join(within_s)
    if closing.is_alive():
        print(
            f"the Zenoh session has not closed within {within_s:g} s; it is left as it is",
            file=sys.stderr,
            flush=True,
        )
    return not closing.is_alive()


def free_endpoint() -> str:
    """A loopback endpoint whose port nobody uses now. Raise OSError where processes cannot meet
    there.
    """
    return f"tcp/127.0.0.1:{free_port()}"


# --- The links of an agent with its neighbours: one session, opened again where keys were renewed
# or one was revoked -- Both ends of a link listen and dial, so that a restarted agent is linked
# again at once, and a storm of connections has to hit both ends to keep them apart. The session is
# open whether a neighbour is there or not.


UNIX_SOCKET = "unixsock-stream/"
"""Endpoints of sockets of this host begin so. They do not tell who is at the other end: rules by
certificate would refuse all, so there are none. A user who may write the folder of the sockets may
speak as any agent.
"""


class NoEndpointError(RuntimeFault):
    """Nobody told where an agent is reached."""


class Links:
    """Of one agent, at the endpoint that `options.agents` has for it."""

    def __init__(self, options: Options, wiring: Wiring) -> None:
        """Raises KeysError where the keys or the rules of this agent are missing, NoEndpointError
        where an endpoint.
        """
        linked = [peer for peer in wiring.peers if peer not in wiring.groups]
        unknown = [name for name in (wiring.agent, *linked) if name not in options.agents]
        if unknown:
            there = ", ".join(options.agents) or "none"
            raise NoEndpointError(
                f"{AGENTS_VARIABLE} has no endpoint of {', '.join(unknown)}; it has {there}, and"
                f" {wiring.agent} is linked with {', '.join(linked)}: `roco up` tells each agent,"
                f" else set {AGENTS_VARIABLE}={wiring.agent}=tls/HOST:PORT,..."
            )
        self._keys, self._name = options.keys, wiring.agent
        self.at = options.listen or options.agents[wiring.agent]
        self._neighbours = tuple(dict.fromkeys(options.agents[peer] for peer in linked))
        self._age: object = None
        self._settings()  # raises now, where keys are missing

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
    """Joins the router of the tools beside the agent's work: tried at once, then in a thread until
    it is there.
    """

    def __init__(
        self,
        options: Options,
        name: str,
        join: Callable[[zenoh.Session], None],
        told: Callable[[str], None],
    ) -> None:
        """`told`: gets the reason where it takes longer, and again where it is another one."""
        self._options, self._join, self._told = options, join, told
        self._tls = client_tls(options.keys, name) if options.keys else None
        self._ended = threading.Event()
        args = (self._ended.is_set,)
        self._thread = threading.Thread(target=self._try, args=args, name="join", daemon=True)
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


# --- Serving as the fleet's router ----------------------------------------------------------------
# The body of services.router, here because only this package speaks Zenoh.


KEYS_S = 10.0
"""Keys take a tenth of a second to make; some seconds on a machine that is busy with much else
(measured).
"""


def serve(options: Options) -> int:
    """Listen until SIGTERM or SIGINT. 0: stopped in order; 1: the address or the keys cannot be
    had.

    With keys it grants the rights that are beside them, and Zenoh writes each session it refuses to
    standard error. Where the keys are renewed, or one is revoked, it listens again; its clients
    reconnect and read theirs.
    """
    run = options.run_dir
    make_run(run)
    log = Log(ROUTER, options.log_level, run / "logs" / f"{ROUTER}.jsonl")
    ended = OneReaderEvent()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ended.set())
    ready, pulse = run / f"{ROUTER}.ready", ProcessHeartbeat(run, ROUTER)
    try:
        while not ended.is_set():
            _listen(options, log, ready, pulse, ended)
    except (zenoh.ZError, KeysError) as error:
        log.write("cannot listen", level="error", at=_at(options), why=str(error))
        return 1
    finally:
        ready.unlink(missing_ok=True)
    log.write("stopped")
    log.close()
    return 0


def _listen(
    options: Options, log: Log, ready: Path, pulse: ProcessHeartbeat, ended: OneReaderEvent
) -> None:
    """Be the router until the end is asked for, or other keys are there. Raises zenoh.ZError,
    KeysError.
    """
    keys = _awaited(options, pulse, ended)
    if ended.is_set():
        return
    denied: tuple[str, ...] = ()
    if options.keys is None:
        session = open_router(_at(options))
    else:
        zenoh.init_log_from_env_or("warn")
        rights, denied = rights_of(options.keys, *options.all_systems), revoked(options.keys)
        rules = granted(rights.access_control, denied)
        session = open_router(_at(options), router_tls(options.keys), rules)
    ready.unlink(missing_ok=True)  # of an earlier life; its time of change counts
    _tell_ready(ready, options)
    log.write("listening", at=_at(options), revoked=" ".join(denied))
    while not ended.wait(PERIOD_S) and _age(options) in (keys, None):
        pulse.beat()
        _tell_ready(ready, options)
    if not ended.is_set():
        log.write("the keys were renewed, or one was revoked")
    close(session)


def _tell_ready(ready: Path, options: Options) -> None:
    """Write the ready file where it is not there; on a full disk it waits for the next turn, and
    nothing else does.
    """
    if not ready.exists() or not ready.stat().st_size:
        with suppress(OSError):
            ready.write_text(_at(options))


def _awaited(
    options: Options, pulse: ProcessHeartbeat, ended: OneReaderEvent
) -> tuple[int, int] | None:
    """The age of the keys, which may be in the making."""
    until = time.monotonic() + KEYS_S
    while (
        options.keys is not None
        and _age(options) is None
        and time.monotonic() < until
        and not ended.wait(0.01)
    ):
        pulse.beat()
    return _age(options)


def _age(options: Options) -> tuple[int, int] | None:
    """The age of the router's keys, of those that are made together the last ones; None: there are
    none.
    """
    return None if options.keys is None else age(options.keys, ROUTER)


def _at(options: Options) -> str:
    return options.listen or options.connect
