"""Load of a fleet for viewer.py: questions of pl to km at a steady pace, a recorded robot's telemetry.

    python benchmarks/viewer_load.py km|pl|robot <endpoint> <run folder>

pl writes each round trip to <run folder>/trips: unix time of the answer [s], how long it took [us].
"""

import os
import sys
import time
from pathlib import Path
from typing import Any

import zenoh
from round_trip import SYSTEM, Begin, Came, Go, Store, km, pl

from agent_runtime.io import shell
from agent_runtime.io.cli import endpoints
from agent_runtime.io.devices import Post
from agent_runtime.io.options import AGENTS_VARIABLE, Options
from agent_runtime.io.sessions import client_config
from companion.binding import wiring
from scripts.replaying import samples

RECORDED = Path(__file__).resolve().parents[1] / "tests" / "histories" / "pour_seed_7"
PAUSE_S = 0.02
"""Between two questions: 50 a second, as pl asks in a search."""
ANSWER = "654 B"


class Asker:
    """pl's own side: a question every PAUSE_S, its time written down at once."""

    busy = False

    def __init__(self, post: Post, run: Path) -> None:
        self._post, self._asked = post, 0
        self._file = (run / "trips").open("w", buffering=1)
        post(Begin(), 1.0)

    def tell(self, content: Any) -> None:
        """An answer is there, or it is time to begin."""
        if isinstance(content, Came):
            self._file.write(f"{time.time():.3f} {(time.perf_counter_ns() - self._asked) / 1000:.1f}\n")
            self._post(Begin(), PAUSE_S)
        elif isinstance(content, Begin):
            self._asked = time.perf_counter_ns()
            self._post(Go(ANSWER))

    def close(self) -> None:
        """End with the process."""
        self._file.close()


def robot(endpoint: str) -> None:
    """Telemetry and truth of a recorded robot, over and over."""
    with zenoh.open(client_config(endpoint)) as session:
        while True:
            began = time.time()
            for at, sample in samples(RECORDED, 1e9, began):
                if "/_/t" in sample.key:
                    time.sleep(max(0.0, began + at - time.time()))
                    session.put(sample.key.replace("roco/roco/", f"roco/{SYSTEM}/"), sample.data)


def role(name: str, endpoint: str, run: Path) -> int:
    """Serve as one of the processes until told to stop."""
    agents = endpoints(os.environ[AGENTS_VARIABLE])
    options = Options(connect=endpoint, run_dir=run, system=SYSTEM, log_level="warning", agents=agents)
    if name == "robot":
        robot(endpoint)
    if name == "km":
        return shell.run(km(), wiring("km", SYSTEM), options, lambda post: Store())
    return shell.run(pl(), wiring("pl", SYSTEM), options, lambda post: Asker(post, run))


if __name__ == "__main__":
    sys.exit(role(sys.argv[1], sys.argv[2], Path(sys.argv[3])))
