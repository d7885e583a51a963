"""ex as a process: `python -m services.executor --help`. The control loop is a process of its own
beside it.
"""

import os
import sys
from pathlib import Path

from agent_runtime.io import cli, shell
from agent_runtime.io.devices import Post
from agent_runtime.io.options import USAGE_ERROR, Options
from companion.design import AgentName, wiring
from companion.eyes import VARIABLE, eyes
from companion.run_files import SLOTS_FILE
from services.executor.behaviours import agent
from services.executor.device_messages import Setup
from services.executor.devices import LoopDevice, RobotDevice, SkillDevice
from services.executor.telemetry import Pictures, Telemetry
from velma.sim import gl


def serve(options: Options) -> int:
    """Run until a signal; return the exit code. ROCO_SLOTS names the file between loop and agent
    (else: run folder), ROCO_EYES the eyes.
    """
    slots = Path(os.environ.get("ROCO_SLOTS") or options.run_dir / SLOTS_FILE)
    asked = os.environ.get(VARIABLE, "")
    try:
        # It takes half a second to find out whether something can be drawn. Where nobody asked for
        # pixels by name, the first look finds out: without OpenGL it falls back to rays, as where
        # OpenGL is lost later.
        seeing, _ = eyes(asked, gl.lost if asked else lambda: "")
    except ValueError as error:
        sys.stderr.write(f"executor: {error}\n")
        return USAGE_ERROR
    setup = Setup(scene=str(options.scene or ""), seed=options.seed, eyes=seeing)

    def device(post: Post) -> RobotDevice:
        pictures = Pictures(post, setup)
        skills = SkillDevice(post, setup, pictures.renderer)
        return RobotDevice(skills, LoopDevice(post, slots), Telemetry(post, slots, pictures))

    return shell.run(agent(), wiring(AgentName.EX, options.system), options, device)


if __name__ == "__main__":
    cli.run("executor", "ex: moves the robot and senses with it, one act at a time.", serve)
