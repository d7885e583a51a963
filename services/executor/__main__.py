"""ex as a process: `python -m services.executor --help`. The control loop is a process of its own beside it."""

import os
from pathlib import Path

from agent_runtime.io import cli, shell
from agent_runtime.io.devices import Post
from agent_runtime.io.options import Options
from companion.binding import wiring
from companion.design import AgentName
from companion.run_files import SLOTS_FILE
from services.executor.behaviours import agent
from services.executor.device import RobotDevice
from services.executor.local import Setup
from services.executor.loop_device import LoopDevice
from services.executor.pictures import Pictures
from services.executor.skill_device import SkillDevice
from services.executor.telemetry import Telemetry


def serve(options: Options) -> int:
    """Run until a signal; return the exit code. ROCO_SLOTS names the file between loop and agent (else: run folder)."""
    slots = Path(os.environ.get("ROCO_SLOTS") or options.run_dir / SLOTS_FILE)
    setup = Setup(scene=str(options.scene or ""), seed=options.seed)

    def device(post: Post) -> RobotDevice:
        telemetry = Telemetry(post, slots, Pictures(post, setup))
        return RobotDevice(SkillDevice(post, setup), LoopDevice(post, slots), telemetry)

    return shell.run(agent(), wiring(AgentName.EX, options.system), options, device)


if __name__ == "__main__":
    cli.run("executor", "ex: moves the robot and senses with it, one act at a time.", serve)
