"""Two whole robots at one router, with keys and one monitor, as docs/sites.md says.

Each recording has its own robot's run.
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from toy_fleet import wait_for

from agent_runtime.io.sessions import free_endpoint
from companion.telemetry import TrueState
from companion.tools.system import SYSTEM
from companion.tools.telemetry import every
from companion.tools.verbs.hi import Hi, address
from console.fleet import starting
from console.fleet.local import Local
from console.runs import folders
from operate.recording.run import Run

pytestmark = [pytest.mark.zenoh, pytest.mark.long, pytest.mark.timeout(900)]

TOLD = {"velma1": ("take the jar", "jar_1"), "velma2": ("take the bowl", "bowl_1")}
ROBOT = "loop,km,pl,ta,ex,co,hi"
ENDED = ("done", "failed", "cancelled", "refused")
TRIES, PAUSE_S = 6, 5.0  # a robot that did not answer in time is busy for some seconds
READY_S, TASK_S = 180.0, 240.0  # estimates: two fleets on a loaded machine with two cores


class Site:
    """A folder with the keys, the site's own run, and a run for each robot."""

    def __init__(self, folder: Path) -> None:
        self.folder, keys = folder, folder / "keys"
        at = free_endpoint().replace("tcp/", "tls/")
        self.roco("keys", "make", str(keys), "--system", ",".join(TOLD))
        self.up(folder, "router,monitor", keys, ROCO_CONNECT=at)
        for name in TOLD:
            self.up(folder / name, ROBOT, keys / name, ROCO_SYSTEM=name, ROCO_CONNECT=at)

    def up(self, run: Path, only: str, keys: Path, **more: str) -> None:
        """A part of it, in the background."""
        told = {"ROCO_TLS_DIR": str(keys), "ROCO_SYSTEMS": ",".join(TOLD), "ROCO_VIEW": "off"}
        words = ("--only", only, "--speed", "max", "--no-wait")
        self.roco("up", "--out", str(run), *words, **told, **more)

    def roco(self, *words: str, **told: str) -> None:
        """`roco` with these variables; it must end well."""
        command = [sys.executable, "-m", "console", *words]
        env = os.environ | told
        done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=120.0)
        assert done.returncode == 0, done.stdout + done.stderr

    def ready(self, run: Path) -> bool:
        """Whether all of a part is."""
        now = folders.fleet(run)
        return now is not None and all(one.state == "ready" for one in now.processes)

    def down(self) -> None:
        """Robots first; the monitor then writes both reports."""
        for run in (*(self.folder / name for name in TOLD), self.folder):
            starting.down(run)


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    """Everything up."""
    made = Site(tmp_path)
    try:
        for run in (tmp_path, *(tmp_path / name for name in TOLD)):
            wait_for(lambda run=run: made.ready(run), f"all of {run.name} are ready", READY_S)
        yield made
    finally:
        made.down()


def hi(site: Site, name: str) -> Hi:
    """A person's way to a robot."""
    return Hi(address(Local(site.folder / name)))


def done(site: Site, told: dict[str, str]) -> None:
    """Tell each robot its sentence, all at once; whoever failed (a loaded machine is enough) is
    told again.
    """
    for _ in range(TRIES):
        tasks = {name: hi(site, name).say(words).task for name, words in told.items()}

        def state(name: str) -> str:
            """Of its task as it stands."""
            lines = hi(site, name).tasks()
            return next(one.state for one in lines if one.task == tasks[name])  # noqa: B023

        for name in tasks:
            wait_for(lambda n=name: state(n) in ENDED, f"{name} has ended its task", TASK_S)
        told = {name: words for name, words in told.items() if state(name) != "done"}
        if not told:
            return
        time.sleep(PAUSE_S)
    raise AssertionError({name: hi(site, name).tasks() for name in told})


def test_each_robot_does_what_it_was_told(site: Site) -> None:
    """At the same time: one takes the jar, the other the bowl. In the end each holds its own thing
    and nothing else; each recording has what its own agents logged, all of it and no more, and each
    robot has its report.
    """
    done(site, dict.fromkeys(TOLD, "look around"))
    done(site, {name: words for name, (words, _) in TOLD.items()})
    site.down()
    for name, (_, thing) in TOLD.items():
        run = site.folder / name
        past = Run(run, SYSTEM).history
        assert past.said
        assert not [hole for hole in past.holes if hole.communicates], past.holes
        assert not past.garbage
        fingers = every(past, TrueState)[-1][1].fingers_on
        held = {what for what, sides in fingers.items() if max(sides.values()) >= 3}
        assert held == {thing}, name
        report = msgspec.json.decode((run / "report.json").read_bytes())
        assert report["communicates"]["total"] == len(past.said)
        assert (run / "report.html").stat().st_size
