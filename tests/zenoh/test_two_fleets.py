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
from companion.run_files import TaskLine
from companion.tools.system import SYSTEM
from companion.tools.telemetry import truth
from companion.tools.verbs.hi import Hi, address
from operate.cli.fleet import starting
from operate.cli.fleet.local import Local
from operate.cli.runs import folders
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
        told = {
            "ROCO_TLS_DIR": str(keys),
            "ROCO_SYSTEMS": ",".join(TOLD),
            "ROCO_VIEW": "off",
        }
        words = ("--only", only, "--speed", "max", "--no-wait")
        self.roco("up", "--out", str(run), *words, **told, **more)

    def roco(self, *words: str, **told: str) -> None:
        """`roco` with these variables; it must end well."""
        command = [sys.executable, "-m", "operate.cli", *words]
        done = subprocess.run(
            command,
            env=os.environ | told,
            capture_output=True,
            text=True,
            timeout=120.0,
            check=False,
        )
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


def done(site: Site, told: dict[str, str]) -> None:
    """Tell each robot its sentence, all at once; whoever failed (a loaded machine is enough) is
    told again.
    """
    for _ in range(TRIES):
        tasks = {
            name: Hi(address(Local(site.folder / name))).say(words).task
            for name, words in told.items()
        }
        for name, task in tasks.items():
            wait_for(
                lambda n=name, t=task: line(site, n, t).state in ENDED,
                f"{name} has ended its task",
                TASK_S,
            )
        told = {
            name: told[name]
            for name, task in tasks.items()
            if line(site, name, task).state != "done"
        }
        if not told:
            return
        time.sleep(PAUSE_S)
    raise AssertionError({name: Hi(address(Local(site.folder / name))).tasks() for name in told})


def line(site: Site, name: str, task: str) -> TaskLine:
    """A task of a robot as it stands."""
    return next(one for one in Hi(address(Local(site.folder / name))).tasks() if one.task == task)


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
        held = {
            what
            for what, sides in truth(past)[-1][1].fingers_on.items()
            if any(n >= 3 for n in sides.values())
        }
        assert held == {thing}, name
        report = msgspec.json.decode((run / "report.json").read_bytes())
        assert report["communicates"]["total"] == len(past.said)
        assert (run / "report.html").stat().st_size
