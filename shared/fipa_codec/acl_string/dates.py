"""Date and time tokens (SC00070I, 2.3): [+-]YYYYMMDDThhmmssmmm[letter]. Milliseconds are mandatory.

The grammar takes any letter as type designator, the text explains only Z: UTC. Without one it is local time. With + or
- the time is relative to the receipt; its fields are amounts, a year of 365 days and a month of 30, as in JADE, and the
letter means nothing (docs/rulings.md).
"""

import re
from datetime import UTC, datetime, timedelta, timezone

from fipa_codec.acl_string.message import EPOCH, MAX_AFTER_MS, MAX_MS, MILLISECOND, MIN_MS, After, At

DATE = re.compile(
    rb"(?P<sign>[+-]?)(?P<year>\d{4})(?P<month>\d\d)(?P<day>\d\d)[Tt]"
    rb"(?P<hour>\d\d)(?P<minute>\d\d)(?P<second>\d\d)(?P<ms>\d{3})(?P<zone>[A-Za-z]?)"
)
WRITTEN = "a time YYYYMMDDThhmmssmmmZ with three digits of milliseconds, or + or - and an amount of the same form"

_FIELDS = ("year", "month", "day", "hour", "minute", "second", "ms")
_DAY_MS = 86_400_000
_AMOUNTS_MS = (365 * _DAY_MS, 30 * _DAY_MS, _DAY_MS, 3_600_000, 60_000, 1000, 1)


def read_date(match: re.Match[bytes], zone: timezone) -> At | After:
    """Return the time of a match of DATE; `zone` is that of an absolute time without Z.

    Raise ValueError with what was expected: another letter than Z, a day or an hour that the calendar does not have (a
    leap second too), a time outside the years 1 to 9999.
    """
    fields = [int(match[name]) for name in _FIELDS]
    if match["zone"] not in (b"", b"Z", b"z"):
        raise ValueError(
            f"the letter Z (UTC) or no letter after the time: {match['zone'].decode()} is explained nowhere"
        )
    if match["sign"]:
        ms = sum(field * amount for field, amount in zip(fields, _AMOUNTS_MS, strict=True))
        if ms > MAX_AFTER_MS:
            raise ValueError("a relative time of less than 10000 years")
        return After(-ms if match["sign"] == b"-" else ms)
    year, month, day, hour, minute, second, ms = fields
    try:
        moment = datetime(year, month, day, hour, minute, second, ms * 1000, tzinfo=UTC if match["zone"] else zone)
    except ValueError as error:
        raise ValueError(f"a time of the calendar ({error})") from error
    unix_ms = (moment - EPOCH) // MILLISECOND
    if not MIN_MS <= unix_ms <= MAX_MS:
        raise ValueError("a time in the years 1 to 9999 UTC")
    return At(unix_ms)


def print_date(time: At | After) -> str:
    """Return the token; absolute times in UTC with Z."""
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
