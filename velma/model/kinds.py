"""Kinds of things: the models of objects.yaml that a thing of a scene can be."""

from collections.abc import Mapping
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Any


class Model(StrEnum):
    """Models of objects.yaml that a thing can be."""

    JAR = "jar"
    BOWL = "bowl"
    CABINET = "cabinet"
    CABINET_DOOR = "cabinet_door"
    TABLE = "table"
    TABLE_A = "table_a"
    TABLE_B = "table_b"
    BOX1 = "box1"
    BOX2 = "box2"
    BOX3 = "box3"
    LID = "jar_lid"
    DOOR_LEFT = "door_left"
    DOOR_RIGHT = "door_right"


BOXES = (Model.BOX1, Model.BOX2, Model.BOX3)
TABLES = (Model.TABLE, Model.TABLE_A, Model.TABLE_B)
DOORS = (Model.DOOR_LEFT, Model.DOOR_RIGHT)
CABINETS = (Model.CABINET, Model.CABINET_DOOR)
FURNITURE = (*CABINETS, *TABLES, *DOORS)
MOVEABLE = (Model.JAR, Model.BOWL, *BOXES, Model.LID)


# --- The numbers of objects.yaml: what things of a scene measure and weigh ------------------------


Numbers = Mapping[str, Any]


@cache
def objects() -> Numbers:
    """Return the numbers of objects.yaml."""
    import yaml  # only here: who draws things knows their kinds, and has no yaml

    numbers: Numbers = yaml.safe_load((Path(__file__).parent / "objects.yaml").read_text())
    return numbers
