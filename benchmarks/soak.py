"""A hundred thousand communicates between two processes, with 100 cuts and 100 kill -9: none lost,
doubled, misordered.

Router with TLS and rights as `roco up` starts it, a wire each way between the agents
(operate.fault_proxy), and the agents of soak_agents.py, which are linked. The first half has the
cuts, every fourth longer than Zenoh's lease; the second half the kills: ta and ex by turns, each
fifth time the router. One row of results/soak.jsonl for each 1000 communicates. It may be ended at
any time: it goes on from the journals in the run folder. `--table` writes docs/results/faults.md.

    nice python benchmarks/soak.py
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import msgspec
import tables
import typer
from soak_agents import SYSTEM, Memory, answerer, asker

from agent_runtime.core.state import restored
from agent_runtime.io import issuing
from agent_runtime.io.journal import last_record
from agent_runtime.io.reaching import free_port
from agent_runtime.io.sessions import free_endpoint
from companion.design import DESIGN
from operate.fault_proxy import files
from operate.fault_proxy.files import Wires

HERE = Path(__file__).resolve().parent
RESULTS, PAGE = HERE / "results/soak.jsonl", HERE.parent / "docs/results/faults.md"
BEGIN, END = "<!-- soak: python benchmarks/soak.py --table -->\n", "<!-- /soak -->\n"
EACH = 3
"""Communicates of an exchange: request, agree, inform."""
ROWS, ROW = 100, 1000
CUT_S, LONG_CUT_S = 0.3, 3.0
"""The long one is longer than Zenoh's lease of 2 s: the connection breaks."""
PATIENCE_S = 300.0  # estimate: a row takes some seconds, a process is back after 10 at most


class Processes:
    """Router, wires and agents of one run folder."""

    def __init__(self, run: Path, exchanges: int) -> None:
        self.run, self._exchanges = run, exchanges
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._address, self._agents = free_endpoint().replace("tcp/", "tls/"), dict[str, str]()
        issuing.issue(run / "keys", DESIGN, (SYSTEM,), keep_days=1.0)
        listen, dialled = ({name: free_port() for name in ("ta", "ex")} for _ in range(2))
        ports = {name: {other: dialled[name]} for name, other in (("ta", "ex"), ("ex", "ta"))}
        files.tell(run, Wires({name: ("127.0.0.1", port) for name, port in listen.items()}, ports))
        for name, others in ports.items():
            at = {name: listen[name], **others}
            self._agents[name] = ",".join(f"{one}=tls/127.0.0.1:{port}" for one, port in at.items())
        for name in ("router", "wires", "ta", "ex"):
            self.start(name)

    def start(self, name: str) -> None:
        """Start a process and wait until it says that it is ready."""
        told = {
            "LISTEN": self._address,
            "RUN_DIR": str(self.run),
            "SYSTEM": SYSTEM,
            "LOG_LEVEL": "warning",
        }
        told |= {"TLS_DIR": str(self.run / "keys"), "AGENTS": self._agents.get(name, "")}
        told["LISTEN"] = "" if name in self._agents else self._address
        module = {"router": "services.router", "wires": "operate.fault_proxy"}.get(name)
        agent = [name, self._address, str(self.run), str(self._exchanges)]
        environment = os.environ | {f"ROCO_{key}": value for key, value in told.items()}
        (self.run / f"{name}.ready").unlink(missing_ok=True)
        with (self.run / "soak.log").open("ab") as log:
            script = [sys.executable, str(HERE / "soak_agents.py"), *agent]
            words = [sys.executable, "-P", "-m", module] if module else script
            self._running[name] = subprocess.Popen(words, env=environment, stdout=log, stderr=log)
        if name not in self._agents:  # an agent is ready once its peer answers
            self.wait(lambda: (self.run / f"{name}.ready").exists(), f"{name} is ready")

    def kill(self, name: str) -> None:
        """Kill -9 and start again."""
        self._running[name].kill()
        self._running[name].wait()
        self.start(name)

    def cut(self, name: str, seconds: float) -> None:
        """Let nothing through between the agents for some time."""
        files.put(self.run, name, "cut", 1.0)
        time.sleep(seconds)
        files.put(self.run, name, "cut", None)

    def memory_mb(self) -> dict[str, float]:
        """Return the resident memory of each process."""
        found = {}
        for name, process in self._running.items():
            pages = int(Path(f"/proc/{process.pid}/statm").read_text().split()[1])
            found[name] = round(pages * os.sysconf("SC_PAGESIZE") / 2**20, 1)
        return found

    def said(self) -> int:
        """Return how many communicates are known to have been taken."""
        try:
            return (
                EACH
                * msgspec.json.decode((self.run / "ta.progress").read_bytes(), type=Memory).taken
            )
        except (OSError, msgspec.DecodeError):
            return 0

    def wait(self, true: Callable[[], bool], what: str) -> None:
        """Wait until something is true."""
        until = time.monotonic() + PATIENCE_S
        while not true():
            for name, process in self._running.items():
                if process.poll() is not None:
                    raise RuntimeError(
                        f"{name} ended by itself with {process.returncode}; see {self.run}/soak.log"
                    )
            if time.monotonic() > until:
                raise TimeoutError(f"not in {PATIENCE_S:g} s: {what}; see {self.run}/soak.log")
            time.sleep(0.02)

    def end(self) -> None:
        """Stop all, the router last."""
        for name in ("ta", "ex", "wires", "router"):
            if name in self._running:
                self._running[name].terminate()
                self._running[name].wait(30.0)


def memories(run: Path) -> dict[str, Memory]:
    """Return what stands in the journals."""
    found = {}
    for name, agent in (("ta", asker(0)), ("ex", answerer())):
        record = last_record((run / "journal" / f"{name}.journal").read_bytes())
        found[name] = Memory() if record is None else restored(agent, record).memory
    return found


def disturb(processes: Processes, row: int, half: int) -> dict[str, int]:
    """Do harm; how often of each kind. `half`: 0 when a row begins, 1 in its middle."""
    number = 2 * row + half
    if row < ROWS // 2:
        processes.cut(("ta", "ex")[number % 2], LONG_CUT_S if number % 4 == 3 else CUT_S)
        return {"cuts": 1}
    victim = "router" if number % 5 == 4 else ("ta", "ex")[number % 2]
    processes.kill(victim)
    return {"kills": 1}


def measure(processes: Processes, row: int) -> dict[str, Any]:
    """Run one row; its line."""
    begin, before = time.monotonic(), processes.said()
    line: dict[str, Any] = {"row": row, "load": round(os.getloadavg()[0], 1), "cuts": 0, "kills": 0}
    for half in (0, 1):
        processes.wait(
            lambda half=half: processes.said() >= row * ROW + half * ROW // 2, f"row {row}.{half}"
        )
        line |= {kind: line[kind] + count for kind, count in disturb(processes, row, half).items()}
    processes.wait(lambda: processes.said() >= (row + 1) * ROW - EACH, f"the end of row {row}")
    found = {
        name: msgspec.structs.asdict(memory) for name, memory in memories(processes.run).items()
    }
    line |= {
        "communicates": processes.said() - before,
        "seconds": round(time.monotonic() - begin, 1),
    }
    return line | {"memory_mb": processes.memory_mb(), "journals": found}


def printed(lines: list[dict[str, Any]]) -> str:
    """Return what came out, in a few sentences and a table of memory."""
    last, loads = lines[-1]["journals"], [line["load"] for line in lines]
    bad = {
        what: sum(agent[what] for agent in last.values())
        for what in ("lost", "doubled", "unordered")
    }
    total = EACH * last["ta"]["taken"]
    cuts, kills = (sum(line[what] for line in lines) for what in ("cuts", "kills"))
    seconds = sum(line["seconds"] for line in lines)
    rows = [
        (
            f"{total:,} communicates in {seconds / 60:.0f} minutes with {cuts} cuts and {kills}"
            f" kills: {bad['lost']} lost, {bad['doubled']} doubled, {bad['unordered']} out of"
            f" order; 2 cores, other work beside it\n(load {min(loads):g} to {max(loads):g})."
        ),
        "",
        f"| memory after communicates [MB] | {' | '.join(lines[0]['memory_mb'])} |",
        "|---" * (1 + len(lines[0]["memory_mb"])) + "|",
    ]
    for line in [one for one in lines if one["row"] in (0, 9, 19, 29, 39, 49, 74, 99)]:
        values = " | ".join(f"{value:.0f}" for value in line["memory_mb"].values())
        rows.append(f"| {(line['row'] + 1) * ROW:,} | {values} |")
    return "\n".join(rows) + "\n"


def main(
    run: Annotated[Path, typer.Option(help="run folder, kept until all is done")] = Path(
        "runs/soak"
    ),
    rows: Annotated[int, typer.Option(help="end after row number")] = ROWS,
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = RESULTS,
    table: Annotated[
        bool, typer.Option("--table", help="write the table into docs/results/faults.md, and end")
    ] = False,
) -> None:
    """Run the rows that do not stand in the results file yet."""
    lines = tables.read(out)
    if table:
        tables.put(PAGE, BEGIN, printed(lines), END)
        return
    run.mkdir(parents=True, exist_ok=True)
    processes = Processes(run.resolve(), -(-ROWS * ROW // EACH))
    try:
        for row in range(len(lines), rows):
            line = measure(processes, row)
            tables.append(out, line)
            typer.echo(f"{row}: {line['seconds']} s, {line['memory_mb']}, {line['journals']}")
    finally:
        processes.end()


if __name__ == "__main__":
    typer.run(main)
