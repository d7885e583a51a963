"""Content on its way from a held thing into another one, as ex remembers it from act to act."""

import msgspec


class Unfinished(msgspec.Struct, frozen=True):
    """A move of content that was begun: into which thing, and what the hand felt of the source [kg].

    `full`: the mass before the move, with what had left in earlier ones; None: it was not felt. `left`: the mass that
    left in all of them, None while the last one has not been weighed. `had`: the mass seen in the destination before.
    """

    destination: str
    full: float | None
    left: float | None = None
    had: float = 0.0
