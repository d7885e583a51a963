"""The whole fleet as a person starts it: `roco` as a process, six agents over Zenoh, the simulated
robot at full speed.

Waits are for conditions, with a deadline. The truth is read where the loop writes it, in its slots;
agents cannot.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

import msgspec
import zenoh
from toy_fleet import wait_for

from agent_runtime.core.step import OUTSIDE
from agent_runtime.io.heartbeat import Heartbeat
from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.secured import links_tls
from agent_runtime.io.sessions import free_endpoint, open_links
from companion.design import DESIGN
from companion.languages import rc
from companion.languages.facts import Facts, Kind
from companion.run_files import SLOTS_FILE, TaskLine
from companion.skills.loop_messages import Phase
from companion.tools.system import SYSTEM
from companion.tools.verbs.hi import Hi, address
from console.fleet import starting
from console.fleet.local import Local
from console.runs import folders
from operate.file_names import TRAFFIC_FILE
from operate.fleet_file import ProcessState
from operate.recording import mcap_file
from operate.recording.records import Spoken
from services.executor.loop.link import AgentLink, LoopAnswer, LoopState
from velma.errors import SlotError
from velma.sim.truth import Truth

SEED = 7
ENDED = ("done", "failed", "cancelled", "refused")
TASK_S = 150.0  # of wall time: a whole pour takes 40 s on two cores of one's own
SILENT_S = 10.0  # a loop is restarted within seconds
UPRIGHT_DEG = 10.0
T = TypeVar("T")


class Moment(msgspec.Struct, frozen=True):
    """State of a run: where the plan of the open task is and what is told of it, the truth, the
    loop's report.
    """

    at: str
    why: Facts
    truth: Truth
    state: LoopState
    told: LoopAnswer

    def moving(self, act: str) -> bool:
        """Whether the plan is in this act and the robot carries it out."""
        return self.at.endswith(act) and self.told.report.phase is Phase.RUNNING

    def planned(self) -> bool:
        """Whether a plan is made, or was made and has not begun."""
        return any(one.kind in (Kind.PLAN, Kind.PLAN_TAKES) for one in self.why)

    def held(self, thing: str, side: str) -> bool:
        """Whether this hand truly holds it."""
        return self.truth.fingers_on[thing][side] >= 3


class RocoFleet:
    """A fleet in a run folder of its own; `down` ends it, whatever is left of it."""

    def __init__(
        self, run: Path, seed: int = SEED, scene: Path | None = None, more: tuple[str, ...] = ()
    ) -> None:
        self.run = run
        self.roco("up", "--out", str(run), "--speed", "max", "--seed", str(seed),
                  *(["--scene", str(scene)] if scene else []), *more, timeout=120.0,
                  inside=False)  # fmt: skip
        self._link: AgentLink | None = None

    # --- as a person ------------------------------------------------------------------------------

    def roco(self, *words: str, timeout: float = 60.0, code: int = 0, inside: bool = True) -> str:
        """Return the output of `roco`; its exit code must be `code`."""
        run = ["--run-dir", str(self.run)] if inside else []
        command = [sys.executable, "-m", "console", *words, *run]
        done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)
        said = (done.stdout + done.stderr).strip()
        assert done.returncode == code, f"roco {' '.join(words)} ended otherwise: {said}"
        return said

    def begin(self, *words: str) -> "subprocess.Popen[bytes]":
        """Begin a verb about it; the first text may have several words."""
        command = [sys.executable, "-m", "console", *words[0].split(), *words[1:]]
        pipe = subprocess.PIPE
        return subprocess.Popen(
            [*command, "--run-dir", str(self.run)], stdout=pipe, stderr=subprocess.DEVNULL
        )

    @property
    def hi(self) -> Hi:
        """The human interface where it listens now; a restarted one has another port."""
        return Hi(address(Local(self.run)))

    def say(self, text: str) -> str:
        """Say a sentence; the task it became."""
        task = self.hi.say(text)
        assert task.task, task
        return task.task

    def task(self, name: str) -> TaskLine:
        """A task as it stands."""
        return next(line for line in self.hi.tasks() if line.task == name)

    def ended(self, name: str, within_s: float = TASK_S) -> TaskLine:
        """A task once it has ended."""
        self.wait(lambda: self.task(name).state in ENDED, f"task {name} ended", within_s)
        return self.task(name)

    def do(self, text: str, within_s: float = TASK_S) -> TaskLine:
        """Say a sentence, wait for the end of it."""
        return self.ended(self.say(text), within_s)

    def wait(self, condition: Callable[[], object], what: str, within_s: float = TASK_S) -> None:
        """Wait with a deadline; the fleet's last words are told where it passes."""
        try:
            wait_for(condition, what, within_s)
        except AssertionError as error:
            raise AssertionError(f"{error}\n{self.hi.tasks()}\n{self.logs()}") from None

    def session(self, identity: str) -> zenoh.Session:
        """A session with the keys of an agent, linked with the agent's neighbours, as a thief of
        the keys has it.
        """
        told = folders.fleet(self.run)
        assert told is not None
        near = tuple(told.agents[peer] for peer in DESIGN.peers(identity))
        keys = links_tls(self.run / KEYS_FOLDER, identity)
        session = open_links(free_endpoint().replace("tcp/", "tls/"), near, keys)
        wait_for(lambda: len(session.info.peers_zid()) == len(near), "it is linked")
        return session

    # --- as nobody can ----------------------------------------------------------------------------

    @property
    def link(self) -> AgentLink:
        """The loop's slots, to read."""
        if self._link is None or self._link.file.replaced:
            self._link = AgentLink(self.run / SLOTS_FILE)
        return self._link

    def truth(self) -> Truth:
        """Return the true state."""
        return msgspec.msgpack.decode(self._read(lambda: self.link.sealed_truth()), type=Truth)

    def state(self) -> LoopState:
        """The robot as the loop sees it."""
        return self._read(lambda: self.link.state())

    def _read(self, look: Callable[[], T | None]) -> T:
        """Return the contents of a slot; a read that met the writer, or fell between two loops, is
        tried again.
        """
        found: list[T] = []

        def read() -> bool:
            with suppress(SlotError):
                found.extend(one for one in [look()] if one)
            return bool(found)

        wait_for(read, "the loop says something", SILENT_S)
        return found[-1]

    def reach(self, task: str, point: Callable[[Moment], bool], within_s: float = TASK_S) -> None:
        """Wait until a task is where `point` says yes."""

        def there() -> bool:
            line = self.task(task)
            assert line.state not in ENDED, line
            at, seen = line.at.id if line.at else "", (self.truth(), self.state())
            return point(Moment(at, line.why, *seen, self.link.told()))

        self.wait(there, "the point was reached", within_s)

    def pid(self, name: str) -> int:
        """Of a process of the fleet."""
        return int((self.run / f"{name}.pid").read_text())

    def kill(self, *names: str) -> None:
        """kill -9."""
        for name in names:
            os.kill(self.pid(name), signal.SIGKILL)

    def restarts(self, name: str) -> int:
        """Return the number of times the supervisor has restarted it."""
        now = folders.fleet(self.run)
        return next((p.restarts for p in now.processes if p.name == name), 0) if now else 0

    def restarted(self, *names: str) -> bool:
        """Whether these were started again, and all are ready."""
        return all(self.restarts(name) for name in names) and self.whole()

    def whole(self) -> bool:
        """Whether all processes are ready."""
        now = folders.fleet(self.run)
        return now is not None and all(p.state is ProcessState.READY for p in now.processes)

    def beat(self, agent: str) -> Heartbeat:
        """An agent's last heartbeat."""
        file = self.run / f"{agent}.heartbeat.json"
        return msgspec.json.decode(file.read_bytes(), type=Heartbeat)

    def acts_begun(self) -> list[str]:
        """Keys of the acts that ex agreed to begin, in order; a communicate sent again counts
        once.
        """
        agreed = [
            one for one in mcap_file.read(self.run / TRAFFIC_FILE, SYSTEM).records
            if isinstance(one, Spoken) and isinstance(one.content, rc.Accepted)
        ]  # fmt: skip
        return [one.content.key for one in {one.identity: one for one in agreed}.values()]

    def logs(self) -> str:
        """The last lines of everybody."""
        return "\n".join(
            f"--- {log.name}\n{log.read_text()[-1200:]}" for log in sorted(self.run.glob("*.log"))
        )

    def down(self) -> None:
        """End it; nothing that any agent did was outside its design."""
        starting.down(self.run)
        texts = [log.read_text() for log in self.run.glob("*.log")]
        lines = [line for text in texts for line in text.splitlines() if OUTSIDE in line]
        assert not lines, lines[0]


def safely_down(truth: Truth) -> None:
    """Everything stands upright on a surface, in no hand."""
    assert all(tilt < UPRIGHT_DEG for tilt in truth.tilt_deg.values()), truth
    assert not any(links for on in truth.fingers_on.values() for links in on.values()), truth
