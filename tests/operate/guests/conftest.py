"""Makes the served guest importable for the tests beside it (tests have no packages)."""

import sys
from pathlib import Path

import pytest

pytest.importorskip("mcp", reason="needs mcp (PyPI: pip install mcp)")
sys.path.insert(0, str(Path(__file__).parent))
