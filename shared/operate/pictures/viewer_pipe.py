"""The pipe from the monitor to the process that draws: frames of four bytes of length and msgpack,
an Item each.
"""

import msgspec

from agent_runtime.io.tap import Sample
from operate.verdict_lines import Judged

LENGTH = 4
LONGEST = 64 * 1024 * 1024
"""Bytes of a frame; a longer one is damage (the longest communicate has 4 MiB)."""


class Heard(msgspec.Struct, frozen=True, tag="s"):
    """A sample of the tap."""

    sample: Sample


class ShownVerdict(msgspec.Struct, frozen=True, tag="v"):
    """A verdict."""

    judged: Judged


class Missed(msgspec.Struct, frozen=True, tag="m"):
    """So many samples were dropped so far, since drawing was too slow; `at`: when that was noticed
    [unix s].
    """

    at: float
    samples: int


class Since(msgspec.Struct, frozen=True, tag="b"):
    """The first item: what was heard before `at` [unix s] is in the recording only."""

    at: float


Item = Heard | ShownVerdict | Missed | Since
encode = msgspec.msgpack.Encoder().encode
_decode = msgspec.msgpack.Decoder(Item).decode


def framed(data: bytes) -> bytes:
    """An encoded item as it goes through the pipe."""
    return len(data).to_bytes(LENGTH, "big") + data


class Frames:
    """Takes bytes as they come, gives the items that are whole."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def feed(self, data: bytes) -> list[Item]:
        """The items that these bytes complete. Raises ValueError where they are something else than
        frames.
        """
        self._rest += data
        items, at = [], 0
        while len(self._rest) - at >= LENGTH:
            length = int.from_bytes(self._rest[at : at + LENGTH], "big")
            if length > LONGEST:
                raise ValueError(
                    f"a frame of {length} bytes, at most {LONGEST}: this is not a pipe of the"
                    " monitor"
                )
            if len(self._rest) - at - LENGTH < length:
                break
            items.append(_decode(bytes(self._rest[at + LENGTH : at + LENGTH + length])))
            at += LENGTH + length
        del self._rest[:at]
        return items
