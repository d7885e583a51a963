"""Time for which a killed process is away: `kill -9` of each, repeatedly, until the supervisor says
it is ready again.

One fleet at rest, each process in turn; noticed: the supervisor says that it does not run, and of
an agent the last of its neighbours that it is gone. Appends to a results file.

    python benchmarks/coming_back.py --hang freeze
    python benchmarks/coming_back.py --hang loop --processes hi,co,pl,km,ta,ex
    python benchmarks/coming_back.py --kills 20
    python benchmarks/coming_back.py --target deploy --called containers \\
        --processes router,monitor,hi,co,pl,km,ta,ex

With --target the fleet is up already, in containers too, and `roco fault kill` does it and looks.
`--table` writes the tables of docs/results/faults.md.
"""

import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import msgspec
import tables
import typer

from companion.design import DESIGN
from operate.fault_lines import Fault
from operate.fleet_file import Fleet, ProcessState, ProcessStatus
from operate.supervisor.core import SETTLED_S

PATIENCE_S = 90.0  # estimate: km is back after 4 s on a quiet machine
LOOK_S = 0.002
ROCO = str(Path(sys.executable).with_name("roco"))
RESULTS = Path(__file__).parent / "results/coming_back.jsonl"
PAGE = Path(__file__).parents[1] / "docs/results/faults.md"
BEGIN, END = (
    "<!-- coming back: python benchmarks/coming_back.py --table -->\n",
    "<!-- /coming back -->\n",
)
PEERS = {agent: tuple(sorted(DESIGN.peers(agent))) for agent in DESIGN.agents}
PROCESSES = ("router", "monitor", "loop", "hi", "co", "pl", "km", "ta", "ex")


def status(run: Path, name: str) -> ProcessStatus:
    """Return what the supervisor says of a process."""
    fleet = msgspec.json.decode((run / "fleet.json").read_bytes(), type=Fleet)
    return next(one for one in fleet.processes if one.name == name)


def after(reached: Callable[[], bool]) -> float:
    """Wait for it; return the time it took [s]."""
    began = time.monotonic()
    while not reached():
        if time.monotonic() - began > PATIENCE_S:
            raise typer.BadParameter("it did not come back; see the logs of the run")
        time.sleep(LOOK_S)
    return time.monotonic() - began


def again(run: Path, name: str, before: int) -> bool:
    """Whether a process is ready that had another pid before."""
    now = status(run, name)
    return now.state is ProcessState.READY and now.pid != before


class Neighbours:
    """Of an agent, none of another process: after how long the last of them wrote that it is gone,
    from now on.
    """

    def __init__(self, run: Path, name: str) -> None:
        self._name, logs = name, (run / "logs" / f"{one}.jsonl" for one in PEERS.get(name, ()))
        self._ends = {log: log.stat().st_size for log in logs}
        self._began = time.time()

    def told(self) -> float | None:
        """Wait until all have written it [s]; None where there are none."""
        after(lambda: all(map(self._gone, self._ends)))
        return max(map(self._gone, self._ends)) - self._began if self._ends else None

    def _gone(self, log: Path) -> float:
        with log.open("rb") as file:
            file.seek(self._ends[log])
            lines = [
                msgspec.json.decode(line) for line in file.read().rpartition(b"\n")[0].splitlines()
            ]
        gone = (
            one["t"]
            for one in lines
            if (one.get("peer"), one.get("incarnation")) == (self._name, "gone")
        )
        return next(gone, 0.0)


def killed(run: Path, name: str) -> tuple[float, float, float | None]:
    """Kill a process; return after how long that was noticed, it was ready again, and its
    neighbours knew [s].
    """
    before, neighbours = status(run, name), Neighbours(run, name)
    os.kill(before.pid, signal.SIGKILL)
    noticed = after(lambda: status(run, name).state is not ProcessState.READY)
    rest = after(lambda: again(run, name, before.pid))
    return noticed, noticed + rest, neighbours.told()


def noticed_hang(run: Path, name: str, begin: signal.Signals) -> tuple[float, float | None]:
    """Freeze a process (SIGSTOP), or hang its Python loop (SIGUSR1).

    Return after how long the supervisor told it, and after how long the neighbours of a frozen one
    knew [s]. The frozen one goes on; the hung one is killed and waited for until it is ready again.
    """
    before, neighbours = status(run, name), Neighbours(run, name)
    os.kill(before.pid, begin)
    noticed, gone = after(lambda: status(run, name).note.startswith("hangs")), None
    if begin is signal.SIGSTOP:
        gone = neighbours.told()
        os.kill(before.pid, signal.SIGCONT)
        after(lambda: not status(run, name).note)
    else:
        after(lambda: again(run, name, before.pid))
    return noticed, gone


def with_hanging(where: Path) -> dict[str, str]:
    """Return an environment in which SIGUSR1 hangs the main thread of a Python process, and of none
    else.
    """
    where.mkdir()
    hang = (
        "import signal\ndef hang(number, frame):\n    while True:"
        " pass\nsignal.signal(signal.SIGUSR1, hang)\n"
    )
    (where / "sitecustomize.py").write_text(hang)
    return {**os.environ, "PYTHONPATH": str(where)}


HANGS = {"freeze": signal.SIGSTOP, "loop": signal.SIGUSR1}


def hangs(run: Path, how: str, names: list[str], times: int, out: Path) -> None:
    """Freeze or hang each process in turn, and say how long that took to be told."""
    seen: dict[str, list[tuple[float, float | None]]] = {name: [] for name in names}
    load = os.getloadavg()[0]
    for number in range(times):
        for name in names:
            seen[name].append(noticed_hang(run, name, HANGS[how]))
        typer.echo(f"{number + 1} of {times}", err=True)
    loads = [round(load, 2), round(os.getloadavg()[0], 2)]
    for name, found in seen.items():
        line = {"hang": how, "of": name, "times": times, "load": loads}
        _told(
            out,
            line
            | measured(noticed_s=[one for one, _ in found], neighbours_s=[one for _, one in found]),
        )


def killed_by_order(target: str, name: str) -> float:
    """Kill a process of a fleet that is up, by `roco fault kill`; return after how long it was
    ready again [s].
    """
    words = [ROCO, "fault", "kill", name, "--target", target, "--format", "json"]
    done = subprocess.run(words, check=False, capture_output=True, text=True)
    if done.returncode:
        raise typer.BadParameter(f"{name} was killed and is not back: {done.stderr.strip()}")
    fault = msgspec.json.decode(done.stdout, type=Fault)
    assert fault.ended is not None
    return fault.ended - fault.began


def ordered(target: str, called: str, names: list[str], kills: int, out: Path) -> None:
    """Kill the processes of a fleet that is up, in turn; results are of a fleet `called` so."""
    seen: dict[str, list[float]] = {name: [] for name in names}
    load = os.getloadavg()[0]
    for number in range(kills):
        for name in names:
            seen[name].append(killed_by_order(target, name))
        typer.echo(f"{number + 1} of {kills}", err=True)
    loads = [round(load, 2), round(os.getloadavg()[0], 2)]
    for name, times in seen.items():
        _told(
            out,
            {
                "target": called,
                "process": name,
                "kills": kills,
                "load": loads,
                "ready_s": figures(times),
            },
        )


def figures(times: list[float]) -> dict[str, float]:
    """Return the median and the 95th percentile [s]."""
    cuts = statistics.quantiles(times, n=20, method="inclusive")
    return {"p50": round(cuts[9], 3), "p95": round(cuts[18], 3)}


def measured(**times: list[Any]) -> dict[str, dict[str, float]]:
    """Return the figures of each kind of time that was measured."""
    return {name: figures(found) for name, found in times.items() if None not in found}


def main(
    kills: Annotated[int, typer.Option(help="of each process")] = 20,
    processes: Annotated[str, typer.Option()] = ",".join(PROCESSES),
    hang: Annotated[str, typer.Option(help="freeze, or loop: do that instead of a kill")] = "",
    target: Annotated[
        str, typer.Option(help="a fleet that is up: a compose project, or a run's folder")
    ] = "",
    called: Annotated[str, typer.Option(help="its name in the table")] = "",
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = RESULTS,
    table: Annotated[
        bool, typer.Option("--table", help="write the tables into docs/results/faults.md, and end")
    ] = False,
) -> None:
    """Kill the processes in turn, and say how long each was away."""
    if table:
        tables.put(PAGE, BEGIN, printed(tables.read(out)), END)
        return
    if target:
        ordered(target, called or target, processes.split(","), kills, out)
        return
    base = Path(tempfile.mkdtemp(prefix="coming-back-"))
    run, environment = base / "run", with_hanging(base / "hang") if hang else None
    subprocess.run([ROCO, "up", "--out", str(run)], check=True, stdout=sys.stderr, env=environment)
    if hang:
        try:
            hangs(run, hang, processes.split(","), kills, out)
        finally:
            subprocess.run([ROCO, "down", "--run-dir", str(run)], check=True, stdout=sys.stderr)
        return
    names = processes.split(",")
    seen: dict[str, list[tuple[float, float, float | None]]] = {name: [] for name in names}
    load = os.getloadavg()[0]
    try:
        for number in range(kills):
            round_began = time.monotonic()
            for name in names:
                seen[name].append(killed(run, name))
            # Else the supervisor takes the next death for one in a row, and waits for longer.
            time.sleep(
                max(0.0, round_began + SETTLED_S + 1.0 - time.monotonic())
                if number + 1 < kills
                else 0.0
            )
            typer.echo(f"{number + 1} of {kills}", err=True)
    finally:
        subprocess.run([ROCO, "down", "--run-dir", str(run)], check=True, stdout=sys.stderr)
    loads = [round(load, 2), round(os.getloadavg()[0], 2)]
    for name, times in seen.items():
        noticed, ready, neighbours = map(list, zip(*times, strict=True))
        line: dict[str, Any] = {"process": name, "kills": kills, "load": loads}
        _told(out, line | measured(noticed_s=noticed, ready_s=ready, neighbours_s=neighbours))


def printed(lines: list[dict[str, Any]]) -> str:
    """Return a table of the processes, a column for each kind of fleet, and one of hangs."""
    killed = [line for line in lines if "process" in line]
    fleets = list(dict.fromkeys(line.get("target", "") for line in killed))
    found = {(line.get("target", ""), line["process"]): line for line in killed}
    heads = [f"ready again{f': {name}' if name else ''}" for name in fleets]
    rows = [
        f"| process | noticed | by its neighbours | {' | '.join(heads)} |",
        "|---" * (len(fleets) + 3) + "|",
    ]
    for process in dict.fromkeys(line["process"] for line in killed):
        cells = [found.get((name, process), {}) for name in fleets]
        noticed, known = (
            _times(found.get(("", process), {}).get(name)) for name in ("noticed_s", "neighbours_s")
        )
        rows.append(
            f"| {process} | {noticed} | {known} |"
            f" {' | '.join(_times(one.get('ready_s')) for one in cells)} |"
        )
    of = [next(line for (name, _), line in found.items() if name == fleet) for fleet in fleets]
    kills = [f"{line['kills']}, {_loads(line)}" for line in of]
    rows.append(f"| kills of each, load | | | {' | '.join(kills)} |")
    return "\n".join((*rows, *_hung([line for line in lines if "hang" in line]))) + "\n"


def _hung(lines: list[dict[str, Any]]) -> list[str]:
    """Return a table of the times until a hang was told."""
    if not lines:
        return []
    found = {(line["hang"], line["of"]): line for line in lines}
    ways = list(dict.fromkeys(line["hang"] for line in lines))
    heads = (f"{way}: told after" for way in ways)
    rows = [
        "",
        f"| process | {' | '.join(heads)} | freeze: by its neighbours |",
        "|---" * (len(ways) + 2) + "|",
    ]
    for process in dict.fromkeys(line["of"] for line in lines):
        cells = (_times(found.get((way, process), {}).get("noticed_s")) for way in ways)
        known = _times(found.get(("freeze", process), {}).get("neighbours_s"))
        rows.append(f"| {process} | {' | '.join(cells)} | {known} |")
    loads = (
        f"{one['times']}, {_loads(one)}"
        for one in (next(v for k, v in found.items() if k[0] == way) for way in ways)
    )
    return [*rows, f"| times of each, load | {' | '.join(loads)} | |"]


def _times(told: dict[str, float] | None) -> str:
    return f"{told['p50']:.3g}, {told['p95']:.3g} s" if told else ""


def _loads(line: dict[str, Any]) -> str:
    return " to ".join(f"{load:.0f}" for load in sorted(line["load"]))


def _told(out: Path, line: dict[str, Any]) -> None:
    tables.append(out, line)
    typer.echo(str(line))


if __name__ == "__main__":
    typer.run(main)
