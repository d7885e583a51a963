"""Start-up of the fleet: seconds from the start of the supervisor until each process is ready, head and arm move.

    python benchmarks/startup.py [--seed N] [--speed 1] [--insecure] [--keep DIR]

The sentence is said as soon as the fleet is ready. Head and arm: the first change of a measured joint by more than
`MOVED` after that, and the first one at all for the head (the survey may begin before the sentence).
"""

import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from agent_runtime.io.options import Options
from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.tap import Sample, open_tap
from companion.telemetry import RobotState, told
from companion.tools.verbs.hi import Hi, address
from companion.tools.verbs.main_job import SENTENCE
from operate.cli.fleet import starting
from operate.cli.fleet.local import Local
from operate.cli.runs import folders
from operate.run_folder import ProcessState

MOVED = 0.02  # [rad], above what the body sways at rest (1 mrad) and what gravity pulls at the start
LIMIT_S = 120.0


class Motion:
    """First movements of head and arms, as seconds since `began`."""

    def __init__(self, began: float) -> None:
        self.began = began
        self.first: RobotState | None = None
        self.moved: dict[str, float] = {}
        self.shown_at = 0.0

    def heard(self, sample: Sample) -> None:
        """Take in what ex shows."""
        if not sample.key.endswith("/_/telemetry/ex"):
            return
        state = told(sample.data)
        if not isinstance(state, RobotState):
            return
        if self.first is None:
            self.first, self.shown_at = state, sample.at - self.began
        for name in ("head", "body"):
            far = np.abs(np.subtract(getattr(state, name), getattr(self.first, name))).max()
            if far > MOVED:
                self.moved.setdefault(name, sample.at - self.began)


def main(
    seed: Annotated[int, typer.Option()] = 1,
    speed: Annotated[str, typer.Option()] = "1",
    insecure: Annotated[bool, typer.Option("--insecure", help="without TLS, keys and rights")] = False,
    keep: Annotated[Path | None, typer.Option(help="the run folder; default: a temporary one")] = None,
) -> None:
    """Measure one start."""
    with tempfile.TemporaryDirectory() as scratch:
        run = keep or Path(scratch) / "run"
        began = time.time()
        supervisor = starting.start(run, ["--speed", speed, "--seed", str(seed), *(["--insecure"] if insecure else [])])
        motion, ready = Motion(began), dict[str, float]()
        tap = None
        try:
            while time.time() - began < LIMIT_S and "body" not in motion.moved:
                now, told = time.time() - began, folders.fleet(run)
                for status in told.processes if told else ():
                    if status.state is ProcessState.READY:
                        ready.setdefault(status.name, now)
                if tap is None and told is not None and "router" in ready:
                    options = Options(connect=told.connect, keys=None if insecure else run / KEYS_FOLDER)
                    tap = open_tap(options, motion.heard, lambda: False)
                if told and "all" not in ready and all(s.name in ready or s.optional for s in told.processes):
                    ready["all"] = now
                    Hi(address(Local(run))).say(SENTENCE)
                    ready["said"] = time.time() - began
                time.sleep(0.02)
        finally:
            for name, at in ready.items():
                print(f"{at:6.2f} s  {name} {'ready' if name != 'said' else ''}")
            for name, at in motion.moved.items():
                print(f"{at:6.2f} s  {name} moves")
            if tap is not None:
                tap.close()
            starting.down(run)
            supervisor.wait(timeout=90.0)


if __name__ == "__main__":
    typer.run(main)
