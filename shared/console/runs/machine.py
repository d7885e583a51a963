"""The machine on which something is measured, and the sources it is measured with: what a result
must name.
"""

import contextlib
import os
import platform
import subprocess
import time
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PROJECT = "robot-companion"
LOOK_S = 5.0
"""Linux renews its load that often."""


def load() -> float:
    """Processes that want to run, mean of the last minute."""
    return os.getloadavg()[0]


def quiet(most: float, patience_s: float, tick: Callable[[float, float], None]) -> bool:
    """Wait until the load is at most this, but not for ever; `tick` gets the load and the seconds
    waited so far.

    False: it never was.
    """
    began = time.monotonic()
    while (now := load()) > most:
        waited = time.monotonic() - began
        if waited > patience_s:
            return False
        tick(now, waited)
        time.sleep(min(LOOK_S, patience_s))
    return True


def installed() -> str:
    """The version of the project that is installed."""
    try:
        return version(PROJECT)
    except PackageNotFoundError:
        return "not installed"


def commit() -> str:
    """The commit of the sources, with "+" where they were changed since; "" outside of a
    checkout.
    """
    root = Path(__file__).parents[4]
    # installed; git would find a repository around the environment
    if not (root / ".git").exists():
        return ""
    describe = ("describe", "--always", "--dirty=+", "--abbrev=12", "--exclude=*")
    try:
        asked = ["git", "-C", str(root), *describe]
        done = subprocess.run(asked, capture_output=True, text=True, timeout=10.0)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip()


def processor() -> str:
    """Return the machine's name of its processor."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
