"""The process that draws: reads what the monitor hears from its standard input, and logs it to a
Rerun server.

What was before that it reads from the recording. The server is Rerun's own, a child of this
process: it serves viewers (gRPC) and the web viewer's page, whose connections this process passes
on. Both have a limit of memory: beyond it they end, and the next viewer has the monitor start them
again. Nobody waits for this process; it ends when nobody looks.
"""

import heapq
import os
import select
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import msgspec
import rerun as rr
import typer

from operate.file_names import TRAFFIC_FILE, VERDICTS_FILE
from operate.pictures import feed
from operate.pictures.blueprint import LIVE_S, YOUNG
from operate.pictures.file import NAME, laid_out
from operate.pictures.server import Server, ServerError, rss_mb
from operate.pictures.sheet import Sheet
from operate.pictures.stage import Stage
from operate.pictures.viewer_address import LOOPBACK, Place, free_port
from operate.recording.happenings import Happening, Lost, Reader
from operate.recording.mcap_file import Reading
from operate.recording.records import House, Spoken, understood
from operate.system import System, here
from operate.verdict_lines import Judged

# --- What was before somebody looked: of a run that goes on, from its recording and its verdicts --


SIGNALS_S = 900.0
"""Signals of the robot are drawn from so long before on [s], everything else from the beginning.
Drawing them takes a processor 2 % of their time, at the lowest of priorities (docs/rerun.md).
"""
LATE_S = 60.0
"""What agents logged, and a verdict about it, may come so much later than it was said [s];
estimate: answers are waited for that long.
"""
_decode = msgspec.json.Decoder(Judged).decode


class Past:
    """Happenings before `at` [unix s]; what comes from then on, who feeds the pictures has."""

    def __init__(self, at: float = 0.0) -> None:
        self._at = at
        self._judged: set[tuple[float, str, str]] = set()
        self._received: set[float] = set()

    def has(self, at: float) -> bool:
        """Whether the past has what was heard at `at` [unix s]."""
        return at < self._at and (at < self._at - LATE_S or at in self._received)

    def judged(self, one: Judged) -> bool:
        """Whether the past has this verdict."""
        return (one.t, one.id, one.verdict) in self._judged

    def read(self, run: Path, system: System, reader: Reader) -> Iterator[Happening]:
        """Yield them in the order of time."""
        return heapq.merge(
            self._heard(run, system, reader), self._verdicts(run), key=lambda one: one.at
        )

    def _heard(self, run: Path, system: System, reader: Reader) -> Iterator[Happening]:
        signals = system.addition("telemetry") or {}
        for record in Reading(run / TRAFFIC_FILE, system):
            old = record.received < self._at - SIGNALS_S
            if record.received >= self._at or (
                old and isinstance(record, House) and record.kind in signals
            ):
                continue
            if record.received > self._at - LATE_S:
                self._received.add(record.received)
            yield from reader.read(record)

    def _verdicts(self, run: Path) -> Iterator[Happening]:
        try:
            lines = (run / VERDICTS_FILE).open("rb")
        except FileNotFoundError:
            return
        with lines:
            for line in lines:
                if not line.endswith(b"\n"):  # it is being written
                    return
                one = _decode(line)
                if one.t >= self._at:
                    continue
                if one.t > self._at - LATE_S:
                    self._judged.add((one.t, one.id, one.verdict))
                yield Happening(one.t, one)


# --- Viewers' connections, passed on to Rerun's server: its ports are open before it runs, and a
# viewer has it started


MOST = 64
"""Connections at a time, two threads each; further ones wait (estimate: a browser has six)."""
PART_BYTES = 256 * 1024


class Forward:
    """Passes on what connects to `listener`, to `port` of this machine."""

    def __init__(self, listener: socket.socket, port: int) -> None:
        self._listener, self._port = listener, port
        self._room, self._lock = threading.BoundedSemaphore(MOST), threading.Lock()
        self._connected, self._left = 0, time.monotonic()
        threading.Thread(target=self._serve, daemon=True).start()

    @property
    def quiet_s(self) -> float:
        """Time since the last viewer left [s]; 0 while one is connected."""
        with self._lock:
            return 0.0 if self._connected else time.monotonic() - self._left

    def _serve(self) -> None:
        while True:
            self._room.acquire()
            viewer, _ = self._listener.accept()
            self._count(1)
            threading.Thread(target=self._join, args=(viewer,), daemon=True).start()

    def _count(self, more: int) -> None:
        with self._lock:
            self._connected += more
            self._left = time.monotonic()

    def _join(self, viewer: socket.socket) -> None:
        """Pass on what either side says until one of them ends the connection."""
        with suppress(OSError), viewer, socket.create_connection((LOOPBACK, self._port)) as server:
            back = threading.Thread(target=_pass, args=(server, viewer), daemon=True)
            back.start()
            _pass(viewer, server)
            back.join()
        self._count(-1)
        self._room.release()


def _pass(source: socket.socket, sink: socket.socket) -> None:
    with suppress(OSError):
        while data := source.recv(PART_BYTES):
            sink.sendall(data)
    for end in (source, sink):
        with suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)


# --- The process that draws -----------------------------------------------------------------------


FLUSH_S = 0.2
"""Pictures are renewed so often; estimate: an eye calls it smooth enough, and a flush costs 5-10
ms.
"""
OWN_MB = 700
"""More memory than this ends the process. It needs about 200 MB; Rerun's client may gather what its
server is slow to take.
"""
EARLY = 600
"""Happenings that wait for the first communicate; estimate: half a minute of telemetry and
truth.
"""
READ_BYTES = 256 * 1024
FLUSH_EVERY = 2000
"""Happenings of the past between two flushes; estimate: some seconds of a pour, 10 MB."""
NICENESS = 10
"""The fleet comes first."""
QUIET_S = 60.0
"""After the last viewer has left it ends; estimate: who reloads a page is back by then."""
Ports = tuple[socket.socket, socket.socket]
"""Those of viewers and of the page, which listen."""


class OverLimit(MemoryError):
    """A process of the pictures needs more memory than it may."""

    def __init__(self, who: str, found_mb: float, most_mb: float) -> None:
        super().__init__(
            f"{who} has {found_mb:.0f} MB, at most {most_mb:.0f} MB: pictures start over"
        )


class Child:
    """Draws what it reads until the pipe ends or nobody looks."""

    def __init__(self, run: Path, ports: Ports, system: System) -> None:
        self._run, self._system = run, system
        bind = ports[0].getsockname()[0]
        self._server = Server(run, Place(bind, free_port(LOOPBACK), free_port(LOOPBACK)))
        place = self._server.place
        self._viewers = [Forward(*one) for one in zip(ports, (place.grpc, place.web), strict=True)]
        self._past = Past()
        self._reader = Reader(system)
        self._stage: Stage | None = None
        self._early: list[Happening] = []
        self._idle, self._young = True, False
        self._out = rr.RecordingStream(NAME, recording_id=f"{NAME}-live-{time.time():.3f}")

    def serve(self, pipe: int) -> int:
        """Draw what comes through this file descriptor. 0: it ended, or nobody looks. Raises
        OverLimit, ServerError.
        """
        frames, flushed = feed.Frames(), time.monotonic()
        while True:
            if select.select([pipe], [], [], FLUSH_S)[0]:
                data = os.read(pipe, READ_BYTES)
                if not data:
                    return 0
                for item in frames.feed(data):
                    self._take(item)
            if time.monotonic() - flushed > FLUSH_S:
                self._flush()
                flushed = time.monotonic()
                if all(one.quiet_s > QUIET_S for one in self._viewers):
                    return 0

    def close(self) -> None:
        """End the server."""
        self._server.close()

    def _take(self, item: feed.Item) -> None:
        self._idle = False
        match item:
            case feed.Since(at=at):
                self._recall(at)
            case feed.Heard(sample=sample) if not self._past.has(sample.at):
                for happening in self._reader.read(understood(sample, self._system)):
                    self._draw(happening)
            case feed.ShownVerdict(judged=judged) if not self._past.judged(judged):
                self._draw(Happening(judged.t, judged))
            case feed.Missed(at=at, samples=count):
                self._draw(Happening(at, Lost(count)))

    def _recall(self, at: float) -> None:
        """Draw what the recording has of the time before `at` [unix s]."""
        self._past = Past(at)
        for count, happening in enumerate(
            self._past.read(self._run, self._system, self._reader), 1
        ):
            self._draw(happening)
            if count % FLUSH_EVERY == 0:
                self._flush()

    def _draw(self, happening: Happening) -> None:
        """Keep records from before the first communicate until it is there: time begins with it."""
        if self._stage is None:
            self._early.append(happening)
            if isinstance(happening.what, Spoken) or len(self._early) > EARLY:
                self._begin(happening.at)
        else:
            self._stage.take(happening)

    def _begin(self, at: float) -> None:
        rr.connect_grpc(
            self._server.url, default_blueprint=laid_out(self._system, YOUNG), recording=self._out
        )
        self._young = True
        self._stage = Stage(Sheet(self._out, at), self._system)
        for happening in self._early:
            self._stage.take(happening)
        self._early.clear()

    def _flush(self) -> None:
        if self._stage is not None:
            if self._young and time.time() - self._stage.sheet.begin > LIVE_S:
                self._young = False
                rr.send_blueprint(
                    laid_out(self._system, None), make_active=False, recording=self._out
                )
            if self._idle:  # else what comes says what time it is: it may have waited
                self._stage.pass_time(time.time() - FLUSH_S)
            self._stage.sheet.flush()
        self._idle = True
        own = rss_mb(os.getpid())
        if own > OWN_MB:
            raise OverLimit("what draws", own, OWN_MB)
        self._server.check()


def main(
    run: Annotated[Path, typer.Argument(help="The run's folder.")],
    grpc: Annotated[
        int, typer.Argument(help="File descriptor of the socket at which viewers connect.")
    ],
    web: Annotated[int, typer.Argument(help="That of the page.")],
) -> None:
    """Draw for Rerun what the monitor feeds on standard input; the monitor starts this."""
    os.nice(max(0, NICENESS - os.nice(0)))  # who started it may have given way already
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the monitor, which ends the pipe
    try:
        child = Child(run, (socket.socket(fileno=grpc), socket.socket(fileno=web)), here())
        try:
            raise typer.Exit(child.serve(sys.stdin.fileno()))
        finally:
            child.close()
    except (ServerError, OverLimit) as error:
        sys.exit(str(error))


if __name__ == "__main__":
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command()(main)
    app(prog_name="python -m operate.pictures")
