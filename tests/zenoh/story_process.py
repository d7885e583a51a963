"""An agent of the stories, the crowd or the brokers as a process: `python story_process.py <agent>
<connect> <run>`.
"""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "agent_runtime"))

import fipa_agents as fipa

from agent_runtime.core.wiring import Delivery
from agent_runtime.io import shell
from agent_runtime.io.cli import endpoints
from agent_runtime.io.options import AGENTS_VARIABLE, Options


def main(name: str, connect: str, run: Path) -> int:
    """Serve until a signal comes."""
    options = Options(connect=connect, run_dir=run, agents=endpoints(os.environ[AGENTS_VARIABLE]))
    return shell.run(fipa.made(name), fipa.wiring(name, query=Delivery.VOLATILE), options)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], Path(sys.argv[3])))
