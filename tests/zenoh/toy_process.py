"""One of the toy agents as a process of its own: `python toy_process.py asker|server <connect> <run
folder>`.

Words for the asker come as files: the asker's device looks at <run>/want and posts each new line as
Want.
"""

import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "agent_runtime"))

import toy_agents as toy

from agent_runtime.core.agent import Agent, Behaviour
from agent_runtime.core.turn import Turn
from agent_runtime.io import shell
from agent_runtime.io.cli import endpoints
from agent_runtime.io.devices import Post
from agent_runtime.io.options import AGENTS_VARIABLE, Options


class WantFile:
    """Posts the lines of a file, each once in this life."""

    busy = False

    def __init__(self, post: Post, path: Path) -> None:
        self._post, self._path = post, path
        self._ended = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        seen = 0
        while not self._ended.wait(0.02):
            lines = self._path.read_text().split() if self._path.exists() else []
            for line in lines[seen:]:
                self._post(toy.Want(int(line)))
            seen = len(lines)

    def tell(self, content: Any) -> None:
        """Nothing is told."""

    def close(self) -> None:
        """Look no more."""
        self._ended.set()


def settable(run: Path) -> None:
    """Let a file in the run folder set this process's wall clock: by that many seconds."""
    wall = time.time

    def moved() -> float:
        try:
            return wall() + float((run / "clock").read_text() or 0)
        except (OSError, ValueError):
            return wall()

    time.time = moved


def endless(run: Path) -> Agent[toy.ServerMemory]:
    """The server; while there is a file `endless` its steps have no end."""

    def step(memory: toy.ServerMemory, turn: Turn) -> toy.ServerMemory:
        while (run / "endless").exists():
            pass
        return toy.serve(memory, turn)

    behaviours = {"serving": Behaviour(step)}
    return Agent(name="server", start="serving", memory=toy.ServerMemory(), behaviours=behaviours)


def main(name: str, connect: str, run: Path) -> int:
    """Serve until a signal comes."""
    settable(run)
    to_server, to_asker = toy.wirings()
    agents = endpoints(os.environ[AGENTS_VARIABLE])
    options = Options(connect=connect, run_dir=run, log_level="debug", agents=agents)
    if name == "asker":
        return shell.run(toy.asker(), to_server, options, lambda post: WantFile(post, run / "want"))
    return shell.run(endless(run), to_asker, options)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], Path(sys.argv[3])))
