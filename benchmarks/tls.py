"""What mutual TLS and the rights cost the fleet: questions and answers on C4, with and without, by turns in one run.

    python benchmarks/tls.py [--quick]

Two fleets of router, km and pl, each as processes with all that agents have (round_trip.py): one as `roco up` starts
it, with keys and the companion's rights, one as `roco up --insecure` does. pl of each asks in blocks, plain, secured,
plain, secured ..., so that the machine's other work falls on both. Prints p50 and p99 [us] of each, the ratio of the
medians, and the middle half of the blocks' ratios: each secured block against the two plain ones around it.
"""

import os
import select
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from round_trip import SYSTEM, Came, Go, km, pl

from agent_runtime import issuing, shell
from agent_runtime.agent import Agent
from agent_runtime.devices import Post
from agent_runtime.options import Options
from agent_runtime.zenoh_wire import free_endpoint
from companion.binding import wiring
from companion.design import DESIGN

LIMIT = 1.25
SIZES = {"654 B": 100, "98 kB": 30, "852 kB": 20}
"""Answer (paper, section 5.7: mean and largest of C4, largest of all): trips of a block."""
BLOCKS = 41
WITHIN_S = 60.0
START_S = 180.0  # on a machine that is busy with much else


class Block(msgspec.Struct):
    """So many questions for this answer."""

    answer: str
    count: int


class Store:
    """km's own side, which has nothing to keep."""

    busy = False

    def tell(self, content: Any) -> None:
        """What km tells its store."""

    def close(self) -> None:
        """Nothing to close."""


class Turns:
    """pl's own side: a block of questions for each line of standard input; its times [us] as a line of `out`."""

    busy = False

    def __init__(self, post: Post, out: int) -> None:
        self._post, self._out = post, os.fdopen(out, "wb", buffering=0)
        self._left, self._asked, self._times, self._answer = 0, 0, list[float](), ""
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        lines = os.fdopen(0, "rb", buffering=0, closefd=False)  # unbuffered: its lock would hold up the end
        for line in lines:
            block = msgspec.json.decode(line, type=Block)
            self._left, self._times, self._answer = block.count, [], block.answer
            self._ask()

    def _ask(self) -> None:
        self._asked = time.perf_counter_ns()
        self._post(Go(self._answer))

    def tell(self, content: Any) -> None:
        """An answer came: ask on, or give the times."""
        now = time.perf_counter_ns()
        if not isinstance(content, Came):
            return
        self._times.append((now - self._asked) / 1000)
        self._left -= 1
        if self._left:
            self._ask()
        else:
            self._out.write(msgspec.json.encode(self._times) + b"\n")

    def close(self) -> None:
        """End with the process."""
        self._out.close()


class Fleet:
    """Router, km and pl; `block` has pl ask."""

    def __init__(self, run: Path, *, secured: bool) -> None:
        run.mkdir()
        address = free_endpoint().replace("tcp/", "tls/" if secured else "tcp/")
        if secured:
            issuing.issue(run / "keys", DESIGN, (SYSTEM,))
        told = {"ROCO_LISTEN": address, "ROCO_RUN_DIR": str(run), "ROCO_SYSTEM": SYSTEM}
        self._environment = os.environ | told | {"ROCO_TLS_DIR": str(run / "keys") if secured else ""}
        here = [sys.executable, str(Path(__file__).resolve()), "--address", address, "--run", str(run)]
        self._started = [self._start([sys.executable, "-m", "services.router"])]
        self._started.append(self._start([*here, "--agent", "km"]))
        read, write = os.pipe()
        self._pl = self._start([*here, "--agent", "pl", "--out", str(write)], stdin=subprocess.PIPE, pass_fds=[write])
        os.close(write)
        self._started.append(self._pl)
        self._times = os.fdopen(read, "rb")
        self._beat = run / "pl.heartbeat.json"

    def found(self) -> None:
        """Wait until pl sees km."""
        until = time.monotonic() + START_S
        while not (self._beat.exists() and b'"km":1' in self._beat.read_bytes()):
            if time.monotonic() > until:
                raise typer.BadParameter(f"pl does not see km after {START_S:g} s; see {self._beat.parent}/logs")
            time.sleep(0.1)

    def _start(self, command: list[str], **more: Any) -> subprocess.Popen[bytes]:
        return subprocess.Popen(command, env=self._environment, stdout=subprocess.DEVNULL, **more)

    def block(self, answer: str, count: int) -> list[float]:
        """Times of so many questions, one after the other [us]."""
        assert self._pl.stdin is not None
        self._pl.stdin.write(msgspec.json.encode(Block(answer, count)) + b"\n")
        self._pl.stdin.flush()
        if not select.select([self._times], [], [], WITHIN_S)[0]:
            raise typer.BadParameter(f"no answers of {answer} in {WITHIN_S:g} s: km or the router does not live")
        return msgspec.json.decode(self._times.readline(), type=list[float])

    def end(self) -> None:
        """Stop it, the router last."""
        for process in reversed(self._started):
            process.send_signal(signal.SIGTERM)
            process.wait(WITHIN_S)


def measure(folder: Path, blocks: int) -> None:
    """Both fleets, by turns; prints a row for each size."""
    plain, secured = Fleet(folder / "plain", secured=False), Fleet(folder / "secured", secured=True)
    try:
        for answer, count in SIZES.items():
            for fleet in (plain, secured):
                fleet.found()
                fleet.block(answer, 3 * count)
            turns = [(secured if number % 2 else plain).block(answer, count) for number in range(blocks)]
            tell(answer, turns)
    finally:
        secured.end()
        plain.end()
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


def tell(answer: str, turns: list[list[float]]) -> None:
    """A row from blocks that are plain, secured, plain, ..., plain."""
    one, other = ([t for block in turns[first::2] for t in block] for first in (0, 1))
    mine, theirs = (statistics.quantiles(times, n=100) for times in (one, other))
    middles = [statistics.median(block) for block in turns]
    around = [2.0 * middles[at] / (middles[at - 1] + middles[at + 1]) for at in range(1, len(turns) - 1, 2)]
    low, _, high = statistics.quantiles(around, n=4)
    told = f"plain {mine[49]:.0f} / {mine[98]:.0f}, TLS and rights {theirs[49]:.0f} / {theirs[98]:.0f} us (p50 / p99)"
    ratio = f"ratio {theirs[49] / mine[49]:.2f} (blocks {low:.2f}-{high:.2f}; limit {LIMIT})"
    print(f"{answer:>7}: {told}; {ratio}, n {len(other)}", flush=True)


def serve(name: str, address: str, run: Path, out: int) -> int:
    """Be km or pl."""
    keys = Path(os.environ["ROCO_TLS_DIR"]) if os.environ["ROCO_TLS_DIR"] else None
    options = Options(connect=address, run_dir=run, system=SYSTEM, log_level="error", keys=keys)
    agent: Agent[Any] = km() if name == "km" else pl()
    return shell.run(agent, wiring(name, SYSTEM), options, lambda post: Store() if name == "km" else Turns(post, out))


def main(
    quick: Annotated[bool, typer.Option(help="A few blocks.")] = False,
    agent: Annotated[str, typer.Option(hidden=True)] = "",
    address: Annotated[str, typer.Option(hidden=True)] = "",
    run: Annotated[Path, typer.Option(hidden=True)] = Path(),
    out: Annotated[int, typer.Option(hidden=True)] = 0,
) -> None:
    """Measure what mutual TLS and the rights cost."""
    if agent:
        raise typer.Exit(serve(agent, address, run, out))
    with tempfile.TemporaryDirectory(prefix="tls-") as place:
        measure(Path(place), 7 if quick else BLOCKS)


if __name__ == "__main__":
    typer.run(main)
