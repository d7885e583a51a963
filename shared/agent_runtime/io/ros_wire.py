"""A node of ROS 2 as rmw_zenoh writes it: keys, tokens and attachments, at a router of its own,
where no agent is.

Source: docs/design.md and rmw_zenoh_cpp 0.6.7 of github.com/ros2/rmw_zenoh. Nothing is subscribed:
what comes in are calls of the services that are declared here. Must not know: how messages are
encoded.
"""

import hashlib
import struct
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from typing import Any

import zenoh
import zenoh.ext

from agent_runtime.core.errors import RuntimeFault
from agent_runtime.io.sessions import client_config, close, open_router

HEARTBEAT_S = 1.0
"""Between two numbers of the last latched message, if it changed; estimate."""
QOS, LATCHED_QOS = "::,10:,:,:,,", ":1:,1:,:,:,,"
"""Reliable, the last ten; reliable, transient local, the last one. Left out: the defaults."""
_GID_BYTES = 16
_NODE = 0
"""Number of the only node of the session."""


class NoRosRouterError(RuntimeFault):
    """No router of Zenoh is at this address, and none can be opened there."""


class Node:
    """A node at a router. `own`: the router is of this process, else it was there."""

    def __init__(self, endpoint: str, name: str, domain: int) -> None:
        """`endpoint` like tcp/127.0.0.1:7447. Raise NoRosRouterError."""
        self._router: zenoh.Session | None = None
        with suppress(zenoh.ZError):  # it is there
            self._router = open_router(endpoint)
        self.own = self._router is not None
        try:
            self._session = zenoh.open(client_config(endpoint, timestamping=True))
        except zenoh.ZError as error:
            why = "something else listens there, or it is no address of this machine"
            raise NoRosRouterError(f"{endpoint} has no router of Zenoh: {why}") from error
        self._name, self._domain, self._numbers = name, domain, count(1)
        self._lives = f"@ros2_lv/{domain}/{self._session.zid()}/{_NODE}"
        self._kept: list[Any] = []
        self._token(f"{self._lives}/{_NODE}/NN/%/%/{name}")

    def publisher(
        self, topic: str, kind: str, digest: str, *, latched: bool
    ) -> Callable[[Callable[[], bytes], int], None]:
        """Return what publishes on a topic: it takes a function that encodes a message, called if
        somebody may get it, and the time [ns]. `kind`: such as "std_msgs/msg/String"; `digest`: its
        hash, RIHS01_...
        """
        key, qos = self._key(topic, kind, digest), LATCHED_QOS if latched else QOS
        declared: Any
        if latched:
            declared = zenoh.ext.declare_advanced_publisher(
                self._session,
                key,
                cache=zenoh.ext.CacheConfig(1),
                publisher_detection=True,
                sample_miss_detection=zenoh.ext.MissDetectionConfig(
                    heartbeat=None, sporadic_heartbeat=HEARTBEAT_S
                ),
            )
        else:
            declared = self._session.declare_publisher(key)
        gid, numbers = self._entity("MP", topic, kind, digest, qos), count(1)
        self._kept.append(declared)

        def publish(encoded: Callable[[], bytes], at_ns: int) -> None:
            if latched or declared.matching_status.matching:
                declared.put(encoded(), attachment=_attachment(next(numbers), at_ns, gid))

        return publish

    def service(self, name: str, kind: str, digest: str, answer: Callable[[bytes], bytes]) -> None:
        """Offer a service; Zenoh's threads call `answer`. `digest`: the hash of its type."""

        def asked(query: zenoh.Query) -> None:
            told = query.attachment.to_bytes() if query.attachment is not None else b""
            if len(told) < _ATTACHMENT.size:
                return  # no node of ROS: it could not tell which call is answered
            number, _, size, gid = _ATTACHMENT.unpack_from(told)
            if size != _GID_BYTES:
                return
            request = query.payload.to_bytes() if query.payload is not None else b""
            again = _attachment(number, time.time_ns(), gid)
            query.reply(query.key_expr, answer(request), attachment=again)

        key = self._key(name, kind, digest)
        self._kept.append(self._session.declare_queryable(key, asked, complete=True))
        self._entity("SS", name, kind, digest, QOS)

    def close(self) -> None:
        """Leave the graph; end the router, where it is of this process."""
        close(self._session)
        if self._router is not None:
            close(self._router)

    def _key(self, topic: str, kind: str, digest: str) -> str:
        return f"{self._domain}/{topic.strip('/')}/{_dds(kind)}/{digest}"

    def _entity(self, what: str, topic: str, kind: str, digest: str, qos: str) -> bytes:
        """Declare the token of a publisher (MP) or a service (SS); its 16 bytes."""
        mangled = topic.replace("/", "%")
        place = f"{self._lives}/{next(self._numbers)}/{what}/%/%/{self._name}"
        token = f"{place}/{mangled}/{_dds(kind)}/{digest}/{qos}"
        self._token(token)
        return hashlib.blake2b(token.encode(), digest_size=_GID_BYTES).digest()

    def _token(self, key: str) -> None:
        self._kept.append(self._session.liveliness().declare_token(key))


_ATTACHMENT = struct.Struct(f"<qqB{_GID_BYTES}s")
"""Number of the message, time [ns], size and bytes of what tells one entity from another."""


def _attachment(number: int, at_ns: int, gid: bytes) -> bytes:
    return _ATTACHMENT.pack(number, at_ns, _GID_BYTES, gid)


def _dds(kind: str) -> str:
    package, what, name = kind.split("/")
    return f"{package}::{what}::dds_::{name}_"
