"""Fleets of router, km and pl side by side, as shipped and with parts of it left out, and bare
gets: asked by turns.

`SHIPPED` is what `roco up` and containers start: agents linked by mutual TLS, the rights of the
design, the monitor, which records, judges and draws, and all files on disk. `UNIX` is what `roco up
--links unix` starts. The others say what parts of `SHIPPED` cost. `BARE` is a get of as many bytes
through a router of its own.
"""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
from round_trip import SYSTEM, Block

from agent_runtime.io import issuing
from agent_runtime.io.sessions import UNIX_SOCKET, free_endpoint
from companion.design import DESIGN

HERE = Path(__file__).resolve().parent
START_S, WITHIN_S, REST_S = 180.0, 60.0, 30.0  # estimates: on a machine that is busy with much else
LOOK_S, IDLE_TICKS = 0.1, 1
"""Period [s], and processor time in it [ticks] up to which a process is idle: heartbeats take less
(estimate).
"""


class NotThereError(Exception):
    """A process did not come up, or does not answer."""


class Kind(msgspec.Struct, frozen=True):
    """Kind of fleet. `bare`: two sessions instead of agents; `unix`: agents are linked by sockets
    of this host.
    """

    name: str
    secured: bool = False
    monitored: bool = False
    bare: bool = False
    unix: bool = False


BARE = Kind("bare get", bare=True)
SHIPPED = Kind("as shipped", secured=True, monitored=True)
PARTS = (
    Kind("plain, no monitor"),
    Kind("TLS and rights, no monitor", secured=True),
    Kind("plain", monitored=True),
)
UNIX = Kind("unix sockets", secured=True, monitored=True, unix=True)
KINDS = (BARE, *PARTS, SHIPPED, UNIX)


class Fleet:
    """One that runs; `block` has its asker ask."""

    def __init__(self, run: Path, kind: Kind) -> None:
        run.mkdir(parents=True)
        self._run, self._kind = run, kind
        self._address = self._endpoint()
        if kind.secured:
            issuing.issue(run / "keys", DESIGN, (SYSTEM,))
        told = {
            "CONNECT": self._address,
            "RUN_DIR": str(run),
            "SYSTEM": SYSTEM,
            "AGENTS": self._agents(),
        }
        told |= {"TLS_DIR": str(run / "keys") if kind.secured else "", "LOG_LEVEL": "warning"}
        self._environment = os.environ | {f"ROCO_{name}": value for name, value in told.items()}
        self._started: list[subprocess.Popen[bytes]] = []
        try:
            self._begin(kind)
        except BaseException:
            self.end()
            raise

    def _endpoint(self) -> str:
        return free_endpoint().replace("tcp/", "tls/" if self._kind.secured else "tcp/")

    def _agents(self) -> str:
        """Return where pl and km are reached, each time other places."""
        sockets = f"{UNIX_SOCKET}{self._run}/"
        at = {
            name: f"{sockets}{name}.sock" if self._kind.unix else self._endpoint()
            for name in DESIGN.agents
        }
        return ",".join(f"{name}={endpoint}" for name, endpoint in at.items())

    def _begin(self, kind: Kind) -> None:
        self._serve("services.router", "router.ready")
        if kind.monitored:
            self._serve("services.monitor", "monitor.ready")
        read, write = os.pipe()
        self._times = os.fdopen(read, "rb")
        answering, asking = ("queryable", "getter") if kind.bare else ("km", "pl")
        self._role(answering, write, self._run)
        if kind.bare:
            self._wait(lambda: (self._run / "queryable.ready").exists(), answering)
        self._asker = self._role(asking, write, self._run, stdin=subprocess.PIPE)
        os.close(write)
        beat = self._run / "pl.heartbeat.json"
        if not kind.bare:
            self._wait(
                lambda: beat.exists() and b'"km":1' in beat.read_bytes(), "pl, which looks for km,"
            )

    def _serve(self, module: str, ready: str) -> None:
        self._start([sys.executable, "-P", "-m", module])
        self._wait(lambda: (self._run / ready).exists(), module)

    def _role(self, name: str, out: int, folder: Path, **more: Any) -> subprocess.Popen[bytes]:
        words = [name, self._address, str(folder), str(out)]
        return self._start(
            [sys.executable, str(HERE / "round_trip.py"), *words], pass_fds=[out], **more
        )

    def _start(self, command: list[str], **more: Any) -> subprocess.Popen[bytes]:
        with (self._run / "bench.log").open("ab") as log:
            process = subprocess.Popen(
                command,
                **({"stdin": subprocess.DEVNULL} | more),
                env=self._environment,
                stdout=log,
                stderr=log,
            )
        self._started.append(process)
        return process

    def _wait(self, there: Callable[[], bool], who: str) -> None:
        until = time.monotonic() + START_S
        while not there():
            if time.monotonic() > until:
                raise NotThereError(
                    f"{who} is not ready after {START_S:g} s; see {self._run}/bench.log"
                )
            time.sleep(0.02)

    def block(self, answer: str, count: int) -> list[float]:
        """Times of `count` questions, one after the other [us]."""
        assert self._asker.stdin is not None
        self._asker.stdin.write(msgspec.json.encode(Block(answer, count)) + b"\n")
        self._asker.stdin.flush()
        if not select.select([self._times], [], [], WITHIN_S)[0]:
            raise NotThereError(
                f"no answers of {answer} in {WITHIN_S:g} s; see {self._run}/bench.log"
            )
        return msgspec.json.decode(self._times.readline(), type=list[float])

    def rest(self) -> None:
        """Wait until it has done its work: a monitor is behind after a block, and others would pay
        for it.
        """
        until, used = time.monotonic() + REST_S, -1
        while used < (used := self.ticks()) - IDLE_TICKS and time.monotonic() < until:
            time.sleep(LOOK_S)

    def ticks(self) -> int:
        """Return the processor time that its processes have used [10 ms]."""
        return sum(ticks(pid) for process in self._started for pid in tree(process.pid))

    def end(self) -> None:
        """Stop it, the router last. A monitor is killed: it would make a report of all that was
        asked.
        """
        for process in reversed(self._started):
            monitor = "services.monitor" in process.args  # type: ignore[operator]  # a list of words
            process.send_signal(signal.SIGKILL if monitor else signal.SIGTERM)
            process.wait(WITHIN_S)


def tree(pid: int) -> list[int]:
    """A process and all that it has started, by whichever of its threads."""
    try:
        below = [
            int(word)
            for file in Path(f"/proc/{pid}/task").glob("*/children")
            for word in file.read_text().split()
        ]
    except OSError:
        below = []
    return [pid, *(one for child in below for one in tree(child))]


def ticks(pid: int) -> int:
    """Processor that it used [10 ms]; 0 where it has ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0
    return int(fields[11]) + int(fields[12])
