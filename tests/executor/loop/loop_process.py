"""A loop as a process of its own, and its agent's end of the slots."""

import os
import subprocess
import sys
import time
from contextlib import contextmanager

from services.executor.loop.link import AgentLink
from velma.errors import SlotError


def until(reached, within_s=40.0):
    """Wait for a condition of another process."""
    deadline = time.monotonic() + within_s
    while not reached():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.001)


def seen(agent):
    """Return the state; a reader may meet the writer."""
    while (state := agent.state()) is None:
        agent.beat()
    return state


@contextmanager
def loop_process(slots, **environment):
    """A loop at full speed that shows a state, killed at the end, and its agent."""
    before = slots.stat().st_ino if slots.exists() else 0
    command = [sys.executable, "-m", "services.executor.loop", "--slots", str(slots)]
    environment = os.environ | {"ROCO_SPEED": "max"} | environment
    child = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)

    def shows():
        assert child.poll() is None, child.returncode
        try:
            return slots.stat().st_ino != before and AgentLink(slots).state() is not None
        except (FileNotFoundError, SlotError):
            return False

    try:
        until(shows)
        yield child, AgentLink(slots)
    finally:
        child.kill()
        child.communicate(timeout=10)
