"""The child process by which ex sees: makes a picture of each state it gets, reads the markers in it.

The true state is used for the picture alone: poses are from the picture and the measured pose of the camera.
"""

import numpy as np
from numpy.typing import NDArray

from agent_runtime.io.worker import Link
from services.executor.looks import Saw, See, Thing, uncertainty
from velma.eyes import health
from velma.eyes.content import Content
from velma.eyes.fit import View
from velma.eyes.lens import lens
from velma.eyes.seeing import Seen, eyes_of
from velma.model.scene import Scene
from velma.sim.photographs import Photographs

Pixels = NDArray[np.uint8]


def serve(link: Link) -> None:
    """Look until the other side is gone. Raises GlError without OpenGL."""
    scene = link.recv(Scene)
    camera, sight = Photographs(scene), Sighted(scene)
    while True:
        see = link.recv(See)
        pixels = camera.take(np.frombuffer(see.world), see.number)
        view = View(lens(), np.array(see.rotation).reshape(3, 3), np.array(see.position))
        link.send(sight.saw(see.number, pixels, view))


class Sighted:
    """Reads pictures of a scene one after the other, and judges each by those before."""

    def __init__(self, scene: Scene) -> None:
        self._eyes, self._markers = eyes_of(scene), health.standing(scene)
        self._noise = scene.noise.pixel > 0.0
        self._judged = health.Judged()

    def saw(self, number: int, pixels: Pixels, view: View) -> Saw:
        """Return the things that a picture (height, width, 3) shows; none with a faulty camera or a neck far off.

        `number`: the camera's number of the picture; `view`: where it was taken, by the measured joints.
        """
        found = self._eyes.markers(pixels)
        bodies, now = self._eyes.bodies(found, view), health.Look(number, pixels, view)
        self._judged = told = health.judged(
            self._judged,
            now,
            self._markers,
            found,
            bodies,
            lambda other: self._eyes.bodies(self._eyes.markers(other), view),
            noise=self._noise,
        )
        if told.wrong or told.off > health.MOST_OFF:
            return Saw(number, (), told.wrong, told.off)
        return Saw(number, tuple(_thing(one, self._eyes.content(one, pixels, view)) for one in bodies), off=told.off)


def _thing(seen: Seen, content: Content | None) -> Thing:
    rotation, position = tuple(seen.rotation.ravel().tolist()), tuple(seen.position.tolist())
    mass, whole = content or (None, True)
    return Thing(seen.name, rotation, position, mass, whole, uncertainty(seen.covariance))
