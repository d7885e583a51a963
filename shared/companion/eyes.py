"""The two ways in which the simulated robot sees. ex is told by the environment, as it is of speed
and seed.
"""

from collections.abc import Callable
from enum import StrEnum

VARIABLE = "ROCO_EYES"


class Eyes(StrEnum):
    """`PIXELS`: by markers in the head camera's rendered picture, which needs OpenGL. `RAYS`: true
    poses with noise, of things that rays from the camera hit; content is not seen.
    """

    RAYS = "rays"
    PIXELS = "pixels"


def eyes(asked: str, lost: Callable[[], str]) -> tuple[Eyes, str]:
    """The eyes of this name, for "" pixels where they can be had; and why not, where they are rays
    for that.

    `lost` tells why nothing can be drawn, "" where something can. Raise ValueError where pixels
    were asked for that cannot be had, and for another name.
    """
    if asked and asked not in list(Eyes):
        raise ValueError(f"{VARIABLE}={asked}: there are eyes {', '.join(Eyes)}")
    if asked == Eyes.RAYS:
        return Eyes.RAYS, ""
    why = lost()
    if asked and why:
        raise ValueError(why)
    return (Eyes.RAYS if why else Eyes.PIXELS), why
