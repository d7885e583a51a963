"""The proxy of a run: `python -m operate.wires`, started by the supervisor of a fleet that is up
with `--faults`.
"""

import asyncio
import random
import signal
from functools import partial

from agent_runtime.io import cli
from agent_runtime.io.options import Options
from agent_runtime.io.process_heartbeat import ProcessHeartbeat
from operate.wires import files
from operate.wires.files import Conditions
from operate.wires.wire import Wire

NAME = "wires"
PERIOD_S = 0.02
"""Between two looks at the files of conditions; estimate: less than what a fault is meant to be
exact to.
"""


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


async def forward(options: Options) -> int:
    """Forward until SIGTERM. 0: ended in order; 1: no wires are told."""
    if (listed := files.listed(options.connect, options.agents, options.listen)) is not None:
        options.run_dir.mkdir(parents=True, exist_ok=True)
        files.tell(options.run_dir, listed)
    wires = files.wires_of(options.run_dir)
    if wires is None:
        print(
            f"{options.run_dir} has no {files.WIRES_FILE}; the supervisor writes it (`roco up"
            " --faults`)",
            flush=True,
        )
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
    cli.run(
        NAME,
        "Forwards between agents and router, and between agents, and disturbs on demand.",
        lambda o: asyncio.run(forward(o)),
    )


if __name__ == "__main__":
    main()
