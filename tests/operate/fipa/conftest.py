"""Makes the modules beside the tests importable, and JADE's printer (tests have no packages)."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "fipa_codec")]
