"""Two hosts on one machine: two network namespaces joined by a pair of virtual interfaces, as by a
cable.

Each has its own interfaces, addresses and routes; nothing but the cable joins them, neither to each
other nor to the machine's network. Needs root and iproute2. Names end in the process id: several
pairs may be there at once.
"""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ADDRESSES = {"desk": "10.77.0.1", "robot": "10.77.0.2"}
"""Of the two hosts; no other network is reached from there."""
ASK_S = 30.0  # estimate: for a question to the kernel


class CannotError(Exception):
    """Something is missing on this machine; the message says what it is and what to do."""


class Host:
    """One of the two; `ip netns exec` runs programs there."""

    def __init__(self, name: str) -> None:
        self.name, self.address = name, ADDRESSES[name]
        self.space, self.device = f"roco-{name}-{os.getpid()}", f"v{name}{os.getpid()}"[:15]

    def inside(self, *command: str) -> list[str]:
        """The command as it is run there."""
        return ["ip", "netns", "exec", self.space, *command]

    def cable(self, *, plugged: bool) -> None:
        """Pull this end of the cable, or plug it in: whoever is connected is not told."""
        ip("-n", self.space, "link", "set", self.device, "up" if plugged else "down")

    def carried(self) -> tuple[int, int]:
        """Bytes that left this host and that came to it over the cable, with all headers."""
        counters = [f"/sys/class/net/{self.device}/statistics/{way}_bytes" for way in ("tx", "rx")]
        sent, heard = run(self.inside("cat", *counters)).split()
        return int(sent), int(heard)

    def clear(self) -> None:
        """End what runs there, by its process ids, and remove the namespace; its interface goes
        with it.
        """
        found = subprocess.run(
            ["ip", "netns", "pids", self.space], capture_output=True, text=True, check=False
        )
        for pid in found.stdout.split():
            if Path(f"/proc/{pid}").exists():
                subprocess.run(["kill", "-KILL", pid], capture_output=True, check=False)
        subprocess.run(["ip", "netns", "delete", self.space], capture_output=True, check=False)


@contextmanager
def two_hosts() -> Iterator[tuple[Host, Host]]:
    """The desk and the robot, joined; both are gone afterwards, with whatever still runs there."""
    if os.geteuid() != 0:
        raise CannotError("network namespaces are made by root: sudo scripts/two-hosts")
    if shutil.which("ip") is None:
        raise CannotError("there is no `ip` here (Debian: apt install iproute2)")
    desk, robot = Host("desk"), Host("robot")
    try:
        for host in (desk, robot):
            ip("netns", "add", host.space)
        ip(
            "-n",
            desk.space,
            "link",
            "add",
            desk.device,
            "type",
            "veth",
            "peer",
            robot.device,
            "netns",
            robot.space,
        )
        for host in (desk, robot):
            ip("-n", host.space, "address", "add", f"{host.address}/24", "dev", host.device)
            for device in ("lo", host.device):
                ip("-n", host.space, "link", "set", device, "up")
        yield desk, robot
    finally:
        for host in (desk, robot):
            host.clear()


def ip(*words: str) -> None:
    """`ip ...`; CannotError with what it said where it refuses."""
    run(["ip", *words])


def run(command: list[str], within_s: float = ASK_S) -> str:
    """Return a command's output. Raises CannotError with it if the command ends with another code
    than 0.
    """
    done = subprocess.run(command, capture_output=True, text=True, timeout=within_s, check=False)
    if done.returncode != 0:
        raise CannotError(f"{' '.join(command)}: {(done.stderr or done.stdout).strip()}")
    return done.stdout
