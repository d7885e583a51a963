"""Parts of hot loops of the planner and the control loop in C: `python -m velma.compiled` builds
them (c_library).
"""

from functools import cache
from pathlib import Path

from c_library import CLibrary

LIBRARY = CLibrary("velma", Path(__file__).parent, ("-ffp-contract=off", "-lm"))
"""Without contraction a product and a sum are rounded as in numpy, so that the plain code can be
compared exactly.
"""
library = cache(LIBRARY.load)


def fields(*of_a_type: tuple[type, str]) -> tuple[tuple[str, type], ...]:
    """Return the fields of a ctypes.Structure by types and names, in the order of the C struct."""
    return tuple((name, kind) for kind, names in of_a_type for name in names.split())
