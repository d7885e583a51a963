"""The device of a bidder: it makes plans, and visits the robot, as a guest of its design."""

from pathlib import Path
from typing import Any

from agent_runtime.core.errors import RuntimeFault
from agent_runtime.io.devices import DeviceMaker, Post
from agent_runtime.io.guests import Visit
from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.secured import client_tls
from agent_runtime.io.visiting import Visiting
from companion.design import DESIGN as COMPANION
from companion.design import LANGUAGES as WORDS
from console.runs import folders

from dispatch.bidder.planning import Plan, Planning
from dispatch.design import DESIGN


def visit_of(run: Path, guest: str) -> Visit:
    """A visit of the fleet that runs in a folder. Raise OSError where none does."""
    told = folders.living(run)
    if told is None:
        raise OSError(f"nothing runs in {run}; `roco up --out {run}` starts a fleet")
    try:
        # not by the variables of this process, which name this system's keys
        tls = client_tls(run / KEYS_FOLDER, guest) if told.connect.startswith("tls/") else None
    except RuntimeFault as error:
        raise OSError(str(error)) from error
    return Visit(COMPANION, WORDS, guest, told.system, told.connect, tls)


class BidderDevice:
    """`robot`: the included system, whose fleet runs in `run`."""

    busy = False

    def __init__(self, post: Post, name: str, robot: str, run: Path) -> None:
        (guest,) = (one.guest for one in DESIGN.included[robot].entry.guest if one.agent == name)
        self._visiting = Visiting(post, robot, COMPANION, lambda: visit_of(run, guest))
        self._planning = Planning(post, self._visiting)

    def tell(self, content: Any) -> None:
        """Take a word of the agent."""
        if isinstance(content, Plan):
            self._planning.tell(content)
        else:
            self._visiting.tell(content)

    def close(self) -> None:
        """Leave the robot."""
        self._planning.close()
        self._visiting.close()


def device(name: str, robot: str, robots: dict[str, str]) -> DeviceMaker:
    """Raise ValueError where the file of orders does not say where the robot runs."""
    if robot not in robots:
        raise ValueError(f"[robots] has no {robot}; name the run folder of its fleet there")
    return lambda post: BidderDevice(post, name, robot, Path(robots[robot]))
