"""Start options of every service; cli.py fills them from the command line and the environment."""

from enum import StrEnum
from pathlib import Path

import msgspec

AGENTS_VARIABLE = "ROCO_AGENTS"
LISTEN_VARIABLE = "ROCO_LISTEN"
USAGE_ERROR = 2
"""Exit status of a service after a wrong option or environment: trying again cannot help, and no
supervisor does.
"""


class Linking(StrEnum):
    """Ways by which agents reach each other."""

    DIRECT = "direct"
    UNIX = "unix"


HOW_LINKED = (
    "direct: agents are linked with each other by TLS. unix: by sockets of this host, without TLS,"
    " for a machine with a single user."
)
"""The help of the option `--links`."""


class Options(msgspec.Struct, frozen=True, kw_only=True):
    """`agents`: where each agent is reached by its neighbours.

    `connect`: the router's endpoint; `listen`: where a router or an agent itself listens, of a
    router several with a comma between; "": a router at `connect`, an agent where `agents` has it;
    `run_dir`: files of this run.

    `systems`: of a router or recorder that serves several robots, else () and `system` alone.
    `speed`: "1" (simulated time is real time) or "max"; `seed`: varies poses and noise; `scene`: a
    scene's TOML file, None for the canonical one. `keys`: folder of keys (secured.py): sessions are
    encrypted and say who they are; None: they are not. `replay`: a step log that an agent runs
    again instead of serving (steplog.py).
    """

    connect: str = "tcp/127.0.0.1:7447"
    listen: str = ""
    system: str = "roco"
    systems: tuple[str, ...] = ()
    run_dir: Path = Path("runs/manual")
    log_level: str = "info"
    speed: str = "1"
    seed: int = 1
    scene: Path | None = None
    keys: Path | None = None
    agents: dict[str, str] = {}
    replay: Path | None = None

    @property
    def all_systems(self) -> tuple[str, ...]:
        """The systems that a router or recorder serves."""
        return self.systems or (self.system,)
