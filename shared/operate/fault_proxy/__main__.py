"""The proxy of a run: `python -m operate.fault_proxy`, started by the supervisor of a fleet that is
up with `--faults`. A wire carries the connections of an agent to a router or a neighbour and back
under the conditions that hold now.

TCP delivers every byte in order, so a lost piece is one that comes late, and holds up what is
behind it: after Linux's shortest retransmission time, doubled for each further loss. A cut wire
delivers nothing, not even an end.
"""

import asyncio
import random
import signal
from collections import deque
from collections.abc import Callable
from functools import partial

from agent_runtime.io import cli
from agent_runtime.io.options import Options
from agent_runtime.io.run_files import ProcessHeartbeat
from operate.fault_proxy import files
from operate.fault_proxy.files import Conditions

NAME = "wires"
PERIOD_S = 0.02
"""Between two looks at the files of conditions; estimate: less than what a fault is meant to be
exact to.
"""
PIECE = 16 * 1024
"""Bytes read at once: so much is lost, or has its bit turned over (a TLS record at most)."""
SEGMENT = 1460
"""Bytes of a piece that passes at a bounded rate: a segment of Ethernet."""
AGAIN_S, LONGEST_AGAIN_S = 0.2, 3.0
"""TCP_RTO_MIN of Linux; estimate of the longest wait of one piece (TCP itself goes on to 120 s)."""
KEPT = 1024 * 1024
"""Bytes on the way in each direction; estimate: a socket's buffers."""
LOOK_S = 0.01

Now = Callable[[], Conditions]


class Board:
    """The conditions of all wires now."""

    def __init__(self, options: Options) -> None:
        self._run = options.run_dir
        self._now: dict[str, Conditions] = {}

    def look(self) -> None:
        """Read them again."""
        self._now = files.conditions(self._run)

    def of(self, agent: str, end: str) -> Conditions:
        """Return those of the wire from an agent to an end: of the two alone, else of all wires of
        either.
        """
        names = (f"{agent}-{end}", f"{end}-{agent}", agent, end)
        return next((self._now[name] for name in names if name in self._now), Conditions())


class Way:
    """One direction of a connection. `now`: its conditions; `chance`: from 0 to 1, for what happens
    to pieces.
    """

    def __init__(self, now: Now, chance: random.Random) -> None:
        self._now, self._chance = now, chance
        self._pieces: deque[tuple[float, bytes]] = deque()
        self._bytes, self._free_at = 0, 0.0
        self._changed = asyncio.Condition()

    async def forward(self, source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
        """Forward until the source ends, then end the sink; ConnectionError where one of the two
        breaks.
        """
        reading = asyncio.create_task(self._read(source))
        try:
            while (piece := await self._next()) is not None:
                for segment in self._segments(piece):
                    await self._pass(len(segment))
                    sink.write(segment)
                    await sink.drain()
            await reading
            if sink.can_write_eof():
                sink.write_eof()
        finally:
            reading.cancel()

    async def _read(self, source: asyncio.StreamReader) -> None:
        """Take pieces in, as long as there is room; an empty one is the end."""
        data = b"-"
        while data:
            try:
                data = await source.read(PIECE)
            except ConnectionError:
                data = b""
            due = asyncio.get_running_loop().time() + self._late()
            async with self._changed:
                self._pieces.append((due, self._disturbed(data)))
                self._bytes += len(data)
                self._changed.notify_all()
                await self._changed.wait_for(lambda: self._bytes < KEPT)

    async def _next(self) -> bytes | None:
        """Return the oldest piece once it is due and the wire is whole; None: the end."""
        async with self._changed:
            await self._changed.wait_for(lambda: self._pieces)
            due, data = self._pieces.popleft()
        while (left := due - asyncio.get_running_loop().time()) > 0 or self._now().cut:
            await asyncio.sleep(max(left, LOOK_S))
        async with self._changed:
            self._bytes -= len(data)
            self._changed.notify_all()
        return data or None

    async def _pass(self, size: int) -> None:
        """Wait until that many bytes may pass at the present rate."""
        while self._now().cut:
            await asyncio.sleep(LOOK_S)
        if rate := self._now().rate:
            now = asyncio.get_running_loop().time()
            self._free_at = max(now, self._free_at) + size / rate
            await asyncio.sleep(self._free_at - now)

    def _segments(self, piece: bytes) -> list[bytes]:
        step = SEGMENT if self._now().rate else len(piece)
        return [piece[at : at + step] for at in range(0, len(piece), step)]

    def _late(self) -> float:
        """Return how much later a piece comes than it was sent [s]."""
        late, again, loss = self._now().delay, AGAIN_S, min(self._now().loss, 1.0)
        while again <= LONGEST_AGAIN_S and self._chance.random() < loss:
            late, again = late + again, 2 * again
        return late

    def _disturbed(self, piece: bytes) -> bytes:
        """Return a piece, perhaps with a bit turned over."""
        if not piece or self._chance.random() >= self._now().corrupt:
            return piece
        at = self._chance.randrange(8 * len(piece))
        return piece[: at // 8] + bytes([piece[at // 8] ^ (1 << at % 8)]) + piece[at // 8 + 1 :]


class Wire:
    """All connections of an agent to `host` and `port`."""

    def __init__(self, host: str, port: int, now: Now, chance: random.Random) -> None:
        self._host, self._port, self._now, self._chance = host, port, now, chance

    async def connected(self, source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
        """Forward a connection until one side ends it; where the other is not there, it is closed
        at once.
        """
        try:
            back, forth = await asyncio.open_connection(self._host, self._port)
        except OSError:
            sink.close()
            return
        ways = [
            Way(self._now, self._chance).forward(*ends) for ends in ((source, forth), (back, sink))
        ]
        tasks = [asyncio.create_task(way) for way in ways]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_EXCEPTION)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            forth.close()
            sink.close()


async def forward(options: Options) -> int:
    """Forward until SIGTERM. 0: ended in order; 1: no wires are told."""
    if (listed := files.listed(options.connect, options.agents, options.listen)) is not None:
        options.run_dir.mkdir(parents=True, exist_ok=True)
        files.tell(options.run_dir, listed)
    wires = files.wires_of(options.run_dir)
    if wires is None:
        why = f"has no {files.WIRES_FILE}; the supervisor writes it (`roco up --faults`)"
        print(f"{options.run_dir} {why}", flush=True)
        return 1
    ended, board = asyncio.Event(), Board(options)
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, ended.set)
    chance = random.Random(options.seed)
    board.look()
    for agent, ports in wires.ports.items():
        for end, port in ports.items():
            wire = Wire(*wires.ends[end], partial(board.of, agent, end), chance)
            await asyncio.start_server(wire.connected, wires.bind, port)
    pulse, ready = ProcessHeartbeat(options.run_dir, NAME), options.run_dir / f"{NAME}.ready"
    ready.touch()
    while not ended.is_set():
        pulse.beat()
        board.look()
        await asyncio.sleep(PERIOD_S)
    ready.unlink(missing_ok=True)
    return 0


def main() -> None:
    """Serve until a signal; ends the process."""
    text = "Forwards between agents and router, and between agents, and disturbs on demand."
    cli.run(NAME, text, lambda options: asyncio.run(forward(options)))


if __name__ == "__main__":
    main()
