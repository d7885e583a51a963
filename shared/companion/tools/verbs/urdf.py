"""`roco urdf`: the robot in a form that other tools load."""

from pathlib import Path
from typing import Annotated

import msgspec

from console.errors import needing
from console.output import Form, Format, argument, tell


class Model(msgspec.Struct, frozen=True):
    """The file that was written, and how many links and turning joints are in it."""

    file: str
    links: int
    joints: int


def urdf(
    file: Annotated[Path, argument("The file to write, such as velma.urdf.")],
    form: Form = Format.TEXT,
) -> None:
    """Write the robot's model as URDF, for other tools.

    RViz, Foxglove, Rerun, MuJoCo, Pinocchio and MoveIt load it (docs/ros.md).

    Examples:
      roco urdf velma.urdf
      roco urdf velma.urdf --format json
    """
    with needing("recorder"):
        from velma.model import tree, urdf
    file.write_text(urdf.written(), encoding="utf-8")
    links = tree.links()
    told = Model(str(file), len(links), sum(bool(link.joint) for link in links))
    tell(told, form, f"{told.file}: {told.links} links, {told.joints} joints")
