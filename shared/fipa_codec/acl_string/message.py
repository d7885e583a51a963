"""The abstract ACL message: the parameters of SC00061G, typed, without a representation. None or
empty means: absent.

Expressions (language, conversation-id, ...) are text: a number or a nested expression keeps its
characters. Independent of any representation.
"""

import re
from datetime import UTC, datetime, timedelta, timezone

import msgspec

from fipa_codec.communicate import MAX_BYTES
from fipa_codec.errors import LocalProtocolError, MalformedError
from fipa_codec.performatives import Performative

MAX_ACL_BYTES = 2 * MAX_BYTES + 65_536
"""Size limit of a text, both ways [bytes]: the content with every character escaped, and the rest.
Estimate.
"""

MAX_DEPTH = 32
"""Depth limit of nested parentheses or resolvers. Estimate; messages of JADE have 4."""

MAX_ITEMS = 10_000
"""Limit of parameters and members of sets, sequences and expressions in a text. Estimate; messages
of JADE have 30.
"""

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
MILLISECOND = timedelta(milliseconds=1)
MIN_MS = (datetime.min.replace(tzinfo=UTC) - EPOCH) // MILLISECOND
"""Earliest time [ms since 1970 UTC]: year 1, since a date has four digits for the year
(SC00070I).
"""
MAX_MS = (datetime.max.replace(tzinfo=UTC) - EPOCH) // MILLISECOND
"""Latest time [ms since 1970 UTC]: end of year 9999."""
MAX_AFTER_MS = 10_000 * 365 * 86_400_000 - 1
"""Longest relative time [ms]: just under 10000 years of 365 days."""


class At(msgspec.Struct, frozen=True, tag=True):
    """An absolute time [ms since 1970 UTC]. Raise LocalProtocolError outside the years 1 to
    9999.
    """

    unix_ms: int

    def __post_init__(self) -> None:
        if not MIN_MS <= self.unix_ms <= MAX_MS:
            raise LocalProtocolError(
                "reply-by", f"{self.unix_ms} ms is outside the years 1 to 9999"
            )


class After(msgspec.Struct, frozen=True, tag=True):
    """A time relative to the receipt of the message [ms]; negative: before it.

    Raise LocalProtocolError from 10000 years on.
    """

    ms: int

    def __post_init__(self) -> None:
        if abs(self.ms) > MAX_AFTER_MS:
            raise LocalProtocolError("reply-by", f"{self.ms} ms is more than 9999 years")


class Aid(msgspec.Struct, frozen=True, omit_defaults=True):
    """An agent identifier (SC00023K). The name identifies the agent; addresses and resolvers are
    ordered by preference.

    `user`: user-defined slots by name; the names begin with `X-`.
    """

    name: str
    addresses: tuple[str, ...] = ()
    resolvers: tuple["Aid", ...] = ()
    user: dict[str, str] = {}


class AclMessage(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One ACL message. `receiver` and `reply_to` are sets; their order is kept but has no meaning.

    `content` is text, or bytes if it is not UTF-8; empty and absent (None) content differ. `user`:
    user-defined parameters by name; the names begin with `X-` and differ not only in upper and
    lower case.
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


# --- Date and time tokens (SC00070I, 2.3): [+-]YYYYMMDDThhmmssmmm[letter]. Milliseconds are
# mandatory
# The grammar takes any letter as type designator, the text explains only Z: UTC. Without one it is
# local time. With + or - the time is relative to the receipt; its fields are amounts, a year of 365
# days and a month of 30, as in JADE, and the letter means nothing (docs/rulings.md).


DATE = re.compile(
    rb"(?P<sign>[+-]?)(?P<year>\d{4})(?P<month>\d\d)(?P<day>\d\d)[Tt]"
    rb"(?P<hour>\d\d)(?P<minute>\d\d)(?P<second>\d\d)(?P<ms>\d{3})(?P<zone>[A-Za-z]?)"
)
WRITTEN = (
    "a time YYYYMMDDThhmmssmmmZ with three digits of milliseconds, or + or - and an amount of the"
    " same form"
)

_FIELDS = ("year", "month", "day", "hour", "minute", "second", "ms")
_DAY_MS = 86_400_000
_AMOUNTS_MS = (365 * _DAY_MS, 30 * _DAY_MS, _DAY_MS, 3_600_000, 60_000, 1000, 1)


def read_date(match: re.Match[bytes], zone: timezone) -> At | After:
    """The time of a match of DATE; `zone` is that of an absolute time without Z.

    Raise ValueError with what was expected: another letter than Z, a day or an hour that the
    calendar does not have (a leap second too), a time outside the years 1 to 9999.
    """
    fields = [int(match[name]) for name in _FIELDS]
    if match["zone"] not in (b"", b"Z", b"z"):
        raise ValueError(
            f"the letter Z (UTC) or no letter after the time: {match['zone'].decode()} is explained"
            " nowhere"
        )
    if match["sign"]:
        ms = sum(field * amount for field, amount in zip(fields, _AMOUNTS_MS, strict=True))
        if ms > MAX_AFTER_MS:
            raise ValueError("a relative time of less than 10000 years")
        return After(-ms if match["sign"] == b"-" else ms)
    year, month, day, hour, minute, second, ms = fields
    try:
        tzinfo = UTC if match["zone"] else zone
        moment = datetime(year, month, day, hour, minute, second, ms * 1000, tzinfo=tzinfo)
    except ValueError as error:
        raise ValueError(f"a time of the calendar ({error})") from error
    unix_ms = (moment - EPOCH) // MILLISECOND
    if not MIN_MS <= unix_ms <= MAX_MS:
        raise ValueError("a time in the years 1 to 9999 UTC")
    return At(unix_ms)


def print_date(time: At | After) -> str:
    """The token; absolute times in UTC with Z."""
    if isinstance(time, At):
        moment = EPOCH + timedelta(milliseconds=time.unix_ms)
        return _token("", moment.timetuple()[:6], moment.microsecond // 1000) + "Z"
    rest, fields = abs(time.ms), []
    for amount in _AMOUNTS_MS:
        field, rest = divmod(rest, amount)
        fields.append(field)
    return _token("-" if time.ms < 0 else "+", fields[:6], fields[6])


def _token(sign: str, to_second: tuple[int, ...] | list[int], ms: int) -> str:
    year, month, day, hour, minute, second = to_second
    return f"{sign}{year:04}{month:02}{day:02}T{hour:02}{minute:02}{second:02}{ms:03}"


# --- AclSyntaxError: where a text stops being an ACL message, what stands there, what would have
# been right


_SHOWN = 24
"""Characters of a wrong token in an error message. Estimate."""
_AROUND = 60
"""Characters of the excerpt on each side of the error. Estimate: fits a terminal."""
_WIDEST = 4
"""Bytes of the longest UTF-8 character."""
_TOKEN = re.compile(rb"[^\x00-\x20()]{1,200}")


class AclSyntaxError(MalformedError):
    """Text that is not an ACL message.

    `offset`: position of the error [bytes]; `line`, `column`: the same from 1 [characters].
    `found`, `expected`: in words. `excerpt`: the line around the error; `caret`: index of the error
    in the excerpt.
    """

    def __init__(self, field: str, data: bytes, offset: int, found: str, expected: str) -> None:
        self.offset = offset
        self.found = found
        self.expected = expected
        start = data.rfind(b"\n", 0, offset) + 1
        end = data.find(b"\n", offset)
        self.line = data.count(b"\n", 0, offset) + 1
        self.column = len(_text(data[start:offset])) + 1
        before = _text(data[max(start, offset - _AROUND * _WIDEST) : offset])[-_AROUND:]
        after = _text(data[offset : len(data) if end < 0 else end][: _AROUND * _WIDEST])[:_AROUND]
        self.excerpt = before + after
        self.caret = len(before)
        super().__init__(
            field, f"line {self.line}, column {self.column}: found {found}, expected {expected}"
        )


def shown(data: bytes) -> str:
    """The first token of `data`, shortened for an error message."""
    if not data:
        return "the end of the text"
    match = _TOKEN.match(data)
    token = _text(match[0] if match else data[:1])
    return repr(token if len(token) <= _SHOWN else token[:_SHOWN] + "...")


def _text(data: bytes) -> str:
    return data.decode(errors="replace")
