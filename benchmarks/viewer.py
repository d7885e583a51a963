"""A frozen viewer and the fleet: round trips on C4 without a viewer, with one that is frozen, without again (A-B-A).

    python benchmarks/viewer.py [--frozen 300] [--freeze viewer|drawing] [--again]

Router, monitor (which records, judges and draws), km and pl are processes as in a fleet; pl asks km 50 questions a
second, and a recorded robot's telemetry and truth go by at 20 Hz. In B Rerun's viewer (under Xvfb) is connected to the
monitor's pictures and then stopped by SIGSTOP; with --freeze drawing it is the process that draws, so that the queue in
the monitor fills. The memory of monitor, drawing and server is read each second. A row is appended to
results/viewer.jsonl; a commit that has one as long is not measured again.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import msgspec
import tables
import typer
from fleets import tree
from round_trip import SYSTEM

from agent_runtime.io.sessions import free_endpoint
from companion.design import DESIGN

HERE = Path(__file__).resolve().parent
RESULTS = HERE / "results" / "viewer.jsonl"
WARM_S = 5.0
LIMIT = 1.1
READY_S = 60.0


class Phase(msgspec.Struct, frozen=True):
    """Round trips of a phase [us], and the most memory of each process in it [MB]."""

    name: str
    seconds: float
    n: int
    p50_us: float
    p99_us: float
    rss_mb: dict[str, float]


class Row(msgspec.Struct, frozen=True):
    """A-B-A. `ratio`: p99 of B by the mean of both A; `dropped`: samples that were not shown, by the monitor's log."""

    run: str
    at: float
    load: tuple[float, ...]
    freeze: str
    frozen_s: float
    ratio: float
    phases: tuple[Phase, ...]
    dropped: int


class Bench:
    """The processes, and what is read off them."""

    def __init__(self, run: Path, stack: ExitStack) -> None:
        self.run, self._stack, self.endpoint = run, stack, free_endpoint()
        words = {"ROCO_CONNECT": self.endpoint, "ROCO_LISTEN": self.endpoint, "ROCO_SYSTEM": SYSTEM}
        words["ROCO_AGENTS"] = ",".join(f"{name}={free_endpoint()}" for name in DESIGN.agents)
        words |= {"ROCO_RUN_DIR": str(run), "ROCO_VIEW": "on", "ROCO_LOG_LEVEL": "warning"}
        self._environment = os.environ | words
        self.spawn([sys.executable, "-P", "-m", "services.router"])
        self._wait("router.ready")
        self.monitor = self.spawn([sys.executable, "-P", "-m", "services.monitor"])
        self._wait("view.json")
        for name in ("km", "robot", "pl"):
            self.spawn([sys.executable, str(HERE / "viewer_load.py"), name, self.endpoint, str(run)])
        self._wait("trips")

    def spawn(self, words: list[str]) -> int:
        """A process that ends with the measurement; its pid."""
        with (self.run / "bench.log").open("ab") as log:
            process = subprocess.Popen(
                words, env=self._environment, stdout=log, stderr=log, stdin=subprocess.DEVNULL, start_new_session=True
            )
        self._stack.callback(_end, process)
        return process.pid

    def viewer(self) -> int:
        """A viewer that is connected and draws."""
        grpc = msgspec.json.decode((self.run / "view.json").read_bytes())["grpc"]
        program = Path(sys.executable).with_name("rerun")
        words = ["xvfb-run", "-a", "-s", "-screen 0 800x600x24", str(program)]
        return self.spawn([*words, "--connect", f"rerun+http://127.0.0.1:{grpc}/proxy"])

    def watched(self) -> dict[str, int]:
        """Monitor, drawing, server: name -> pid."""
        return dict(zip(("monitor", "drawing", "server"), (*tree(self.monitor), 0, 0), strict=False))

    def phase(self, name: str, seconds: float) -> Phase:
        """So many seconds after WARM_S."""
        time.sleep(WARM_S)
        begin, most = time.time(), dict[str, float]()
        while time.time() < begin + seconds:
            for who, pid in self.watched().items():
                most[who] = max(most.get(who, 0.0), _rss_mb(pid))
            print(f"\r{name}: {time.time() - begin:4.0f} of {seconds:.0f} s", end="", file=sys.stderr, flush=True)
            time.sleep(1.0)
        print(file=sys.stderr)
        pairs = (line.split() for line in (self.run / "trips").read_text().splitlines() if line.count(" ") == 1)
        trips = sorted(float(us) for at, us in pairs if begin < float(at) < begin + seconds)
        if len(trips) < 100:
            raise typer.BadParameter(f"{len(trips)} round trips in {seconds:.0f} s: see {self.run}/bench.log")
        middle, last = trips[len(trips) // 2], trips[len(trips) * 99 // 100]
        return Phase(name, seconds, len(trips), middle, last, {who: round(mb, 1) for who, mb in most.items()})

    def _wait(self, name: str) -> None:
        end = time.monotonic() + READY_S
        while not (self.run / name).exists():
            if time.monotonic() > end:
                raise typer.BadParameter(f"no {name} after {READY_S:.0f} s: see bench.log and rerun.log in {self.run}")
            time.sleep(0.1)


def measure(run: Path, freeze: str, frozen_s: float) -> Row:
    """A-B-A, each as long: p99 of a minute is that of a few dozen trips."""
    with ExitStack() as stack:
        bench = Bench(run, stack)
        first = bench.phase("without", frozen_s)
        viewer = bench.viewer()
        time.sleep(15.0)  # it connects, takes what there is, draws
        stopped = tree(viewer) if freeze == "viewer" else [bench.watched()["drawing"]]
        for pid in stopped:
            os.kill(pid, signal.SIGSTOP)
        if freeze != "viewer":
            _kill(tree(viewer))
        held = bench.phase(f"{freeze} frozen", frozen_s)
        if freeze == "viewer":
            _kill(stopped)
        else:
            os.kill(stopped[0], signal.SIGCONT)
        last = bench.phase("without again", frozen_s)
    ratio = held.p99_us / ((first.p99_us + last.p99_us) / 2)
    return Row(
        tables.commit(),
        time.time(),
        os.getloadavg(),
        freeze,
        frozen_s,
        round(ratio, 3),
        (first, held, last),
        _dropped(run),
    )


def main(
    frozen: Annotated[float, typer.Option(help="seconds that it is frozen")] = 300.0,
    freeze: Annotated[str, typer.Option(help="viewer, or drawing: the monitor's child")] = "viewer",
    again: Annotated[bool, typer.Option("--again", help="although this commit has a row")] = False,
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = RESULTS,
) -> None:
    """Measure, print, append. Exits with 1 where p99 with the frozen one is more than a tenth above that without."""
    if freeze not in ("viewer", "drawing"):
        raise typer.BadParameter(f"--freeze {freeze}: viewer or drawing")
    lines = out.read_bytes().splitlines() if out.exists() else []
    rows = [msgspec.json.decode(line, type=Row) for line in lines]
    if not again and any((r.run, r.freeze) == (tables.commit(), freeze) and r.frozen_s >= frozen for r in rows):
        print(f"{out} has a row of {tables.commit()}; --again measures once more")
        return
    with tempfile.TemporaryDirectory(prefix="roco-viewer-") as folder:
        row = measure(Path(folder), freeze, frozen)
    tables.append(out, row)
    for phase in row.phases:
        memory = ", ".join(f"{who} {mb:.0f} MB" for who, mb in phase.rss_mb.items())
        print(f"{phase.name:16} {phase.n:6} trips  p50 {phase.p50_us:7.0f} us  p99 {phase.p99_us:8.0f} us  {memory}")
    print(f"p99 with {freeze} frozen / without: {row.ratio:.3f} (at most {LIMIT})")
    print(f"load {row.load[0]:.1f}; not shown: {row.dropped} samples")
    raise typer.Exit(0 if row.ratio <= LIMIT else 1)


def _kill(pids: list[int]) -> None:
    for pid in pids:
        if Path(f"/proc/{pid}").exists():
            os.kill(pid, signal.SIGKILL)


def _rss_mb(pid: int) -> float:
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    except (OSError, IndexError):
        return 0.0


def _dropped(run: Path) -> int:
    """Return the count that the monitor reported at its end; -1: none."""
    for line in (run / "logs" / "monitor.jsonl").read_text().splitlines():
        told = msgspec.json.decode(line)
        if told.get("event") == "shown":
            return int(told.get("dropped", -1))
    return -1


def _end(process: subprocess.Popen[bytes]) -> None:
    """In order, else by kill, with all that it started."""
    started = tree(process.pid)
    process.terminate()
    try:
        process.wait(30.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    _kill([pid for pid in started if pid != process.pid])


if __name__ == "__main__":
    typer.run(main)
