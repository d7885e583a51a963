"""The child process by which ex sees: makes a picture of each state it gets, reads the markers in it.

The true state is used for the picture alone: poses are from the picture and the measured pose of the camera.
"""

import numpy as np

from agent_runtime.io.worker import Link
from services.executor.looks import Saw, See, Thing, uncertainty
from velma.eyes.content import Content
from velma.eyes.fit import View
from velma.eyes.lens import lens
from velma.eyes.seeing import Seen, eyes_of
from velma.model.scene import Scene
from velma.sim.photographs import Photographs


def serve(link: Link) -> None:
    """Look until the other side is gone. Raises GlError without OpenGL."""
    scene = link.recv(Scene)
    camera, eyes = Photographs(scene), eyes_of(scene)
    while True:
        see = link.recv(See)
        pixels = camera.take(np.frombuffer(see.world), see.number)
        view = View(lens(), np.array(see.rotation).reshape(3, 3), np.array(see.position))
        bodies = eyes.bodies(eyes.markers(pixels), view)
        link.send(Saw(see.number, tuple(_thing(one, eyes.content(one, pixels, view)) for one in bodies)))


def _thing(seen: Seen, content: Content | None) -> Thing:
    rotation, position = tuple(seen.rotation.ravel().tolist()), tuple(seen.position.tolist())
    mass, whole = content or (None, True)
    return Thing(seen.name, rotation, position, mass, whole, uncertainty(seen.covariance))
