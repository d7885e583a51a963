"""Two companions and the dispatcher in front of them, each a fleet in a folder of its own."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from roco_fleet import RocoFleet
from toy_fleet import wait_for

from agent_runtime.core.step import OUTSIDE
from agent_runtime.io.steplog import Deed, deeds
from console.runs import folders
from topdown.model.design import load
from topdown.prove.paths import Follower

EXAMPLE = Path(__file__).parents[2] / "examples" / "dispatch"
ROBOTS = {"b1": "velma1", "b2": "velma2"}
END_S = 60.0
"""Until the dispatcher's processes have ended."""


class Robots:
    """The companions, by their bidders."""

    def __init__(self, folder: Path) -> None:
        self.fleets: dict[str, RocoFleet] = {}
        try:
            for seed, (bidder, name) in enumerate(ROBOTS.items(), start=1):
                self.fleets[bidder] = RocoFleet(folder / name, seed=seed)
        except BaseException:
            self.end()
            raise

    def kill(self, bidder: str) -> None:
        """kill -9 of all of it, the supervisor first."""
        run = self.fleets[bidder].run
        pids = [int(file.read_text() or 0) for file in run.glob("*.pid")]
        told = folders.fleet(run)
        assert told is not None
        for pid in (told.supervisor, *pids):
            with suppress(ProcessLookupError):
                if pid:
                    os.kill(pid, signal.SIGKILL)

    def end(self) -> None:
        """Those that are still there; nothing that any agent did was outside its design."""
        for one in self.fleets.values():
            one.down()


class Dispatch:
    """The dispatcher, in the foreground of a process; its run folder is `run`."""

    def __init__(self, folder: Path, *orders: str) -> None:
        self.run = folder / "dispatch"
        self.run.mkdir()
        scene = folder / "dispatch.toml"
        robots = "\n".join(f'{name} = "{name}"' for name in ROBOTS.values())
        listed = "\n".join(f"[[order]]\ntask = {order}" for order in orders)
        scene.write_text(f"[robots]\n{robots}\n\n{listed}\n")
        command = [sys.executable, "-m", "dispatch", "--run-dir", str(self.run)]
        with (folder / "out").open("wb") as out:
            self.process = subprocess.Popen(
                [*command, "--scene", str(scene)], cwd=EXAMPLE, stdout=out, stderr=out
            )

    def said(self, event: str, agent: str = "di") -> list[dict[str, Any]]:
        """The lines of an agent's log with this event."""
        file = self.run / "logs" / f"{agent}.jsonl"
        lines = file.read_text().splitlines() if file.exists() else []
        return [one for one in map(json.loads, lines) if one["event"] == event]

    def wait(self, event: str, count: int, within_s: float) -> list[dict[str, Any]]:
        """The lines of di with this event, once there are so many."""
        wait_for(lambda: len(self.said(event)) >= count, f"{count} times {event}", within_s)
        return self.said(event)

    def kill(self, agent: str) -> None:
        """kill -9; the supervisor starts it again."""
        os.kill(int((self.run / f"{agent}.pid").read_text()), signal.SIGKILL)

    def end(self) -> list[tuple[str, Deed]]:
        """End it; no agent took a step that no row of the design allows, and all steps are of the
        model. The steps.
        """
        self.process.send_signal(signal.SIGINT)
        self.process.wait(END_S)
        outside = [log for log in (self.run / "logs").glob("*.jsonl") if OUTSIDE in log.read_text()]
        assert outside == []
        done = deeds(self.run / "steps")
        assert Follower(load(EXAMPLE / "dispatch" / "design.toml")).follow(done) is None
        return done


@contextmanager
def dispatching(folder: Path, *orders: str) -> Iterator[Dispatch]:
    """The dispatcher with these orders, between robots that run in the same folder."""
    one = Dispatch(folder, *orders)
    try:
        yield one
    finally:
        if one.process.poll() is None:
            one.process.kill()
