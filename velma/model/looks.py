"""What Velma looks like: shapes for the eye only, in a group of their own, with no mass and no contact."""

from collections.abc import Mapping
from xml.etree import ElementTree as ET


def dress(elements: Mapping[str, ET.Element]) -> None:
    """Add the looks to the bodies `elements` (name -> element)."""
