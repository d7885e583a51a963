"""What mutual TLS and the rights cost: a word and its answer through two routers, by turns, in one run.

    python benchmarks/tls.py [--quick]

One router is plain, the other asks for certificates and grants the companion's rights. pl puts a query-ref on its key
of C4, km answers with an inform-ref of the size given; both are bare sessions with the fleet's settings: the ratio is
an upper bound, since an agent's own work comes on top of both. Prints p50 and p99 [us] of each and the medians' ratio.
"""

import os
import queue
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any

import typer
import zenoh

from agent_runtime.secured import client_tls
from agent_runtime.wiring import communicate_key
from agent_runtime.zenoh_wire import client_config, free_endpoint, keep_memory
from companion.design import DESIGN
from fipa_codec.performatives import Performative
from services.console.keys import written

SYSTEM = "bench"
LIMIT = 1.25
SIZES = {"654 B": (654, 200), "98 kB": (98_000, 50), "852 kB": (852_000, 15)}
"""Answer (paper, section 5.7: mean and largest of C4, largest of all): bytes, trips of a block."""
BLOCKS = 20
WITHIN_S = 20.0
ASK = communicate_key(SYSTEM, "C4", "pl", "km", "query", Performative.QUERY_REF)
ANSWER = communicate_key(SYSTEM, "C4", "km", "pl", "query", Performative.INFORM_REF)


def opened(address: str, folder: Path, identity: str) -> zenoh.Session:
    """A session, with keys where the address asks for them; the router may still be starting."""
    until = time.monotonic() + WITHIN_S
    while True:
        try:
            return zenoh.open(client_config(address, client_tls(folder, identity) if "tls/" in address else None))
        except zenoh.ZError:
            if time.monotonic() > until:
                raise
            time.sleep(0.05)


def answer(folder: Path, addresses: list[str]) -> None:
    """km on every router: answers a size with as many bytes, until it is ended."""
    keep_memory()
    kept: list[Any] = []
    for address in addresses:
        session = opened(address, folder, "km")

        def reply(sample: zenoh.Sample, session: zenoh.Session = session) -> None:
            session.put(ANSWER, bytes(int(sample.payload.to_string())))

        kept += [session, session.declare_subscriber(ASK, reply)]
    signal.pause()


class Asker:
    """pl on one router."""

    def __init__(self, address: str, folder: Path) -> None:
        self._session, self._heard = opened(address, folder, "pl"), queue.SimpleQueue[int]()
        self._ear = self._session.declare_subscriber(ANSWER, lambda one: self._heard.put(len(one.payload.to_bytes())))

    def trip(self, size: int) -> float:
        """Seconds until the answer of that size is here."""
        begin = time.perf_counter()
        self._session.put(ASK, str(size).encode())
        assert self._heard.get(timeout=WITHIN_S) == size
        return time.perf_counter() - begin

    def found(self) -> None:
        """Wait until km hears us."""
        until = time.monotonic() + WITHIN_S
        while time.monotonic() < until:
            self._session.put(ASK, b"1")
            try:
                self._heard.get(timeout=0.2)
                break
            except queue.Empty:
                continue
        time.sleep(0.5)
        while not self._heard.empty():
            self._heard.get()

    def close(self) -> None:
        """End the session."""
        self._session.close()  # type: ignore[no-untyped-call]


def run(folder: Path, blocks: int) -> None:
    """Start routers and km, measure by turns, print."""
    written(folder, DESIGN, SYSTEM)
    plain, secured = free_endpoint(), free_endpoint().replace("tcp/", "tls/")
    here, started = [sys.executable, str(Path(__file__).resolve())], []
    for address, keys in ((plain, ""), (secured, str(folder))):
        told = {"ROCO_LISTEN": address, "ROCO_RUN_DIR": str(folder / address[:3]), "ROCO_TLS_DIR": keys}
        command = [sys.executable, "-m", "services.router"]
        started.append(subprocess.Popen(command, env=os.environ | told | {"ROCO_SYSTEM": SYSTEM}))
    started.append(subprocess.Popen([*here, "--answer", f"{plain},{secured}", "--folder", str(folder)]))
    askers = [Asker(plain, folder), Asker(secured, folder)]
    try:
        for asker in askers:
            asker.found()
        for name, (size, trips) in SIZES.items():
            taken: tuple[list[float], list[float]] = ([], [])
            for _ in range(blocks):
                for asker, times in zip(askers, taken, strict=True):
                    times += [asker.trip(size) * 1e6 for _ in range(trips)]
            tell(name, *taken)
    finally:
        for asker in askers:
            asker.close()
        for process in reversed(started):
            process.terminate()
            process.wait(WITHIN_S)


def tell(name: str, plain: list[float], secured: list[float]) -> None:
    """A row."""
    one, other = (statistics.quantiles(times, n=100) for times in (plain, secured))
    ratio = other[49] / one[49]
    told = f"plain {one[49]:.0f} / {one[98]:.0f}, TLS and rights {other[49]:.0f} / {other[98]:.0f} us (p50 / p99)"
    print(f"{name:>7}: {told}; ratio {ratio:.2f} (limit {LIMIT}), n {len(plain)}", flush=True)


def main(
    quick: Annotated[bool, typer.Option(help="A few blocks.")] = False,
    answer_at: Annotated[str, typer.Option("--answer", hidden=True)] = "",
    folder: Annotated[Path | None, typer.Option(hidden=True)] = None,
) -> None:
    """Measure what mutual TLS and the rights cost."""
    if answer_at and folder is not None:
        answer(folder, answer_at.split(","))
        return
    with tempfile.TemporaryDirectory() as place:
        run(Path(place), 3 if quick else BLOCKS)


if __name__ == "__main__":
    typer.run(main)
