"""Lines of faults.jsonl: whole lines of bytes in, faults out, the last line of each id. Pure."""

from collections.abc import Iterable, Iterator

import msgspec

from fipa_codec.communicate import UNREADABLE
from operate.run_folder import Fault

_decoder = msgspec.json.Decoder(Fault)


def encoded(fault: Fault) -> bytes:
    """Return a fault as a line."""
    return msgspec.json.encode(fault) + b"\n"


def read(data: bytes) -> Iterator[Fault]:
    """Yield the faults of whole lines in their order; a line that is torn or of another version is left out."""
    for line in data[: data.rfind(b"\n") + 1].splitlines():
        try:
            yield _decoder.decode(line)
        except UNREADABLE:
            continue


def latest(faults: Iterable[Fault]) -> tuple[Fault, ...]:
    """Return each fault as its last line has it, in the order in which they were asked for."""
    return tuple({one.id: one for one in faults}.values())


def done(faults: Iterable[Fault]) -> tuple[Fault, ...]:
    """Return those that began, in the order of their beginnings."""
    return tuple(sorted((one for one in latest(faults) if one.began), key=lambda one: one.began))
