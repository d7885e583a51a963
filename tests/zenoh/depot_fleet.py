"""The depot of the examples as anybody brings it up: a copy outside the clone, so that only its
pyproject.toml says which system it is.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import msgspec
import zenoh
from toy_fleet import wait_for

from agent_runtime.io.heartbeat import Heartbeat
from agent_runtime.io.sessions import client_config
from console.fleet.identity import tls
from console.fleet.local import Local
from console.fleet.process_status import Seen
from console.runs import folders
from operate.fault_lines import Fault, latest, read
from operate.file_names import FAULTS_FILE, LATEST
from operate.fleet_file import Fleet

EXAMPLE = Path(__file__).parents[2] / "examples" / "depot"
DESIGN_FILE = EXAMPLE / "depot" / "design.toml"
AGENTS = ("desk", "dispatcher", "traffic", "mule", "ox")
WAYS = (("receiving", "press"), ("store", "shipping"), ("press", "receiving"))
PATIENCE_S, CALL_S, END_S = 60.0, 150.0, 30.0
"""For what a fleet does, for a verb, and for its end once it is interrupted; the supervisor ends a
monitor that hangs after 120 s.
"""


def copied(folder: Path) -> Path:
    """Copy the example into a folder that is not there yet."""
    shutil.copytree(EXAMPLE, folder, ignore=shutil.ignore_patterns("runs", "__pycache__"))
    return folder


def orders(count: int) -> str:
    """Orders as the desk reads them, one after the other."""
    lines = '[[order]]\nitem = "{0}"\nsource = "{0}"\ntarget = "{1}"\n'
    return "\n".join(lines.format(*way) for way in islice(cycle(WAYS), count))


class Project:
    """A folder in which `roco` is called, as a shell does, wide enough that nothing is cut. `run`:
    its newest run.
    """

    def __init__(self, folder: Path) -> None:
        self.folder, self.run = folder, folder / "runs" / LATEST
        self.begun: list[subprocess.Popen[str]] = []
        kept = {name: value for name, value in os.environ.items() if not name.startswith("ROCO_")}
        self.environment = kept | {"COLUMNS": "200"}

    def begin(self, *words: str) -> "subprocess.Popen[str]":
        """Begin a verb; the first text may have several words."""
        command = [sys.executable, "-P", "-m", "console", *words[0].split(), *words[1:]]
        pipe = subprocess.PIPE
        process = subprocess.Popen(
            command, cwd=self.folder, env=self.environment, stdout=pipe, stderr=pipe, text=True,
            start_new_session=True,
        )  # fmt: skip
        self.begun.append(process)
        return process

    def called(self, *words: str) -> "subprocess.CompletedProcess[str]":
        """Call a verb; where it takes too long, interrupt it: it ends the fleet that it started."""
        process = self.begin(*words)
        try:
            out, problems = process.communicate(timeout=CALL_S)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=END_S)
            raise
        return subprocess.CompletedProcess(process.args, process.returncode, out, problems)

    def roco(self, *words: str, code: int = 0) -> str:
        """Return all that a verb prints; its exit code must be `code`."""
        done = self.called(*words)
        assert done.returncode == code, (words, done.stdout + done.stderr)
        return done.stdout + done.stderr

    def json(self, *words: str, code: int = 0) -> Any:
        """Return the last line that a verb prints for programs, read."""
        done = self.called(*words, "--format", "json")
        assert done.returncode == code, (words, done.stdout + done.stderr)
        return json.loads((done.stdout or done.stderr).splitlines()[-1])

    def end(self) -> None:
        """End the fleet, and what a failed test left running."""
        self.roco("down")
        self.leave()

    def leave(self) -> None:
        """End the verbs that still run."""
        while self.begun:
            process = self.begun.pop()
            process.kill()
            process.communicate()


class Depot(Project):
    """A copy of the depot, with as many orders; 0: those of the example."""

    def __init__(self, folder: Path, count: int = 0) -> None:
        super().__init__(copied(folder / "depot"))
        self.orders = count
        if count:
            (self.folder / "depot/orders.toml").write_text(orders(count))

    def wait(self, condition: Callable[[], object], what: str) -> None:
        """Wait for what a fleet does."""
        wait_for(condition, what, PATIENCE_S)

    @property
    def fleet(self) -> Fleet:
        """What the supervisor tells of the fleet."""
        found = folders.fleet(self.run)
        assert found is not None
        return found

    def seen(self, name: str) -> Seen:
        """Return a process as it is now."""
        return next(one for one in Local(self.run).look().seen if one.name == name)

    def pid(self, name: str) -> int:
        """Of a process that is ready; 0 while it is not."""
        ready, pid = self.run / f"{name}.ready", self.run / f"{name}.pid"
        return int(pid.read_text() or 0) if ready.exists() and pid.exists() else 0

    def kill(self, name: str) -> int:
        """kill -9 as soon as it is ready; its pid."""
        wait_for(lambda: self.pid(name), f"{name} is ready")
        pid = self.pid(name)
        os.kill(pid, signal.SIGKILL)
        return pid

    def back(self, name: str, pid: int) -> None:
        """Wait until another process has taken the place of this one."""
        wait_for(lambda: self.pid(name) not in (0, pid), f"{name} is back")

    def frozen(self, name: str) -> bool:
        """Whether a process is stopped by a signal."""
        used = self.seen(name).used
        return used is not None and used.frozen

    def beat(self, name: str) -> Heartbeat:
        """The last heartbeat of an agent."""
        file = self.run / f"{name}.heartbeat.json"
        return msgspec.json.decode(file.read_bytes(), type=Heartbeat)

    def beats_on(self, name: str) -> None:
        """Wait for two heartbeats of an agent that lives."""
        before = self.beat(name).at
        self.wait(lambda: self.beat(name).at > before + 2, f"{name} beats twice")

    def judged(self, verdict: str) -> int:
        """Return how many communicates have a verdict so far."""
        return sum(one.verdict == verdict for one in Local(self.run).verdicts())

    def said(self, text: str) -> int:
        """Return the number of the monitor's verdicts that begin with a text."""
        return sum(one.text.startswith(text) for one in Local(self.run).verdicts())

    def goes_on(self) -> None:
        """Orders that are given from now on are delivered."""
        before = self.said("delivered ")
        self.wait(lambda: self.said("delivered ") >= before + 2, "two more orders are delivered")

    def faults(self) -> tuple[Fault, ...]:
        """Return the faults so far."""
        file = self.run / FAULTS_FILE
        return latest(read(file.read_bytes())) if file.exists() else ()

    def session(self, identity: str, to: str = "") -> zenoh.Session:
        """A session with the keys of an identity, with the agent `to`, else with the router."""
        fleet = self.fleet
        at = fleet.agents[to] if to else fleet.connect
        return zenoh.open(client_config(at, tls(self.run, fleet, identity)))


@contextmanager
def running(folder: Path, *words: str, count: int = 0) -> Iterator[Depot]:
    """A depot that is up, with these options."""
    one = Depot(folder, count)
    try:
        one.roco("up", *words)
        yield one
    finally:
        one.end()
