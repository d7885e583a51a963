"""Largest size of a message: the sender checks before it puts, since a router silently drops what is too long."""

from typing import Any

import zenoh

from agent_runtime.core.errors import RuntimeFault
from fipa_codec.communicate import MAX_BYTES

LONGEST = 8_000_000
"""Bytes of a message that a router or client puts together again; more of it is dropped, the session stays.

Zenoh's default is 1 GiB, and rights are looked at afterwards. When somebody sent 50 MB a router's memory peaked at
44 MiB with this limit, and at 117 without (measured). Receivers take no more than MAX_BYTES; the rest is room.
"""


class TooLongError(RuntimeFault):
    """A message for `key` has `size` bytes, more than `limit`; nothing was put."""

    def __init__(self, key: str, size: int, limit: int = MAX_BYTES) -> None:
        self.key, self.size, self.limit = key, size, limit
        super().__init__(
            f"a message for {key} has {size} bytes, at most {limit} are put: a longer one would be dropped on the way,"
            " and nobody told; put it in parts, or less of it"
        )


def put(session: zenoh.Session, key: zenoh.KeyExpr | str, data: bytes, **how: Any) -> None:
    """Put data on a key. `how`: options of zenoh.Session.put. Raises TooLongError; tests see that nobody else puts."""
    if len(data) > MAX_BYTES:
        raise TooLongError(str(key), len(data))
    session.put(key, data, **how)
