"""A stolen key that floods: the memory and disk of whom it hits, and how long the other peers wait
meanwhile.

A router with keys and rights, co, and the monitor, as `roco up` has them. A thief with hi's key
dials co and puts as many messages a second as asked on keys that hi has a right to; a session with
ta's key asks co for a pong again and again.

    python benchmarks/floods.py --kinds gap,ping --rate 10000 --seconds 10
"""

import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
import zenoh

from agent_runtime.core.events import Receipt
from agent_runtime.io import issuing
from agent_runtime.io.secured import client_tls
from agent_runtime.io.sessions import client_config, free_endpoint
from companion.design import DESIGN
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative

SYSTEM = "roco"
REQUEST = f"roco/{SYSTEM}/C2/hi/co/request/request"
PATIENCE_S = 2.0
"""Without a pong the question is asked again, and counted as lost."""
TURN_S = 0.01
LOOKED_AT = ("co", "monitor")


def request(number: int, receiver: str = "co") -> bytes:
    """Return a request of hi with this number, without content."""
    return encode(
        Communicate(
            performative=Performative.REQUEST,
            sender="hi",
            receiver=receiver,
            protocol="request",
            conversation=f"hi-1-{number}",
            id=str(number),
        )
    )


def receipt(number: int) -> bytes:
    """Return a receipt of hi."""
    return msgspec.msgpack.encode(Receipt("co", taken=number))


KINDS: dict[str, tuple[str, Callable[[int], bytes]]] = {
    "none": ("", lambda i: b""),
    "gap": (REQUEST, lambda i: request(1_000_000 + i)),
    "copy": (REQUEST, lambda i: request(1)),
    "garbled": (REQUEST, lambda i: b"\xc1" * 200),
    "forged": (REQUEST, lambda i: request(1_000_000 + i, "ta")),
    "large": (REQUEST, lambda i: b"\xc1" * 1_000_000),
    "ping": (f"roco/{SYSTEM}/_/ping/hi/co", lambda i: b"C2"),
    "receipt": (f"roco/{SYSTEM}/_/receipt/hi/co", lambda i: receipt(0)),
    "token": (f"roco/{SYSTEM}/_/alive/hi/", lambda i: b""),
}


def thief(address: str, keys: Path, kind: str, rate: float, seconds: float) -> int:
    """Flood, and return how much was put."""
    key, made = KINDS[kind]
    session = zenoh.open(client_config(address, client_tls(keys, "hi")))
    began, put = time.monotonic(), 0
    tokens: list[Any] = []
    while (over := time.monotonic() - began) < seconds:
        while KINDS[kind][0] and put < over * rate and time.monotonic() - began < seconds:
            if kind == "token":
                tokens.append(session.liveliness().declare_token(f"{key}{1000 + put}"))
                if len(tokens) > 50:
                    tokens.pop(0).undeclare()
            else:
                session.put(key, made(put), congestion_control=zenoh.CongestionControl.BLOCK)
            put += 1
        time.sleep(TURN_S)
    session.close()  # type: ignore[no-untyped-call]
    return put


class Asker:
    """ta asks co for a pong, one after the other; `waits` [s], `lost`: without an answer in
    PATIENCE_S.
    """

    def __init__(self, address: str, keys: Path) -> None:
        self.waits, self.lost = list[float](), 0
        self._session = zenoh.open(client_config(address, client_tls(keys, "ta")))
        self._answered, self._over = threading.Event(), threading.Event()
        self._heard = self._session.declare_subscriber(
            f"roco/{SYSTEM}/_/pong/*/ta", lambda sample: self._answered.set()
        )
        self._thread = threading.Thread(target=self._ask)

    def begin(self) -> None:
        """Ask from now on."""
        self._thread.start()

    def _ask(self) -> None:
        while not self._over.wait(0.05):
            self._answered.clear()
            began = time.monotonic()
            self._session.put(
                f"roco/{SYSTEM}/_/ping/ta/co",
                b"C1",
                congestion_control=zenoh.CongestionControl.BLOCK,
            )
            if self._answered.wait(PATIENCE_S):
                self.waits.append(time.monotonic() - began)
            else:
                self.lost += 1

    def end(self) -> None:
        """Ask no more."""
        self._over.set()
        self._thread.join()
        self._session.close()  # type: ignore[no-untyped-call]


def memory_mb(pid: int, what: str) -> float:
    """Return a figure of /proc/PID/status [MB]."""
    line = next(
        line
        for line in Path(f"/proc/{pid}/status").read_text().splitlines()
        if line.startswith(what)
    )
    return int(line.split()[1]) / 1024


def disk(run: Path) -> dict[str, int]:
    """Return the size of each file of the run [bytes]."""
    files = (path for path in run.rglob("*") if path.is_file() and "keys" not in path.parts)
    return {str(path.relative_to(run)): path.stat().st_size for path in files}


def lines(run: Path) -> int:
    """Return the number of log lines of co and the monitor."""
    return sum(
        (run / name).read_bytes().count(b"\n") for name in ("logs/co.jsonl", "logs/monitor.jsonl")
    )


def measured(kind: str, rate: float, seconds: float) -> dict[str, Any]:
    """Flood a fleet of its own; return the figures."""
    with tempfile.TemporaryDirectory() as folder:
        run, keys = Path(folder), Path(folder) / "keys"
        issuing.issue(keys, DESIGN, (SYSTEM,))
        address = free_endpoint().replace("tcp/", "tls/")
        agents = {name: free_endpoint().replace("tcp/", "tls/") for name in DESIGN.agents}
        told = {
            "CONNECT": address,
            "RUN_DIR": folder,
            "SYSTEM": SYSTEM,
            "TLS_DIR": str(keys),
            "LISTEN": "",
        }
        told["AGENTS"] = ",".join(f"{name}={endpoint}" for name, endpoint in agents.items())
        environment = os.environ | {f"ROCO_{name}": value for name, value in told.items()}
        processes = {}
        try:
            for name, module in (
                ("router", "router"),
                ("monitor", "monitor"),
                ("co", "coordinator"),
            ):
                with (run / f"{name}.log").open("ab") as log:
                    command = [sys.executable, "-P", "-m", f"services.{module}"]
                    processes[name] = subprocess.Popen(
                        command, env=environment, stdout=log, stderr=log
                    )
                _wait(
                    lambda name=name: (
                        (run / f"{name}.ready").exists()
                        or (run / f"{name}.heartbeat.json").exists()
                    )
                )
            _wait(lambda: b'"up":true' in (run / "co.heartbeat.json").read_bytes())
            return _flooded(
                run,
                keys,
                agents["co"],
                {n: p.pid for n, p in processes.items()},
                kind,
                rate,
                seconds,
            )
        finally:
            for process in processes.values():
                process.kill()
                process.wait()


def _flooded(
    run: Path,
    keys: Path,
    address: str,
    pids: dict[str, int],
    kind: str,
    rate: float,
    seconds: float,
) -> dict[str, Any]:
    asker = Asker(address, keys)
    before, written, said = (
        {name: memory_mb(pids[name], "VmRSS") for name in LOOKED_AT},
        disk(run),
        lines(run),
    )
    asker.begin()
    command = [sys.executable, __file__, "--thief", kind, "--address", address, "--keys", str(keys)]
    command += ["--rate", str(rate), "--seconds", str(seconds)]
    put = int(subprocess.run(command, capture_output=True, check=True).stdout)
    time.sleep(2.0)
    asker.end()
    grown = {name: size - written.get(name, 0) for name, size in disk(run).items()}
    log = (run / "logs/co.jsonl").read_text()
    waits = sorted(asker.waits) or [0.0, 0.0]
    return {
        "kind": kind,
        "put": put,
        "memory_mb": {
            name: round(memory_mb(pids[name], "VmHWM") - before[name]) for name in LOOKED_AT
        },
        "router_mb": round(memory_mb(pids["router"], "VmHWM")),
        "log_lines": lines(run) - said,
        "disk_mb": round(sum(grown.values()) / 1e6, 1),
        "files_mb": {name: round(size / 1e6, 1) for name, size in grown.items() if size > 1e6},
        "neighbours_lost": log.count('"incarnation":"gone"'),
        "pongs": len(asker.waits),
        "lost": asker.lost,
        "p50_ms": round(1000 * statistics.median(waits), 1),
        "worst_ms": round(1000 * waits[-1], 1),
    }


def _wait(there: Callable[[], bool]) -> None:
    until = time.monotonic() + 60.0
    while not there():
        if time.monotonic() > until:
            raise typer.BadParameter("a process is not ready after 60 s")
        time.sleep(0.05)


def main(
    kinds: Annotated[str, typer.Option(help="Which floods.")] = ",".join(KINDS),
    rate: Annotated[
        float, typer.Option(help="Messages a second; of large ones a hundredth.")
    ] = 10_000.0,
    seconds: Annotated[float, typer.Option(help="How long.")] = 10.0,
    thief_of: Annotated[
        str, typer.Option("--thief", help="Be the thief (the script starts it).")
    ] = "",
    address: Annotated[str, typer.Option()] = "",
    keys: Annotated[Path, typer.Option()] = Path(),
) -> None:
    """Print a line of figures for each flood."""
    if thief_of:
        print(thief(address, keys, thief_of, rate / (100 if thief_of == "large" else 1), seconds))
        return
    for kind in kinds.split(","):
        print(msgspec.json.encode(measured(kind, rate, seconds)).decode(), flush=True)


if __name__ == "__main__":
    typer.run(main)
