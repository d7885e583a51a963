"""ex's agent as a process: `python -m services.executor --help`. The loop is a process of its own beside it."""

import os
from pathlib import Path

from agent_runtime.io import cli, shell
from agent_runtime.io.devices import Post
from agent_runtime.io.options import Options
from companion.binding import wiring
from companion.run_files import SLOTS_FILE
from services.executor import behaviours
from services.executor.body import Body
from services.executor.pictures import Pictures
from services.executor.reaching import SlotLoop
from services.executor.skilled import Skilled
from services.executor.telling import Telling
from services.executor.words import Setup


def serve(options: Options) -> int:
    """Until a signal comes. ROCO_SLOTS names the file in which loop and agent meet (default: in the run folder)."""
    slots = Path(os.environ.get("ROCO_SLOTS") or options.run_dir / SLOTS_FILE)
    setup = Setup(scene=str(options.scene or ""), seed=options.seed)

    def body(post: Post) -> Body:
        return Body(Skilled(post, setup), SlotLoop(post, slots), Telling(post, slots, Pictures(post, setup)))

    return shell.run(behaviours.agent(), wiring("ex", options.system), options, body)


if __name__ == "__main__":
    cli.run("executor", "a_ex: moves the robot and senses with it, one act at a time.", serve)
