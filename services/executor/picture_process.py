"""The child process that makes pictures for people of each state it gets.

From the room, and by the head camera with what the eyes by pixels would find in it, also where the robot sees by rays:
the same camera and detector.
"""

from collections.abc import Mapping

import numpy as np

from agent_runtime.io.worker import Link
from companion.telemetry import Found, Picture
from services.executor.local import Array, Setup
from services.executor.pictures import SHRINK, Show
from services.executor.world import scene_of
from velma.eyes.seeing import Eyes, eyes_of
from velma.eyes.shown import jpeg, smaller
from velma.sim.photographs import Photographs


def serve(link: Link) -> None:
    """Make pictures until the agent is gone. Raises GlError without OpenGL."""
    scene = scene_of(link.recv(Setup))
    camera, eyes, number = Photographs(scene), eyes_of(scene), 0
    while True:
        show, number = link.recv(Show), number + 1
        clean, taken = camera.both(np.frombuffer(show.world), number)
        found = told(eyes, eyes.markers(taken))
        link.send(Picture(show.sim_time_s, jpeg(smaller(clean, SHRINK)), jpeg(camera.room()), found))


def told(eyes: Eyes, markers: Mapping[int, Array]) -> tuple[Found, ...]:
    """Return markers with corners (4, 2) in the robot's picture, for the smaller one of people."""
    return tuple(
        Found(eyes.owner(number), number, tuple(((corners.ravel() + 0.5) / SHRINK).round(2).tolist()))
        for number, corners in markers.items()
    )
