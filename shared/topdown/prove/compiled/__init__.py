"""The explorer's loop in C: `python -m topdown.prove.compiled` builds it (c_library)."""

from functools import cache
from pathlib import Path

from c_library import CLibrary

LIBRARY = CLibrary("explore", Path(__file__).parent)
library = cache(LIBRARY.load)
