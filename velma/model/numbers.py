"""The numbers of objects.yaml: what things of a scene measure and weigh."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import yaml

Numbers = Mapping[str, Any]


@cache
def objects() -> Numbers:
    """Return the numbers of objects.yaml."""
    numbers: Numbers = yaml.safe_load((Path(__file__).parent / "objects.yaml").read_text())
    return numbers
