"""A supervisor's shell that a test steps."""

import time
from collections.abc import Callable

from operate.supervisor.shell import Shell


def until(shell: Shell, condition: Callable[[], bool]) -> None:
    """Step the shell until the condition holds; pytest's time-out ends a wait for ever."""
    while not condition():
        shell.step(time.monotonic())
        shell.end_asked.wait(0.01)


def ended(shell: Shell) -> None:
    """Ask it to end, and step it until all have."""
    shell.end_asked.set()
    until(shell, lambda: shell.fleet.ended)
