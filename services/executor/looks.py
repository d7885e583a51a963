"""Messages between eyes by pixels and their child process. Light to import: the child needs nothing else of ex."""

import msgspec


class See(msgspec.Struct, frozen=True, tag=True):
    """To the child: look at this state (float64 bytes), as look `number`, with the camera thought to be there."""

    number: int
    world: bytes
    rotation: tuple[float, ...]
    position: tuple[float, ...]


class Thing(msgspec.Struct, frozen=True):
    """A thing that was seen: rotation (9 numbers, row by row) and position in the world [m].

    `content`: mass of what is seen in it [kg]; None for a thing that cannot be looked into from there.
    """

    name: str
    rotation: tuple[float, ...]
    position: tuple[float, ...]
    content: float | None = None


class Saw(msgspec.Struct, frozen=True, tag=True):
    """From the child: what look `number` showed."""

    number: int
    things: tuple[Thing, ...]
