"""Colours of channels and states, readable on light and on dark: the viewer's theme is the
user's.
"""

Colour = tuple[int, int, int]

GREY: Colour = (120, 130, 145)
FRESH: Colour = (38, 150, 180)
RED: Colour = (205, 60, 60)
ORANGE: Colour = (222, 140, 30)
INK: Colour = (12, 8, 28)
"""Of labels on a light ground: the viewer writes them on grey in its dark theme, on white in its
light one.
"""
GHOST: Colour = (150, 80, 220)
"""Of what somebody believes and is not so."""
PLANNED: Colour = (60, 120, 230)
"""Of what is planned and is not yet so."""
CHANNELS: tuple[Colour, ...] = (
    (60, 115, 230),
    (215, 85, 180),
    (140, 165, 20),
    (20, 175, 180),
    (165, 125, 240),
    (60, 165, 85),
)
"""Of C1, C2 and so on; C7 looks like C1. None looks like GREY, ORANGE or RED: levels of a log."""
SIDES: dict[str, Colour] = {"right": (214, 93, 130), "left": (38, 150, 180)}
AXES: tuple[Colour, ...] = ((220, 60, 60), (60, 170, 70), (60, 100, 220))
"""x, y, z of a frame."""


def channel(name: str) -> Colour:
    """A channel's colour, by its number; grey for a name without one."""
    digits = name.lstrip("C")
    return CHANNELS[(int(digits) - 1) % len(CHANNELS)] if digits.isdecimal() else GREY


def between(a: Colour, b: Colour, share: float) -> Colour:
    """The colour `share` (0 to 1) of the way from `a` to `b`."""
    r, g, b_ = (round(x + share * (y - x)) for x, y in zip(a, b, strict=True))
    return r, g, b_
