"""Many robots' thinking agents on one router, as shipped (TLS, rights, journals): all ask at the
same time.

Each robot is a planner and a knowledge manager with all that they have in their processes; see
round_trip.py. A row has the time of a question in a system of this number of robots, what was asked
and answered, and the router's memory.

    python benchmarks/many.py --robots 1,5,10,20
"""

import os
import statistics
import subprocess
import tempfile
import threading
import time
from pathlib import Path
from typing import Annotated, Any

import msgspec
import tables
import typer
from as_shipped import RUN, middle_and_end
from fleets import SHIPPED, WITHIN_S, Fleet, Kind
from round_trip import Block

HERE = Path(__file__).parent
ANSWER, QUESTIONS, WARM = "654 B", 200, 20  # of a robot; the mean size of C4 (paper, section 5.7)


class Robots(Fleet):
    """One router, and a pair of agents for each robot."""

    def __init__(self, run: Path, count: int) -> None:
        self._names = tuple(f"robot{number}" for number in range(count))
        super().__init__(
            run, msgspec.structs.replace(SHIPPED, monitored=False), systems=self._names
        )

    def _begin(self, kind: Kind) -> None:
        self._environment |= {"ROCO_SYSTEM": self._names[0], "ROCO_SYSTEMS": ",".join(self._names)}
        self._serve("services.router", "router.ready")
        self.router = self._started[0].pid
        self._lines: list[tuple[Any, Any]] = []
        for name in self._names:
            folder = self._run / name
            folder.mkdir()
            keys = self._run / "keys" / (name if len(self._names) > 1 else "")
            self._environment |= {
                "ROCO_SYSTEM": name,
                "ROCO_RUN_DIR": str(folder),
                "ROCO_TLS_DIR": str(keys),
            }
            self._environment["ROCO_AGENTS"] = self._agents()
            read, write = os.pipe()
            self._role("km", write, folder)
            asker = self._role("pl", write, folder, stdin=subprocess.PIPE)
            os.close(write)
            self._lines.append((asker.stdin, os.fdopen(read, "rb")))
        for name in self._names:
            beat = self._run / name / "pl.heartbeat.json"
            self._wait(
                lambda beat=beat: beat.exists() and b'"km":1' in beat.read_bytes(),
                f"{name}, whose pl",
            )

    def ask(self, count: int) -> list[list[float]]:
        """Times of `count` questions of each robot [us], all robots at once; fewer where an answer
        did not come.
        """
        taken: list[list[float]] = [[] for _ in self._lines]

        def one(number: int) -> None:
            asking, times = self._lines[number]
            asking.write(msgspec.json.encode(Block(ANSWER, count)) + b"\n")
            asking.flush()
            taken[number] = msgspec.json.decode(times.readline(), type=list[float])

        threads = [
            threading.Thread(target=one, args=(number,), daemon=True)
            for number in range(len(taken))
        ]
        for thread in threads:
            thread.start()
        until = time.monotonic() + WITHIN_S
        for thread in threads:
            thread.join(max(0.0, until - time.monotonic()))
        return taken


def memory_mb(pid: int) -> float:
    """Resident memory of a process."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return round(pages * os.sysconf("SC_PAGE_SIZE") / 1e6, 1)


def measured(count: int) -> dict[str, Any]:
    """One number of robots, as a line of the results file."""
    before = os.getloadavg()
    with tempfile.TemporaryDirectory(prefix="many-") as folder:
        robots = Robots(Path(folder) / "run", count)
        try:
            robots.ask(WARM)
            began = time.monotonic()
            times = robots.ask(QUESTIONS)
            took = time.monotonic() - began
            memory = memory_mb(robots.router)
        finally:
            robots.end()
    every = sorted(one for some in times for one in some)
    medians = [statistics.median(some) for some in times if some]
    return {
        "run": RUN, "robots": count, "asked": count * QUESTIONS, "answered": len(every),
        "us": middle_and_end(every),
        "slowest_robot_us": round(max(medians), 1), "a_second": round(len(every) / took),
        "router_MB": memory,
        "load_before": before, "load": os.getloadavg(),
    }  # fmt: skip


def main(
    robots: Annotated[str, typer.Option(help="numbers of robots, comma between")] = "1,5,10,20",
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = HERE
    / "results/many.jsonl",
) -> None:
    """Measure, print and append."""
    for count in map(int, robots.split(",")):
        line = measured(count)
        tables.append(out, line)
        typer.echo(
            f"{count} robots: {line['answered']} of {line['asked']} answered, p50, p99 {line['us']}"
            f" us, {line['a_second']} a second, router {line['router_MB']} MB, load"
            f" {line['load'][0]:.1f}"
        )


if __name__ == "__main__":
    typer.run(main)
