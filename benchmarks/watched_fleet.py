"""A whole fleet in a folder of its own whose world is watched: the paths of the vessels, and the times.

Agents cannot see the truth; it is read where the loop writes it. A thing counts as dropped where no
hand touches it and it is below the tables, or lies; how it stands in the end is judged by `unsafe`.
"""

import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

import msgspec

from companion.run_files import SLOTS_FILE, TaskLine
from companion.skills.loop_messages import Mode
from companion.tools.verbs.hi import Hi, HiError, address
from operate.cli.errors import ConsoleError
from operate.cli.fleet import starting
from operate.cli.fleet.local import Local
from services.executor.loop.link import AgentLink
from velma.errors import SlotError
from velma.sim.truth import Truth

ENDED = ("done", "failed", "cancelled", "refused")
UP_S, TASK_S, READ_S, PERIOD_S = 180.0, 600.0, 20.0, 0.02  # wall; estimates for a busy machine
LOWEST_M = {"jar_1": 0.80, "bowl_1": 0.72}
"""Origins of things that stand on the lowest surface there is, the table of 0.775 m, less some centimetres."""
UPRIGHT_DEG, HELD = 10.0, 3
TILTED_DEG = 60.0  # a carried thing may tilt by 60 degrees (companion.planning.placing)
T = TypeVar("T")


class NotSeenError(Exception):
    """Something did not come in its time."""


class WatchedFleet:
    """Started on entry, brought down on exit."""

    def __init__(self, run: Path, seed: int, *options: str) -> None:
        self.run, self.seed, self.options, self.dropped = run, seed, options, ""
        self._link: AgentLink | None = None
        self._over = threading.Event()
        self._watching = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> "WatchedFleet":
        self.run.parent.mkdir(parents=True, exist_ok=True)
        words = ["up", "--out", str(self.run), "--speed", "max", "--seed", str(self.seed), *self.options]
        roco = Path(sys.executable).with_name("roco")
        subprocess.run([str(roco), *words], check=True, capture_output=True, timeout=UP_S)
        self.wait(lambda: self.hi.tasks() is not None, "the human interface", 90.0)
        self._watching.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        starting.down(self.run)

    # --- as a person --------------------------------------------------------------------------------------------------

    @property
    def hi(self) -> Hi:
        """The human interface where it listens now."""
        return Hi(address(Local(self.run)))

    def line(self, task: str) -> TaskLine:
        """A task as it stands."""
        return next(line for line in self.hi.tasks() if line.task == task)

    def say(self, text: str, urgency: int = 0) -> TaskLine:
        """Say a sentence; the line of the task."""
        return self.hi.say(text, urgency)

    def ended(self, task: str) -> TaskLine:
        """A task once it has ended."""
        self.wait(lambda: self.line(task).state in ENDED, f"the end of {task}", TASK_S)
        return self.line(task)

    def reach(self, task: str, there: Callable[[TaskLine, Truth], bool]) -> bool:
        """Wait for a moment of a task; False where the task ended before."""

        def now() -> bool:
            line = self.line(task)
            return line.state in ENDED or there(line, self.truth())

        self.wait(now, "the moment", TASK_S)
        return self.line(task).state not in ENDED

    def wait(self, condition: Callable[[], object], what: str, within_s: float) -> None:
        """Wait with a deadline. Raise NotSeenError where it passes."""
        end = time.monotonic() + within_s
        while True:
            with suppress(HiError, ConsoleError):
                if condition():
                    return
            if time.monotonic() > end:
                raise NotSeenError(f"{what} did not come within {within_s:g} s")
            time.sleep(PERIOD_S)

    # --- as nobody can ------------------------------------------------------------------------------------------------

    def truth(self) -> Truth:
        """Return the true state."""
        end = time.monotonic() + READ_S
        while True:
            with suppress(SlotError, OSError):
                if self._link is None or self._link.file.replaced:
                    self._link = AgentLink(self.run / SLOTS_FILE)
                if sealed := self._link.sealed_truth():
                    return msgspec.msgpack.decode(sealed, type=Truth)
            if time.monotonic() > end:
                raise NotSeenError("the loop says nothing")
            time.sleep(PERIOD_S)

    def moves_again(self) -> bool:
        """Whether the loop can be commanded, after a release."""
        with suppress(SlotError, OSError):
            return self._link is not None and (state := self._link.state()) is not None and state.mode is Mode.MOTION
        return False

    def _watch(self) -> None:
        """Note the first thing that was dropped."""
        link: AgentLink | None = None
        while not self._over.wait(PERIOD_S):
            with suppress(SlotError, OSError):
                if link is None or link.file.replaced:
                    link = AgentLink(self.run / SLOTS_FILE)
                if (sealed := link.sealed_truth()) and not self.dropped:
                    self.dropped = dropped(msgspec.msgpack.decode(sealed, type=Truth))


def dropped(truth: Truth) -> str:
    """Return what is falling or lies; "" for nothing."""
    for name, (_, _, z) in truth.at.items():
        if any(truth.fingers_on[name].values()):
            continue
        if z < LOWEST_M.get(name, 0.0):
            return f"{name} is at a height of {z:.2f} m at {truth.time_s:.0f} s"
        if truth.tilt_deg[name] > TILTED_DEG:
            return f"{name} lies, tilted by {truth.tilt_deg[name]:.0f} deg, at {truth.time_s:.0f} s"
    return ""


def held(truth: Truth) -> dict[str, str]:
    """Return which hand truly holds which thing."""
    return {name: side for name, on in truth.fingers_on.items() for side, links in on.items() if links >= HELD}


def unsafe(truth: Truth) -> str:
    """Return why this state is not safe; "" where everything stands upright and in no hand."""
    tilted = [name for name, tilt in truth.tilt_deg.items() if tilt > UPRIGHT_DEG]
    touched = [name for name, on in truth.fingers_on.items() if any(on.values())]
    words = [f"{name} is tilted" for name in tilted] + [f"{name} is touched" for name in touched]
    return ", ".join(words)
