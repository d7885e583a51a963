"""The child process that renders: looks for the robot, and pictures for people, by the same camera
and detector.

A look comes before a picture: a picture is made in parts, and what is asked for meanwhile is seen
first. So is a frame, which has one part. Poses are from the picture and the measured pose of the
camera; the true state is used for the picture alone.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from agent_runtime.io.worker import Link
from companion.telemetry import Camera, Found, Picture
from services.executor.renderer import SHRINK, Drawn, Saw, See, Show, SightedObject, uncertainty
from velma.eyes import health
from velma.eyes.content import Content
from velma.eyes.fit import View
from velma.eyes.lens import LENS
from velma.eyes.pictures import jpeg, smaller
from velma.eyes.seeing import Eyes, Seen, eyes_of
from velma.model.scene import Scene
from velma.names import Array
from velma.sim.disturbed_world import SpoiledPictures
from velma.sim.photographs import FRAME_HEIGHT, FRAME_WIDTH, Photographs

Pixels = NDArray[np.uint8]


def serve(link: Link) -> None:
    """Look and make pictures until the other side is gone. Raises GlError without OpenGL."""
    renderer = Renderer(link.recv(Scene), link)
    while True:
        renderer.take(link.recv(See | Show))


class Renderer:
    """A camera in a copy of the world of a scene, for both."""

    def __init__(self, scene: Scene, link: Link) -> None:
        self._scene, self._link = scene, link
        self._camera, self._eyes = Photographs(scene), eyes_of(scene)
        self._sight = Sighted(scene)
        self._shown, self._spoiled = 0, SpoiledPictures()

    def take(self, word: See | Show) -> None:
        """Do what is asked for; a picture only as long as no look and no frame is."""
        if isinstance(word, See):
            self._look(word)
        else:
            self._show(word)

    def _look(self, see: See) -> None:
        if see.number == 1:  # by a new skill process, which has no look before
            self._sight = Sighted(self._scene)
        pixels = self._camera.take(np.frombuffer(see.world), see.number)
        view = View(LENS, np.array(see.rotation).reshape(3, 3), np.array(see.position))
        self._link.send(self._sight.saw(see.number, pixels, view))

    def _show(self, show: Show) -> None:
        world = np.frombuffer(show.world)
        if show.camera is not None:
            self._link.send(Drawn(jpeg(self._full(show.camera, world))))
            return
        self._shown += 1
        clean, taken = self._camera.both(world, self._shown, self._spoiled)
        self._others_first()
        room = self._camera.room(world)
        self._others_first()
        found = scaled(self._eyes, self._eyes.markers(taken))
        self._others_first()
        self._link.send(Picture(show.sim_time_s, jpeg(smaller(clean, SHRINK)), jpeg(room), found))

    def _full(self, camera: Camera, world: Array) -> Pixels:
        draw = self._camera.room if camera is Camera.ROOM else self._camera.head
        return draw(world, FRAME_WIDTH, FRAME_HEIGHT)

    def _others_first(self) -> None:
        while self._link.waiting():
            self.take(self._link.recv(See | Show))


class Sighted:
    """Reads pictures of a scene one after the other, and judges each by those before."""

    def __init__(self, scene: Scene) -> None:
        self._eyes, self._markers = eyes_of(scene), health.standing(scene)
        self._noise = scene.noise.pixel > 0.0
        self._judged = health.Judged()

    def saw(self, number: int, pixels: Pixels, view: View) -> Saw:
        """Return the things that a picture (height, width, 3) shows; none with a faulty camera or a
        neck far off.

        `number`: the camera's number of the picture; `view`: where it was taken, by the measured
        joints.
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
        contents = (self._eyes.content(one, pixels, view) for one in bodies)
        return Saw(number, tuple(map(_sighted, bodies, contents)), off=told.off)


def _sighted(seen: Seen, content: Content | None) -> SightedObject:
    rotation, position = tuple(seen.rotation.ravel().tolist()), tuple(seen.position.tolist())
    mass, whole = content or (None, True)
    return SightedObject(seen.name, rotation, position, mass, whole, uncertainty(seen.covariance))


def scaled(eyes: Eyes, markers: Mapping[int, Array]) -> tuple[Found, ...]:
    """Return markers with corners (4, 2) in the robot's picture, for the smaller one of people."""
    at = {n: ((corners.ravel() + 0.5) / SHRINK).round(2).tolist() for n, corners in markers.items()}
    return tuple(Found(eyes.owner(number), number, tuple(where)) for number, where in at.items())
