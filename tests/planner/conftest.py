"""Makes the pretended partners of tests/fleet and the stepped core importable (tests have no
packages).
"""

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1] / folder) for folder in ("fleet", "agent_runtime")]
