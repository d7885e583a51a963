"""An agent of the stories, the crowd or the brokers as a process: `python story_process.py <agent> <connect> <run>`."""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "agent_runtime"))

import crowd_agents as crowd
import recruiting_agents as cast
import story_agents as stories

from agent_runtime.core.wiring import Delivery
from agent_runtime.io import shell
from agent_runtime.io.cli import endpoints
from agent_runtime.io.options import AGENTS_VARIABLE, Options


def main(name: str, connect: str, run: Path) -> int:
    """Serve until a signal comes."""
    options = Options(connect=connect, run_dir=run, agents=endpoints(os.environ[AGENTS_VARIABLE]))
    if name in ("alice", "bob"):
        agent = stories.alice() if name == "alice" else stories.bob()
        return shell.run(agent, stories.wiring(name, query=Delivery.VOLATILE), options)
    if name in ("asker", "broker", *cast.SCALES):
        made = {"asker": cast.asker, "broker": cast.broker}.get(name, lambda: cast.scale(name))
        return shell.run(made(), cast.wiring(name), options)
    if name == "caller":
        return shell.run(crowd.caller(), crowd.wiring(name), options)
    return shell.run(crowd.worker(name), crowd.wiring(name), options)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], Path(sys.argv[3])))
