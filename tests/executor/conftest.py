"""Makes the double of a robot and what else several folders here need importable."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent))
