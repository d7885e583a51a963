"""hi as a process: `python -m services.human_interface --help`. People reach it as docs/http.md
says.
"""

import os
import sys
from pathlib import Path

from agent_runtime.io import cli, shell
from agent_runtime.io.options import USAGE_ERROR, Options
from agent_runtime.io.run_files import listen_at
from companion.design import AgentName, wiring
from companion.loopback_server import RobotStop
from services.human_interface.behaviours import agent
from services.human_interface.guests import HiDevice
from services.human_interface.server import HttpDevice


def serve(options: Options) -> int:
    """Run until a signal; return the exit code. ROCO_HTTP says where people reach it (default:
    loopback).

    ROCO_HI_DIR: a folder for the address beside the run folder's, which the person's page reads in
    another container.
    """
    lent = os.environ.get("ROCO_HI_DIR", "")
    try:
        listen = listen_at(os.environ.get("ROCO_HTTP", ""))
    except ValueError as error:
        print(f"ROCO_HTTP: {error}", file=sys.stderr)
        return USAGE_ERROR
    wired = wiring(AgentName.HI, options.system)
    return shell.run(
        agent(),
        wired,
        options,
        lambda post: HiDevice(
            post,
            HttpDevice(post, options.run_dir, listen, Path(lent) if lent else None),
            RobotStop(options.run_dir),
        ),
    )


if __name__ == "__main__":
    cli.run("human-interface", "hi: takes the words of people, tells what becomes of them.", serve)
