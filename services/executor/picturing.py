"""The child process that casts the head camera's pictures: a picture for each state it is given."""

import numpy as np

from agent_runtime.io.worker import Link
from companion.telemetry import picture
from services.executor.camera import HEIGHT, WIDTH, Camera
from services.executor.pictures import Show
from services.executor.setting import scene_of
from services.executor.words import Setup
from velma.sim.mujoco_backend import compiled


def serve(link: Link) -> None:
    """Until the agent is gone."""
    camera = Camera(compiled(scene_of(link.recv(Setup))))
    while True:
        show = link.recv(Show)
        pixels = camera.picture(np.frombuffer(show.world))
        link.send(picture(show.sim_time_s, WIDTH, HEIGHT, pixels.tobytes()))
