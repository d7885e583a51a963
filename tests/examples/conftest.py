"""Makes the example projects importable, as they are for their own tests."""

import sys
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"
sys.path[:0] = [
    str(Path(__file__).parent),
    *(str(folder) for folder in EXAMPLES.iterdir() if folder.is_dir()),
]
