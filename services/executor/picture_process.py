"""The child process that makes pictures for people: of each state it gets, from the room and by the head camera."""

import sys

import numpy as np

from agent_runtime.io.worker import Link
from companion.telemetry import RoomPicture, picture
from services.executor.local import Setup
from services.executor.pictures import NO_GL, SHRINK, Show
from services.executor.simulation import scene_of
from velma.errors import GlError
from velma.eyes.lens import HEIGHT, WIDTH
from velma.eyes.shown import jpeg, smaller
from velma.sim.head_camera import HeadCamera
from velma.sim.mujoco_backend import compiled


def serve(link: Link) -> None:
    """Make pictures until the agent is gone; ends with NO_GL where there is no OpenGL."""
    try:
        camera = HeadCamera(compiled(scene_of(link.recv(Setup))), WIDTH, HEIGHT)
    except GlError as error:
        sys.stderr.write(f"no pictures of the head camera: {error}\n")
        sys.exit(NO_GL)
    while True:
        show = link.recv(Show)
        pixels = smaller(camera.picture(np.frombuffer(show.world)), SHRINK)
        link.send(RoomPicture(show.sim_time_s, jpeg(camera.room())))
        link.send(picture(show.sim_time_s, pixels.shape[1], pixels.shape[0], pixels.tobytes()))
