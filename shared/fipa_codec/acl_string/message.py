"""The abstract ACL message: the parameters of SC00061G, typed, in no representation. None or empty means: absent.

Expressions (language, conversation-id, ...) are text here: a number or a nested expression keeps its characters. Must
not know: any representation, communicates.
"""

from datetime import UTC, datetime, timedelta

import msgspec

from fipa_codec.communicate import MAX_BYTES
from fipa_codec.errors import LocalProtocolError
from fipa_codec.performatives import Performative

MAX_ACL_BYTES = 2 * MAX_BYTES + 65_536
"""Longest text taken or made: a communicate's content with each character escaped, and the rest; estimate."""

MAX_DEPTH = 32
"""Deepest nesting of parentheses or resolvers. JADE's own messages have 4; estimate."""

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
MILLISECOND = timedelta(milliseconds=1)
MIN_MS = (datetime.min.replace(tzinfo=UTC) - EPOCH) // MILLISECOND
"""Year 1: four digits of a year and a calendar are all that a date has (SC00070I)."""
MAX_MS = (datetime.max.replace(tzinfo=UTC) - EPOCH) // MILLISECOND
MAX_AFTER_MS = 10_000 * 365 * 86_400_000 - 1
"""The longest relative time that four digits of years hold; a year counts 365 days there."""


class At(msgspec.Struct, frozen=True, tag=True):
    """An absolute time, in milliseconds since 1970 UTC. LocalProtocolError outside the years 1 to 9999."""

    unix_ms: int

    def __post_init__(self) -> None:
        if not MIN_MS <= self.unix_ms <= MAX_MS:
            raise LocalProtocolError("reply-by", f"{self.unix_ms} ms is outside the years 1 to 9999")


class After(msgspec.Struct, frozen=True, tag=True):
    """A time relative to the receipt of the message, in milliseconds; negative: before it."""

    ms: int

    def __post_init__(self) -> None:
        if abs(self.ms) > MAX_AFTER_MS:
            raise LocalProtocolError("reply-by", f"{self.ms} ms is more than 9999 years")


class Aid(msgspec.Struct, frozen=True, omit_defaults=True):
    """An agent identifier (SC00023K). The name alone says who it is; addresses and resolvers are ordered by preference.

    `user`: further slots by their names, which begin with `X-`.
    """

    name: str
    addresses: tuple[str, ...] = ()
    resolvers: tuple["Aid", ...] = ()
    user: dict[str, str] = {}


class AclMessage(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One ACL message. `receiver` and `reply_to` are sets whose order means nothing; it is kept as written.

    `content` is text; bytes only where it is no UTF-8. Empty and absent (None) content differ. `user`: user-defined
    parameters by their names, which begin with `X-` and differ in more than upper and lower case.
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
        """Bytes that are text become text, so that equal messages are equal."""
        if isinstance(self.content, bytes):
            try:
                msgspec.structs.force_setattr(self, "content", self.content.decode())
            except UnicodeDecodeError:
                return
