"""The child process that makes the pictures of the head camera: one for each state it gets."""

import numpy as np

from agent_runtime.io.worker import Link
from companion.telemetry import picture
from services.executor.camera import HEIGHT, WIDTH, Camera
from services.executor.local import Setup
from services.executor.pictures import Show
from services.executor.simulation import scene_of
from velma.sim.mujoco_backend import compiled


def serve(link: Link) -> None:
    """Make pictures until the agent is gone."""
    camera = Camera(compiled(scene_of(link.recv(Setup))))
    while True:
        show = link.recv(Show)
        pixels = camera.picture(np.frombuffer(show.world))
        link.send(picture(show.sim_time_s, WIDTH, HEIGHT, pixels.tobytes()))
