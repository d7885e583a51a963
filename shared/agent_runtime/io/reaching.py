"""Reasons why a router is not reached, in words: found by a connection and a TLS handshake with
one's own files.

Zenoh tells a client only that there is no session. A handshake of Python's own tells whether the
name is resolved, the port answers, and which of the two certificates is not taken.
"""

import datetime as dt
import random
import re
import socket
import ssl
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

LOOPBACK_REMEDY = (
    "`ip link set lo up`, and `ip address add 127.0.0.1/8 dev lo` if it has no such address"
)
TRY_S = 1.0
"""Longest of a connection, and of a handshake (estimate: it takes some ms in one house)."""
REFUSED_S = 0.5
"""A router that does not take a certificate says so after the handshake of TLS 1.3, in 1 ms
(measured); with room.
"""
FIRST_S = 5.0
"""A fleet that starts waits for its router for some seconds; after these the reason is looked for
(estimate).
"""
EACH_S = 10.0
"""Between two looks (estimate: people read it)."""

_OWN = {
    "CERTIFICATE_EXPIRED": "does not hold by the router's clock, which differs from the one here",
    "UNKNOWN_CA": "is of another authority than the router's",
    "DECRYPT_ERROR": "is of another authority than the router's",
    "CERTIFICATE_REQUIRED": "is missing: the router wants one",
    "UNSUPPORTED_CERTIFICATE": "is not for a client",
    "BAD_CERTIFICATE": "is not taken",
    "CERTIFICATE_UNKNOWN": "is not taken",
    "ACCESS_DENIED": "is not taken",
}
"""Alerts of the router about one's own certificate (RFC 8446, 6.2), by the end of OpenSSL's word
for them.
"""
_MAKE, _START = (
    "`roco keys make` makes new keys, `roco up` at each start",
    "they may be of another start",
)
_THEIRS = {
    9: "does not hold yet by the clock of this machine: is the clock behind?",
    10: "has ended, by the clock of this machine: it listens with old keys, or the clock is wrong",
    62: "is not for this host: `roco keys make --host` names one more",
    64: "is not for this address: `roco keys make --host` names one more",
    **dict.fromkeys((85, 86), f"names no key of its authority, as older versions made it; {_MAKE}"),
    **dict.fromkeys(
        (7, 18, 19, 20, 21), f"is of another authority than the own keys: {_MAKE}; {_START}"
    ),
}
"""Codes of OpenSSL's verification of the router's certificate (x509_vfy.h)."""


class Tries:
    """Tries that failed: after some time, and then now and again, the reason is told if it is
    another one.
    """

    def __init__(
        self, endpoint: str, tls: dict[str, Any] | None, told: Callable[[str], None]
    ) -> None:
        self._endpoint, self._tls, self._told = endpoint, tls, told
        self._look_at, self._last = time.monotonic() + FIRST_S, ""

    def failed(self) -> None:
        """Look for the reason, if it is time."""
        if time.monotonic() < self._look_at:
            return
        reason = why_not(self._endpoint, self._tls) or "the router answers, but opens no session"
        self._look_at = time.monotonic() + EACH_S
        if reason != self._last:
            self._last = reason
            self._told(reason)


def why_not(endpoint: str, tls: dict[str, Any] | None) -> str:
    """Why a session is not had at an endpoint (tls/host:port) with these files; "" where all is
    well so far.

    `tls`: as `secured.client_tls` returns it. Blocks for some seconds at most, beside the
    resolution of a name.
    """
    address = re.match(r"(\w+)/\[?([^\[\]]+)\]?:(\d+)", endpoint)
    if address is None:
        return f"{endpoint!r} is not an address, expected such as tls/router:7447"
    protocol, host, port = address[1], address[2], int(address[3])
    if (protocol == "tls") != (tls is not None):
        lacks = "no keys are given (ROCO_TLS_DIR)" if tls is None else "keys are given"
        return f"the address is {endpoint}, but {lacks}: the two do not go together"
    try:
        with socket.create_connection((host, port), TRY_S) as connection:
            return _handshake(connection, host, tls) if tls else ""
    except socket.gaierror as error:
        return (
            f"the name {host} is not resolved ({error.strerror}): is it right in ROCO_CONNECT, and"
            " its host up?"
        )
    except ConnectionRefusedError:
        return f"nobody listens at {endpoint} (connection refused): is the router up?"
    except TimeoutError:
        return (
            f"{endpoint} does not answer within {TRY_S:g} s: is its host up, is a firewall in the"
            " way?"
        )
    except OSError as error:
        return f"{endpoint} is not reached: {error.strerror or error}"


def no_loopback() -> str:
    """Why the processes of this host cannot meet on 127.0.0.1; "" where they can: a port there
    takes a connection.
    """
    try:
        with (
            socket.create_server(("127.0.0.1", 0)) as listener,
            socket.create_connection(listener.getsockname(), TRY_S),
        ):
            return ""
    except OSError as error:
        return f"processes cannot meet on 127.0.0.1 ({error.strerror or error})"


RANGE = Path("/proc/sys/net/ipv4/ip_local_port_range")
PORTS, TRIES = 10_000, 100
"""So many ports below those of outgoing connections are looked at, and so often (estimate: few of
them are taken).
"""
_KEPT: list[socket.socket] = []
"""UDP sockets that tell other fleets of this machine which TCP ports will be listened at."""


def free_port() -> int:
    """A TCP port of the loopback interface that nobody listens on now, so that several fleets run
    side by side.

    Who listens does so seconds later: it is none of those that the system may give to outgoing
    connections meanwhile, and no other fleet is given it while this process lives, since the UDP
    port of the same number is kept. Raise OSError.
    """
    if why := no_loopback():
        raise OSError(f"{why}: {LOOPBACK_REMEDY}")
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
    """Return the lowest port that the system gives to outgoing connections; 32768, Linux's default,
    elsewhere.
    """
    with suppress(OSError, ValueError, IndexError):
        return max(int(RANGE.read_text().split()[0]), 1024 + PORTS)
    return 32768


def _handshake(connection: socket.socket, host: str, tls: dict[str, Any]) -> str:
    try:
        context = ssl.create_default_context(cafile=tls["root_ca_certificate"])
        # the default since Python 3.13: the same answer in each version
        context.verify_flags |= ssl.VERIFY_X509_STRICT
        own = Path(tls.get("connect_certificate", ""))
        if own.name:
            context.load_cert_chain(own, tls["connect_private_key"])
    except (ssl.SSLError, OSError) as error:
        return f"the own keys cannot be read: {error}; {_MAKE}"
    if outside := _outside(own):
        return outside
    try:
        with context.wrap_socket(connection, server_hostname=host) as secured:
            return _answer(secured)
    except ssl.SSLCertVerificationError as error:
        other = f"is not taken ({error.verify_message}); {_MAKE}"
        return f"the router's certificate {_THEIRS.get(error.verify_code, other)}"
    except ssl.SSLError as error:
        return _refused(error, own)
    except TimeoutError:
        return (
            f"who listens there does not answer the handshake within {TRY_S:g} s: it speaks no TLS,"
            " or hangs"
        )


def _answer(secured: ssl.SSLSocket) -> str:
    """Wait for the alert of a router that does not take the own certificate. Raise ssl.SSLError
    with it.
    """
    secured.settimeout(REFUSED_S)
    try:
        return "" if secured.recv(1) else "the router ends the connection after the handshake"
    except TimeoutError:
        return ""  # it waits for the first word of Zenoh


def _outside(own: Path) -> str:
    """The reason why the own certificate is not valid now; "" if it is."""
    if not own.name:
        return ""
    from agent_runtime.io import issuing  # heavy, and seldom needed

    begin, end = issuing.lifetime(own)
    now = dt.datetime.now(dt.UTC)
    if now > end:
        return f"the own certificate {own.name} ended {end:%Y-%m-%d %H:%M} UTC; {_MAKE}"
    if now < begin:
        clock = f"by the clock of this machine it is {now:%Y-%m-%d %H:%M}: is it behind?"
        return f"the own certificate {own.name} holds from {begin:%Y-%m-%d %H:%M} UTC on; {clock}"
    return ""


def _refused(error: ssl.SSLError, own: Path) -> str:
    reason = error.reason or ""
    for word, words in _OWN.items():
        if reason.endswith(word):
            return f"the router refuses: the own certificate {own.name} {words}; {_MAKE}"
    if reason in ("WRONG_VERSION_NUMBER", "UNEXPECTED_EOF_WHILE_READING", "RECORD_LAYER_FAILURE"):
        return "who listens there speaks no TLS: a router without keys, or another program"
    return f"the handshake failed: {reason or error}"
