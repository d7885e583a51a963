"""Colours of channels and states, readable on light and on dark: the viewer's theme is the user's."""

Colour = tuple[int, int, int]

GREY: Colour = (120, 130, 145)
FRESH: Colour = (38, 150, 180)
RED: Colour = (205, 60, 60)
ORANGE: Colour = (222, 140, 30)
CHANNELS: tuple[Colour, ...] = (
    (230, 159, 0),
    (214, 93, 130),
    (150, 120, 220),
    (38, 150, 180),
    (136, 148, 165),
    (76, 168, 92),
)
"""Of C1, C2 and so on; C7 looks like C1."""
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
