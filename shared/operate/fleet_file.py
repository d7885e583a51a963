"""What a fleet tells about itself: fleet.json, by its supervisor, and view.json, by its monitor."""

from enum import StrEnum

import msgspec


class ProcessState(StrEnum):
    """A process as the supervisor sees it."""

    WAITING = "waiting"
    STARTING = "starting"
    READY = "ready"
    BACKING_OFF = "backing-off"
    STOPPING = "stopping"
    STOPPED = "stopped"
    GIVEN_UP = "given-up"


class ProcessStatus(msgspec.Struct, frozen=True, omit_defaults=True):
    """One process: its pid (0: none), how often it was restarted, why it ended last.

    `optional`: the others do not need it. `module`: what Python runs.
    """

    name: str
    state: ProcessState
    pid: int = 0
    restarts: int = 0
    note: str = ""
    optional: bool = False
    module: str = ""


class Fleet(msgspec.Struct, frozen=True):
    """fleet.json, rewritten whole by the supervisor whenever something changes.

    `entry`, `project`: the system (operate.system): `module:NAME`, and the folder it is imported
    from. `agents`: where each agent is reached.
    """

    system: str
    connect: str
    supervisor: int
    started: float
    processes: tuple[ProcessStatus, ...]
    entry: str = ""
    project: str = ""
    agents: dict[str, str] = {}


class ViewAddress(msgspec.Struct, frozen=True):
    """view.json, written by the monitor: where Rerun's pictures of this run are served (gRPC), and
    its page (HTTP).
    """

    grpc: int
    web: int
