"""The two ways in which the simulated robot sees. ex is told by the environment, as it is of speed and seed."""

from collections.abc import Callable
from enum import StrEnum

VARIABLE = "ROCO_EYES"


class Eyes(StrEnum):
    """`PIXELS`: by markers in the head camera's rendered picture, which needs OpenGL. `RAYS`: true poses with noise, of
    things that rays from the camera hit; content is not seen."""

    RAYS = "rays"
    PIXELS = "pixels"


def eyes(asked: str, opengl: Callable[[], object]) -> Eyes:
    """Return the eyes of this name; for "" pixels where `opengl` returns true, else rays. Raise ValueError for another.

    Eyes that were asked for are returned whether OpenGL is there or not.
    """
    if asked and asked not in list(Eyes):
        raise ValueError(f"{VARIABLE}={asked}: there are eyes {', '.join(Eyes)}")
    if asked:
        return Eyes(asked)
    return Eyes.PIXELS if opengl() else Eyes.RAYS
