"""Back-ends by name: one that is not part of the project stands behind the loop, and what a wrong
name is told.
"""

import os
import subprocess
import sys
import time

import numpy as np
import pytest

from companion.skills.loop_messages import Phase, motion
from services.executor.loop.backends import SHORT, maker
from services.executor.loop.link import AgentLink
from velma.errors import BackendError, NoRobotError, SlotError
from velma.model import scene
from velma.names import START
from velma.sim.mock_backend import MockBackend
from velma.sim.mujoco_backend import MujocoBackend

MY_LAB = '''
from pathlib import Path

from velma.sim.mock_backend import MockBackend


class Marked(MockBackend):
    """Begins where no back-end of the project does; says at its end how many steps it took."""

    def __init__(self):
        super().__init__()
        self._steps = 0
        self.observe().q[0] = 0.25

    def step(self, command):
        super().step(command)
        self._steps += 1

    def close(self):
        Path("closed").write_text(str(self._steps))


make = Marked
for_scene = lambda scene: scene
half = object
def broken():
    raise OSError("no robot at 10.0.0.1")
def told_nothing():
    made = MockBackend()
    made.observe = lambda: {}
    return made
number = 5
'''


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """A folder with a module of one's own, which is the current one."""
    (tmp_path / "my_lab.py").write_text(MY_LAB, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield tmp_path
    sys.modules.pop("my_lab", None)


def test_a_back_end_of_ones_own_runs_in_the_loop(lab):
    """`--backend my_lab:make` in the folder of my_lab.py: its state is shown, a motion is done, it
    is closed.

    With PYTHONSAFEPATH, as the supervisor starts the loop.
    """
    slots = lab / "loop.slots"
    command = [
        sys.executable,
        "-m",
        "services.executor.loop",
        "--slots",
        str(slots),
        "--speed",
        "max",
    ]
    own = {"ROCO_BACKEND": "my_lab:make", "PYTHONSAFEPATH": "1"}
    child = subprocess.Popen(command, env=os.environ | own, stderr=subprocess.PIPE, text=True)
    try:
        deadline = time.monotonic() + 40
        agent = reached(slots, child, deadline)
        start = START + 0.25 * (np.arange(15) == 0)
        np.testing.assert_allclose(agent.state().q, start, atol=1e-9)
        agent.send(motion("turn", start + np.linspace(0.0, 0.05, 50)[:, None] ** 2))
        phase = Phase.RUNNING
        while phase is not Phase.DONE and time.monotonic() < deadline:
            agent.beat()
            report = agent.told().report
            phase = report.phase if report.key == "turn" else Phase.RUNNING
        assert phase is Phase.DONE, agent.told()
        child.terminate()
        _, said = child.communicate(timeout=20)
    finally:
        child.kill()
    assert child.returncode == 0
    assert "my_lab:make" in said
    cycles = int(said.rpartition(" after ")[2].split()[0])
    assert (lab / "closed").read_text() == str(cycles)


def reached(slots, child, deadline):
    """The agent's end of the slots, once the loop has shown a state."""
    while time.monotonic() < deadline and child.poll() is None:
        try:
            agent = AgentLink(slots)
            if agent.state() is not None:
                return agent
        except SlotError:
            os.sched_yield()
    raise AssertionError(f"no state; exit code {child.poll()}")


@pytest.mark.parametrize(("short", "kind"), [("mujoco", MujocoBackend), ("mock", MockBackend)])
def test_a_short_name_is_the_same_as_the_long_one(short, kind):
    """And the simulator stands in the scene that is asked for."""
    asked = scene.vary(scene.load(), 3)
    for name in (short, SHORT[short]):
        made = maker(name, asked)()
        assert type(made) is kind
        assert getattr(made, "scene", asked) is asked


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("", "Empty module name"),
        ("mujoko", "No module named 'mujoko'"),
        ("my_lab", "no attribute ''"),
        ("my_lab:mke", "no attribute 'mke'"),
        ("my_lab:number", "number is of type int"),
        ("my_lab:half", "made a object without period_s, observe, step, configuration, work_J"),
        ("my_lab:for_scene", "made a Scene without period_s"),
    ],
)
def test_a_wrong_name_is_told_what_is_wrong_what_is_right_and_what_to_do(lab, name, found):
    """Before anything is started for it."""
    with pytest.raises(BackendError) as caught:
        maker(name, scene.load())()
    said = str(caught.value)
    assert said.startswith(f"back-end {name!r}: ")
    assert found in said
    wanted, do = (
        ("velma.sim.backend.Backend", "docs/back-ends.md")
        if "made a" in found
        else (SHORT, "mend the name")
    )
    assert all(word in said for word in ([wanted] if isinstance(wanted, str) else wanted))
    assert do in said


def test_what_its_function_raises_is_told(lab):
    """The robot may answer later: an error of its own."""
    with pytest.raises(
        NoRobotError, match=r"my_lab:broken.*OSError: no robot at 10\.0\.0\.1.*answers"
    ):
        maker("my_lab:broken", scene.load())()


def test_a_state_of_another_kind_is_told_before_the_loop_reads_it(lab):
    """With what makes one."""
    with pytest.raises(BackendError, match=r"observe\(\) returned a dict.*at_rest\(\)"):
        maker("my_lab:told_nothing", scene.load())()


def test_the_loop_says_a_wrong_name_in_one_line(tmp_path):
    """Exit code 2, with which no supervisor tries again."""
    command = [
        sys.executable,
        "-m",
        "services.executor.loop",
        "--slots",
        str(tmp_path / "s"),
        "--backend",
        "mujoko",
    ]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert ended.returncode == 2
    assert ended.stderr.startswith(
        "loop: back-end 'mujoko': No module named 'mujoko', expected package.module:"
    )
    assert len(ended.stderr.splitlines()) == 1
