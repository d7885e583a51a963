"""The process that prints what goes by in a fleet (operate.recording.hear), here or in the
monitor's container. It ends with its standard input, so it never outlives who asked.
"""

import subprocess
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from agent_runtime.io.tap import Sample, Waiting
from operate.cli.errors import NO, NOTHING_RUNS, ConsoleError

END_S = 5.0
"""Time to wait for its end [s] (estimate: it takes a tenth)."""
PAUSE_S = 0.1
"""Silence after which the listener gets something else to do [s]."""
NO_ROUTER = 3
"""Its exit code where no router answers."""


class LostError(ConsoleError):
    """The process ended, and nobody had asked it to; its last words say why."""

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        words = (
            process.stderr.read().decode(errors="replace").strip().splitlines()
            if process.stderr
            else []
        )
        why = words[-1] if words else "its monitor was stopped"
        unheard = process.returncode == NO_ROUTER
        self.code = NOTHING_RUNS if unheard else NO
        super().__init__(why if unheard else f"nothing more is heard of the fleet: {why}")


@contextmanager
def hearing(
    command: list[str], environment: Mapping[str, str]
) -> Iterator["subprocess.Popen[bytes]"]:
    """The process, until the end of the block; Ctrl-C in the terminal does not reach it."""
    pipe = subprocess.PIPE
    with subprocess.Popen(
        command, env=environment, stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True
    ) as process:
        try:
            yield process
        finally:
            assert process.stdin is not None
            process.stdin.close()
            try:
                process.wait(END_S)
            except subprocess.TimeoutExpired:
                process.kill()


def samples(process: "subprocess.Popen[bytes]", waiting: Waiting) -> Iterator[Sample | None]:
    """Yield the samples it prints, and None after a pause without any. Raises LostError when it
    ends.
    """
    assert process.stdout is not None
    threading.Thread(target=waiting.fill, args=(process.stdout,), daemon=True).start()
    while not waiting.stopped:
        yield waiting.get(PAUSE_S)
    yield from waiting.left()
    process.wait(END_S)
    raise LostError(process)
