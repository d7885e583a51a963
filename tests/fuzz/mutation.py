"""Inputs made from valid ones: changes of bytes, of text, and of the structure that a reader sees
behind its framing.

A change of bytes alone rarely comes past a length or a checksum. So a shape takes an input apart,
one part or one value in it is changed, and lengths and checksums are made right again.
"""

import json
import random
import re
import struct
import zlib
from collections.abc import Callable, Sequence
from typing import Any

import msgspec

LONGEST = 64 * 1024
"""Bytes of an input; estimate: longer ones show the same at a hundredth of the pace."""
ODD_BYTES = (
    b"\x00", b"\xff", b"\x7f", b"\x80", b"\xc0\x80", b"\xed\xa0\x80", b"\xc1", b"\xd9\xff",
    b"\xdd\xff\xff\xff\xff",
)  # fmt: skip
"""Ends of ranges, half a surrogate pair, heads of MessagePack that are not used or promise 4
GiB.
"""
ODD_NUMBERS = (
    0,
    1,
    -1,
    127,
    128,
    255,
    65535,
    2**31 - 1,
    2**31,
    2**32 - 1,
    2**63 - 1,
    2**63,
    2**64 - 1,
)
ODD_VALUES: tuple[Any, ...] = (
    *ODD_NUMBERS, -(2**63), float("nan"), float("inf"), float("-inf"), 1e308, -0.0, 5e-324,
    None, True, False, "", "\x00", "\U0010ffff", "x" * 300, "9" * 5000, "{0}", "../..", "\u2028",
    b"", b"\xff" * 9,
    [], {}, [[]], {"": None},
)  # fmt: skip
ODD_TEXTS = (
    "nan", "inf", "-inf", "1e999", "-0", "9" * 25, "9" * 5000, "0x", "1979-05-27T07:32:00Z",
    "\\ud800", "\\u0000",
    '"', "'", '"""', "(", ")", "[", "]", "{", "}", "[[", '#9"', ":", "\\", "\x00", "\u2028",
    "\u0130", "%s", "{}",
    "true", "null", "\r", "\n\n", "=", ".",
)  # fmt: skip
DEEP = (b"(", b"[", b"{", b'{"a":', b"\x91", b"\x81\xa1a", b"((", b"[[")

Bytes = Callable[[bytes, random.Random], bytes]


def flip(data: bytes, chance: random.Random) -> bytes:
    """Turn some bits over."""
    found = bytearray(data or b"\x00")
    for _ in range(chance.choice((1, 1, 2, 8))):
        found[chance.randrange(len(found))] ^= 1 << chance.randrange(8)
    return bytes(found)


def cut(data: bytes, chance: random.Random) -> bytes:
    """Cut off the end, or take a piece out."""
    begin, end = sorted(chance.randrange(len(data) + 1) for _ in range(2))
    return data[:begin] if chance.random() < 0.5 else data[:begin] + data[end:]


def repeat(data: bytes, chance: random.Random) -> bytes:
    """Have a piece several times."""
    begin, end = sorted(chance.randrange(len(data) + 1) for _ in range(2))
    piece = data[begin : min(end, begin + 200)]
    return data[:begin] + piece * chance.choice((2, 3, 50)) + data[begin:]


def insert(data: bytes, chance: random.Random) -> bytes:
    """Put odd bytes in, over what stands there or before it."""
    at, odd = chance.randrange(len(data) + 1), chance.choice(ODD_BYTES)
    return data[:at] + odd + data[at + chance.choice((0, len(odd))) :]


def number(data: bytes, chance: random.Random) -> bytes:
    """Put an odd number over what stands there, as a length would stand."""
    at, form = (
        chance.randrange(len(data) + 1),
        chance.choice(("<B", "<H", ">H", "<I", ">I", "<Q", ">Q")),
    )
    size = struct.calcsize(form)
    packed = struct.pack(form, chance.choice(ODD_NUMBERS) % (1 << 8 * size))
    return data[:at] + packed + data[at + size :]


def deep(data: bytes, chance: random.Random) -> bytes:
    """Nest deeply."""
    at = chance.randrange(len(data) + 1)
    return data[:at] + chance.choice(DEEP) * chance.choice((5, 200, 5000)) + data[at:]


def word(data: bytes, chance: random.Random) -> bytes:
    """Put an odd text in, in the place of a word or between."""
    words = list(re.finditer(rb"[\w.+-]+", data))
    odd = chance.choice(ODD_TEXTS).encode()
    if not words or chance.random() < 0.3:
        at = chance.randrange(len(data) + 1)
        return data[:at] + odd + data[at:]
    one = chance.choice(words)
    other = chance.choice((odd, chance.choice(words)[0]))
    return data[: one.start()] + other + data[one.end() :]


def line(data: bytes, chance: random.Random) -> bytes:
    """Leave a line out, have it twice, or elsewhere."""
    lines = data.split(b"\n")
    at = chance.randrange(len(lines))
    taken = lines[at]
    match chance.randrange(3):
        case 0:
            del lines[at]
        case 1:
            lines.insert(at, taken)
        case _:
            lines.insert(chance.randrange(len(lines)), lines.pop(at))
    return b"\n".join(lines)


BINARY: tuple[Bytes, ...] = (flip, cut, repeat, insert, number, deep)
TEXT: tuple[Bytes, ...] = (flip, cut, repeat, insert, deep, word, word, word, line, line)


def changed(value: Any, chance: random.Random) -> Any:
    """Return a value of JSON or MessagePack with one thing in it changed."""
    if isinstance(value, dict) and value and chance.random() < 0.8:
        key = chance.choice(list(value))
        match chance.randrange(8):
            case 0:
                return {name: one for name, one in value.items() if name != key}
            case 1:
                return value | {chance.choice(("", "x", "type", key)): chance.choice(ODD_VALUES)}
            case _:
                return value | {key: changed(value[key], chance)}
    if isinstance(value, list) and value and chance.random() < 0.8:
        at = chance.randrange(len(value))
        match chance.randrange(8):
            case 0:
                return value[:at] + value[at + 1 :]
            case 1:
                return value[:at] + value[at : at + 1] * chance.choice((2, 30)) + value[at:]
            case _:
                return [*value[:at], changed(value[at], chance), *value[at + 1 :]]
    if isinstance(value, bytes) and value and chance.random() < 0.7:
        return packed(value, chance)
    return chance.choice((*ODD_VALUES, nested(chance.choice((3, 40, 900)))))


def nested(depth: int) -> Any:
    """Return a list in a list in a list."""
    value: Any = 0
    for _ in range(depth):
        value = [value]
    return value


def packed(data: bytes, chance: random.Random) -> bytes:
    """Change a value in MessagePack; bytes where it is none."""
    try:
        return msgspec.msgpack.encode(changed(msgspec.msgpack.decode(data, strict=False), chance))
    except (msgspec.MsgspecError, UnicodeError, RecursionError, TypeError, OverflowError):
        return chance.choice(BINARY)(data, chance)


def content(data: bytes, chance: random.Random) -> bytes:
    """Change the content of a communicate; its envelope stays as it is."""
    try:
        one = msgspec.msgpack.decode(data)
        return msgspec.msgpack.encode(one | {"Z": changed(one["Z"], chance)})
    except (msgspec.MsgspecError, UnicodeError, RecursionError, TypeError, KeyError, OverflowError):
        return packed(data, chance)


def behind(head_bytes: int, change: Bytes) -> Bytes:
    """Return a change of what stands behind a head; the head is another one now and then."""

    def made(data: bytes, chance: random.Random) -> bytes:
        head = chance.randbytes(head_bytes) if chance.random() < 0.1 else data[:head_bytes]
        return head + change(data[head_bytes:], chance)

    return made


def jsoned(data: bytes, chance: random.Random) -> bytes:
    """Change a value in JSON, with NaN where it has none; text where it is none."""
    try:
        return json.dumps(changed(json.loads(data), chance), default=str).encode(
            errors="surrogatepass"
        )
    except (ValueError, RecursionError):
        return chance.choice(TEXT)(data, chance)


# --- framings -------------------------------------------------------------------------------------


class Frames(msgspec.Struct, frozen=True):
    """A framing: `split` gives head and records, `join` puts them together with right lengths and
    checksums.
    """

    split: Callable[[bytes], tuple[bytes, list[bytes]]]
    join: Callable[[bytes, list[bytes]], bytes]
    inner: Bytes = packed

    def change(self, data: bytes, chance: random.Random) -> bytes:
        """Change one record, leave one out, have one twice, or elsewhere."""
        head, records = self.split(data)
        if not records:
            return chance.choice(BINARY)(data, chance)
        at = chance.randrange(len(records))
        match chance.randrange(8):
            case 0:
                del records[at]
            case 1:
                records.insert(chance.randrange(len(records)), records[at])
            case 2:
                records[at] = chance.choice(BINARY)(records[at], chance)
            case _:
                records[at] = self.inner(records[at], chance)
        return self.join(head, records)


def lengths(head_bytes: int, form: str, *first: bytes, checked: bool = False) -> Frames:
    """Return the framing by a length (and a CRC-32) before each record, behind that many bytes of
    head.

    `first`: what the frame of each record begins with.
    """
    head = struct.Struct(form)

    def split(data: bytes) -> tuple[bytes, list[bytes]]:
        found, at = [], head_bytes
        while at + head.size <= len(data):
            length = head.unpack_from(data, at)[len(first)]
            found.append(data[at + head.size : at + head.size + length])
            at += head.size + length
        return data[:head_bytes], found

    def join(begin: bytes, records: list[bytes]) -> bytes:
        sums = ((zlib.crc32(one),) if checked else () for one in records)
        return begin + b"".join(
            head.pack(*first, len(one), *last) + one
            for one, last in zip(records, sums, strict=True)
        )

    return Frames(split, join)


MCAP_MAGIC = b"\x89MCAP0\r\n"
MESSAGE, MESSAGE_HEAD = 5, 22
"""Opcode of a message, and its bytes before the data (MCAP 1.0)."""


def _mcap_split(data: bytes) -> tuple[bytes, list[bytes]]:
    found, at = [], len(MCAP_MAGIC)
    while at + 9 <= len(data):
        length = struct.unpack_from("<Q", data, at + 1)[0]
        found.append(data[at : at + 1] + data[at + 9 : at + 9 + length])
        at += 9 + length
    return data[: len(MCAP_MAGIC)], found


def _mcap_join(head: bytes, records: list[bytes]) -> bytes:
    return head + b"".join(
        one[:1] + struct.pack("<Q", max(0, len(one) - 1)) + one[1:] for one in records
    )


def _mcap_record(data: bytes, chance: random.Random) -> bytes:
    at = 1 + MESSAGE_HEAD
    if data[:1] == bytes([MESSAGE]) and chance.random() < 0.8:
        return data[:at] + jsoned(data[at:], chance)
    return chance.choice(BINARY)(data, chance)


MCAP = Frames(_mcap_split, _mcap_join, _mcap_record)


# --- all together ---------------------------------------------------------------------------------


def mutated(seeds: Sequence[bytes], changes: Sequence[Bytes], chance: random.Random) -> bytes:
    """Return an input made of these valid ones by one or several of these changes, or of the halves
    of two.
    """
    data = chance.choice(seeds)
    if chance.random() < 0.1:
        other = chance.choice(seeds)
        data = data[: chance.randrange(len(data) + 1)] + other[chance.randrange(len(other) + 1) :]
    for _ in range(chance.choice((1, 1, 1, 2, 4))):
        data = chance.choice(changes)(data, chance)[:LONGEST]
    return data
