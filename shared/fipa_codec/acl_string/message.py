"""The abstract ACL message: the parameters of SC00061G, typed, without a representation. None or empty means: absent.

Expressions (language, conversation-id, ...) are text: a number or a nested expression keeps its characters. Independent
of any representation.
"""

from datetime import UTC, datetime, timedelta

import msgspec

from fipa_codec.communicate import MAX_BYTES
from fipa_codec.errors import LocalProtocolError
from fipa_codec.performatives import Performative

MAX_ACL_BYTES = 2 * MAX_BYTES + 65_536
"""Size limit of a text, both ways [bytes]: the content with every character escaped, and the rest. Estimate."""

MAX_DEPTH = 32
"""Depth limit of nested parentheses or resolvers. Estimate; messages of JADE have 4."""

MAX_ITEMS = 10_000
"""Limit of parameters and members of sets, sequences and expressions in a text. Estimate; messages of JADE have 30."""

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
MILLISECOND = timedelta(milliseconds=1)
MIN_MS = (datetime.min.replace(tzinfo=UTC) - EPOCH) // MILLISECOND
"""Earliest time [ms since 1970 UTC]: year 1, since a date has four digits for the year (SC00070I)."""
MAX_MS = (datetime.max.replace(tzinfo=UTC) - EPOCH) // MILLISECOND
"""Latest time [ms since 1970 UTC]: end of year 9999."""
MAX_AFTER_MS = 10_000 * 365 * 86_400_000 - 1
"""Longest relative time [ms]: just under 10000 years of 365 days."""


class At(msgspec.Struct, frozen=True, tag=True):
    """An absolute time [ms since 1970 UTC]. Raise LocalProtocolError outside the years 1 to 9999."""

    unix_ms: int

    def __post_init__(self) -> None:
        if not MIN_MS <= self.unix_ms <= MAX_MS:
            raise LocalProtocolError("reply-by", f"{self.unix_ms} ms is outside the years 1 to 9999")


class After(msgspec.Struct, frozen=True, tag=True):
    """A time relative to the receipt of the message [ms]; negative: before it.

    Raise LocalProtocolError from 10000 years on.
    """

    ms: int

    def __post_init__(self) -> None:
        if abs(self.ms) > MAX_AFTER_MS:
            raise LocalProtocolError("reply-by", f"{self.ms} ms is more than 9999 years")


class Aid(msgspec.Struct, frozen=True, omit_defaults=True):
    """An agent identifier (SC00023K). The name identifies the agent; addresses and resolvers are ordered by preference.

    `user`: user-defined slots by name; the names begin with `X-`.
    """

    name: str
    addresses: tuple[str, ...] = ()
    resolvers: tuple["Aid", ...] = ()
    user: dict[str, str] = {}


class AclMessage(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One ACL message. `receiver` and `reply_to` are sets; their order is kept but has no meaning.

    `content` is text, or bytes if it is not UTF-8; empty and absent (None) content differ. `user`: user-defined
    parameters by name; the names begin with `X-` and differ not only in upper and lower case.
    """

    performative: Performative
    sender: Aid | None = None
    receiver: tuple[Aid, ...] = ()
    reply_to: tuple[Aid, ...] = ()
    content: str | bytes | None = None
    language: str | None = None
    encoding: str | None = None
    ontology: str | None = None
    protocol: str | None = None
    conversation_id: str | None = None
    reply_with: str | None = None
    in_reply_to: str | None = None
    reply_by: At | After | None = None
    user: dict[str, str] = {}

    def __post_init__(self) -> None:
        """Decode content that is UTF-8, so that messages with the same content are equal."""
        if isinstance(self.content, bytes):
            try:
                msgspec.structs.force_setattr(self, "content", self.content.decode())
            except UnicodeDecodeError:
                return
