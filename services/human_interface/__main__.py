"""a_hi, the human interface: `python -m services.human_interface --help`. People reach it as docs/http.md says."""

import os
import sys

from agent_runtime.core.agent import Agent
from agent_runtime.io import cli, shell
from agent_runtime.io.options import Options
from companion.binding import wiring
from companion.design import AgentName
from services.human_interface.behaviours import human_interface
from services.human_interface.memory import Memory
from services.human_interface.server import Desk, listen_at

USAGE_ERROR = 2  # a wrong option or environment: no supervisor tries again


def build(options: Options) -> Agent[Memory]:
    """The agent; its device is a Desk in the run folder."""
    return human_interface()


def serve(options: Options) -> int:
    """Run it until it is told to stop; the exit status. ROCO_HTTP says where people reach it (default: loopback)."""
    try:
        listen = listen_at(os.environ.get("ROCO_HTTP", ""))
    except ValueError as error:
        print(f"ROCO_HTTP: {error}", file=sys.stderr)
        return USAGE_ERROR
    agent, wired = build(options), wiring(AgentName.HI, options.system)
    return shell.run(agent, wired, options, lambda post: Desk(post, options.run_dir, listen))


if __name__ == "__main__":
    cli.run("human-interface", "Takes the words of people, tells what becomes of them.", serve)
