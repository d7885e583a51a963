"""Folders of the images in which the keeper of the keys writes (deploy/Dockerfile); a volume is
mounted at each.
"""

from pathlib import Path

from agent_runtime.io.issuing import seats
from companion.design import DESIGN

ONE, TWO = ("roco",), ("velma1", "velma2")
"""Systems of deploy/compose.yaml, and of compose.two.yaml beside it."""
ALL = (seats(Path("/keys"), DESIGN, systems, apart=True) for systems in (ONE, TWO))
FOLDERS = sorted({str(seat.folder) for some in ALL for seat in some})
