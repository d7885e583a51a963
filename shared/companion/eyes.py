"""The two ways in which the simulated robot sees. ex is told by the environment, as it is of speed and seed."""

from enum import StrEnum

VARIABLE = "ROCO_EYES"


class Eyes(StrEnum):
    """`RAYS`: true poses with noise, of things that rays from the camera hit. `PIXELS`: by markers in the head camera's
    rendered picture, which needs OpenGL."""

    RAYS = "rays"
    PIXELS = "pixels"


USUAL = Eyes.RAYS


def eyes(asked: str) -> Eyes:
    """Return the eyes of this name, "" for the usual ones. Raises ValueError with a sentence."""
    if asked and asked not in list(Eyes):
        raise ValueError(f"{VARIABLE}={asked}: there are eyes {', '.join(Eyes)}")
    return Eyes(asked) if asked else USUAL
