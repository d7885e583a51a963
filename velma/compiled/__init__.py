"""Parts of hot loops in C, for machines with a compiler: `python -m velma.compiled` builds them.

Without the library everything runs by the plain code, slower and with the same results, which tests
compare. Its file name carries a checksum of the sources and the architecture, so that no other
library is loaded. ROCO_PLAIN=1 leaves it out.
"""

import ctypes
import os
import platform
import zlib
from functools import cache
from pathlib import Path

FOLDER = Path(__file__).parent
SOURCES = tuple(sorted(FOLDER.glob("*.[ch]")))


def built() -> Path:
    """Return where the library of these sources is, or would be."""
    checksum = zlib.crc32(b"".join(source.read_bytes() for source in SOURCES))
    return FOLDER / f"velma-{checksum:08x}-{platform.machine()}.so"


@cache
def library() -> ctypes.CDLL | None:
    """Return the library; None if it was not built, does not load here, or ROCO_PLAIN is set."""
    if os.environ.get("ROCO_PLAIN"):
        return None
    try:
        return ctypes.CDLL(str(built()))
    except OSError:
        return None


def fields(*of_a_type: tuple[type, str]) -> tuple[tuple[str, type], ...]:
    """Return the fields of a ctypes.Structure by types and names, in the order of the C struct."""
    return tuple((name, kind) for kind, names in of_a_type for name in names.split())
