"""Readings of the simulated robot's joints, wrists, fingers and camera, spoiled as disturbances.py
says.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from velma.names import BODY, HEAD, SIDES
from velma.sim.backend import Array, State
from velma.sim.disturbances import Disturbance, Kind, Of

Pixels = NDArray[np.uint8]
Spoil = Callable[[State], None]


class SpoiledReadings:
    """What goes on in the readings of a robot. A reading that is stuck stays as it was first read
    then.
    """

    def __init__(self) -> None:
        self._going_on: dict[Disturbance, list[Array]] = {}

    def set(self, going_on: Sequence[Disturbance]) -> None:
        """Take what goes on now in place of what did."""
        spoiling = [one for one in going_on if one.of in _READINGS]
        self._going_on = {one: self._going_on.get(one, []) for one in spoiling}

    def spoil(self, state: State) -> None:
        """Spoil the arrays of a state in place; they are overwritten by the next readings."""
        for one, first in self._going_on.items():
            readings = list(_READINGS[one.of](state, one.on))
            if not first:
                first += [array[part].copy() for array, part in readings]
            for (array, part), before in zip(readings, first, strict=True):
                array[part] = _spoiled(array[part], before, one)
            if one.kind is Kind.STUCK and one.on in BODY:
                state.v[BODY.index(one.on)] = 0.0  # a drive computes it from two positions


def _spoiled(reading: Array, first: Array, one: Disturbance) -> Array | float:
    match one.kind:
        case Kind.ZERO:
            return 0.0
        case Kind.NAN:
            return np.nan
        case Kind.STUCK:
            return first
        case _:
            return reading + one.size[0] * (_AXES if one.of is Of.WRIST else 1.0)


# of a wrist: torques at a lever of 0.05 m, as of Noise (velma.model.scene)
_AXES = np.array([1.0] * 3 + [0.05] * 3)
_Part = tuple[Array, tuple[slice, ...]]


def _rows(on: str) -> slice:
    return slice(SIDES.index(on), SIDES.index(on) + 1) if on else slice(None)


def _wrist(state: State, on: str) -> Iterator[_Part]:
    if state.wrist is not None:
        yield state.wrist, (_rows(on),)


def _grip(state: State, on: str) -> Iterator[_Part]:
    yield state.proximal, (_rows(on),)
    yield state.distal, (_rows(on),)


def _encoder(state: State, on: str) -> Iterator[_Part]:
    array, names = (state.head, HEAD) if on in HEAD else (state.q, BODY)
    yield array, (slice(names.index(on), names.index(on) + 1),)


_READINGS: dict[Of, Callable[[State, str], Iterator[_Part]]] = {
    Of.WRIST: _wrist, Of.GRIP: _grip, Of.ENCODER: _encoder
}  # fmt: skip


class SpoiledPictures:
    """What goes on in the pictures of a camera. A frozen camera gives the picture before, else its
    first one.
    """

    def __init__(self) -> None:
        self._last: Pixels | None = None

    def light(self, pixels: Pixels, going_on: Sequence[Disturbance]) -> Pixels:
        """Return the picture in the light that there is, before the camera's noise."""
        share = min((one.size[0] for one in going_on if one.kind is Kind.DIMMED), default=1.0)
        return pixels if share == 1.0 else np.asarray(np.rint(share * pixels), np.uint8)

    def taken(self, pixels: Pixels, going_on: Sequence[Disturbance]) -> Pixels:
        """Return what the camera gives for the picture that it took."""
        kinds = {one.kind for one in going_on if one.of is Of.CAMERA}
        if Kind.FROZEN in kinds and self._last is not None:
            return self._last
        if Kind.BLACK in kinds:
            pixels = np.zeros_like(pixels)
        elif Kind.MIRRORED in kinds:
            pixels = np.ascontiguousarray(pixels[:, ::-1])
        self._last = pixels
        return pixels
